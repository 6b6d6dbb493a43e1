"""Identities of trials and entries: what they depend on."""

import ast
import os
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import pytest

import mvpose
import simharness
from simharness.runtime.version import files_of
from simharness.scenario.load import load, load_study
from simharness.scenario.sections.section import Section
from simharness.study.study_folder import plan
from simharness.trial import identity
from simharness.trial.identity import entry_identity, estimator_code, trial_identity

QUICKSTART = Path(__file__).parents[3] / "scenarios" / "quickstart.toml"


@pytest.fixture(scope="module")
def quickstart():
    return load(QUICKSTART)


def changed(section, above=()):
    """Yield every scenario that differs from this one in one value, by the dotted key of the value."""
    for key, value in section:
        if isinstance(value, Section):
            for dotted, other in changed(value, (*above, key)):
                yield dotted, section.model_copy(update={key: other})
        else:
            yield ".".join((*above, key)), section.model_copy(update={key: other_than(value)})


def other_than(value):
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, tuple):
        return (*value, *(value[:1] or (1,)))
    return f"{value or ''}x"


NAMES = {"name", "description", "detector.name"}


@pytest.mark.filterwarnings("ignore::UserWarning:pydantic")  # changed values need not be of the right type
def test_every_value_counts_except_names_and_the_method(quickstart):
    identities = {dotted: trial_identity(other) for dotted, other in changed(quickstart)}
    assert len(identities) > 150
    current = trial_identity(quickstart)
    assert {dotted for dotted, each in identities.items() if each == current} == {
        *NAMES,
        "method.variants",
        "method.lag",
        "detector.network",  # the detector of this scenario is simulated
    }
    others = [each for each in identities.values() if each != current]
    assert len(set(others)) == len(others)


def test_a_renamed_and_moved_scenario_has_the_same_identity(tmp_path, quickstart):
    text = QUICKSTART.read_text().replace('name = "quickstart"', 'name = "renamed"')
    (tmp_path / "other.toml").write_text(text)
    assert trial_identity(load(tmp_path / "other.toml")) == trial_identity(quickstart)


def test_a_trial_of_two_different_studies_has_the_same_identity(tmp_path):
    (tmp_path / "one.toml").write_text('name = "one"\nseeds = [3, 4]\n[cameras]\ncount = 4\n[people]\ncount = 2\n')
    (tmp_path / "base.toml").write_text('name = "base"\nseed = 4\npeople.count = 2\n')
    (tmp_path / "two.toml").write_text(
        'extends = "base.toml"\nname = "two"\nvariants = ["fast"]\nsweep.cameras.count = [3, 4]\n'
    )
    one, two = load_study(tmp_path / "one.toml"), load_study(tmp_path / "two.toml")
    assert trial_identity(one.at(one.settings[0], 4)) == trial_identity(two.at(two.settings[1], 4))
    assert trial_identity(one.at(one.settings[0], 3)) != trial_identity(two.at(two.settings[1], 4))


def test_code_and_versions_count(quickstart, monkeypatch):
    current, trial = identity.code(), trial_identity(quickstart)
    entry = entry_identity(trial, "full")
    monkeypatch.setattr(identity, "code", lambda: replace(current, method="another"))
    assert trial_identity(quickstart) == trial
    assert entry_identity(trial, "full") != entry
    monkeypatch.setattr(identity, "code", lambda: replace(current, simulation="another"))
    assert trial_identity(quickstart) != trial
    monkeypatch.setattr(identity, "code", lambda: current)
    assert trial_identity(quickstart) == trial
    monkeypatch.setattr(identity, "versions", lambda: {"numpy": "1.0"})
    assert trial_identity(quickstart) != trial


def test_an_entry_depends_on_trial_and_variant(quickstart):
    trial = trial_identity(quickstart)
    identities = {entry_identity(each, name) for each in (trial, trial[::-1]) for name in ("full", "fast")}
    assert len(identities) == 4


def test_a_user_defined_estimator_counts_by_its_content(tmp_path, monkeypatch):
    places = {}
    for folder, text in (("one", "1"), ("same", "1"), ("other", "2"), ("helped", "1")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "custom.py").write_text(text)
        places[folder] = f"{tmp_path / folder / 'custom.py'}:Custom"
    (tmp_path / "helped" / "helper.py").write_text("3")
    digests = {folder: estimator_code(place) for folder, place in places.items()}
    assert digests["one"] == digests["same"]
    digests["name"] = estimator_code(places["one"] + "2")
    assert len(set(digests.values())) == 4

    def identities(folder):
        path = tmp_path / "study.toml"
        path.write_text(
            f'name = "study"\nvariants = ["full", "custom"]\nmethod.estimators.custom = "{folder}/custom.py:Custom"'
        )
        (planned,) = plan(load_study(path))
        return planned.trial, planned.entries["full"], planned.entries["custom"]

    assert identities("one") == identities("same")
    assert identities("one")[:2] == identities("other")[:2]
    assert identities("one")[2] != identities("other")[2]
    current = identity.code()
    before = identities("one")[2]
    monkeypatch.setattr(identity, "code", lambda: replace(current, method="another"))
    assert identities("one")[2] != before  # because it may use mvpose


@pytest.mark.parametrize(
    ("key", "name", "beside"),
    [
        ("cameras.file", "intri.yml", "extri.yml"),
        ("cameras.file", "rig.json", None),
        ("appearance.network", "net.onnx", "net.json"),
        ("detector.onnx", "head.onnx", None),
        ("people.motion.file", "walk.amc", "actor.asf"),
    ],
)
def test_files_count_by_their_content(tmp_path, quickstart, key, name, beside):
    def at(folder):
        more = ['people.activities=["mocap"]'] if key.startswith("people") else []
        return trial_identity(load(QUICKSTART, overrides=[f'{key}="{folder / name}"', *more]))

    one, copy = tmp_path / "one", tmp_path / "copy"
    one.mkdir()
    absent = at(one)
    for file in filter(None, (name, beside)):
        (one / file).write_bytes(b"one")
    (one / "README").write_text("nobody reads it")
    shutil.copytree(one, copy)
    assert at(one) == at(copy)
    assert len({absent, at(one), trial_identity(quickstart)}) == 3
    (copy / "README").write_text("changed")
    assert at(one) == at(copy)
    for file in filter(None, (beside, name)):
        before = at(copy)
        (copy / file).write_bytes(b"another")
        assert at(copy) != before


@pytest.fixture(scope="module")
def copies(tmp_path_factory):
    """Return a folder with copies of both packages, whose unchanged modules are read once in all tests."""
    folder = tmp_path_factory.mktemp("copies")
    for package in (simharness, mvpose):
        source = Path(package.__file__).parent
        shutil.copytree(source, folder / source.name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


class TestCode:
    @pytest.fixture
    def copied(self, copies, monkeypatch):
        """Return the copies, and a function that returns their current digests; changes of a test are taken back."""
        for package in (simharness, mvpose):
            monkeypatch.setattr(package, "__file__", str(copies / package.__name__ / "__init__.py"))
        before = {file: (file.read_bytes(), file.stat()) for file in copies.rglob("*") if file.is_file()}
        yield copies, identity.code.__wrapped__
        for file in copies.rglob("*"):
            if file.is_file() and file not in before:
                file.unlink()
        for file, (content, status) in before.items():
            now = file.stat() if file.exists() else None
            if now is None or (now.st_mtime_ns, now.st_size) != (status.st_mtime_ns, status.st_size):
                file.write_bytes(content)
                os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("file", "counts"),
        [
            ("simharness/world/scene/build.py", {"simulation"}),
            ("simharness/world/humans/data/anny.npz", {"simulation"}),
            ("simharness/detector/detect.py", {"simulation"}),
            ("simharness/trial/stages/estimation.py", {"simulation"}),
            ("simharness/types/truth.py", {"simulation", "scores", "failures"}),
            ("simharness/scoring/pcp.py", {"scores"}),
            ("simharness/scoring/pairing.py", {"scores", "failures"}),
            ("simharness/scoring/stage_blame.py", {"failures"}),
            ("mvpose/matching/admm.py", {"method"}),
            ("mvpose/networks/data/reid.onnx", {"method"}),
            ("mvpose/formats/calibration/opencv.py", {"simulation"}),
            ("mvpose/formats/people/trc.py", {"simulation"}),
            ("mvpose/networks/crops.py", {"simulation", "method"}),  # networks read the pictures of trials
            ("mvpose/formats/detections/openpose.py", set()),
            ("mvpose/files/input_files.py", set()),
            ("mvpose/pyproject.toml", set()),
            ("simharness/cli/run_command.py", set()),
            ("simharness/outputs/run/page.py", set()),
            ("simharness/study/trial_store.py", set()),
            ("simharness/trial/run_trial.py", set()),
            ("simharness/statistics/intervals.py", set()),
            ("simharness/scenario/sweep.py", set()),
            ("simharness/world/scene/__pycache__/build.cpython-311.pyc", set()),
        ],
    )
    def test_code_and_data_count_where_they_make_results(self, copied, file, counts):
        folder, code = copied
        before = asdict(code())
        (folder / file).parent.mkdir(exist_ok=True)
        with (folder / file).open("ab") as opened:
            opened.write(b"\n_more = 1\n")
        after = asdict(code())
        assert {key for key in before if before[key] != after[key]} == counts

    def test_documentation_counts_nowhere(self, copied):
        folder, code = copied
        before = code()
        for file in (
            "simharness/world/scene/build.py",
            "simharness/scoring/pcp.py",
            "simharness/scoring/stage_blame.py",
            "mvpose/matching/admm.py",
        ):
            path = folder / file
            text = path.read_text()
            assert text.count('"""') >= 4
            path.write_text("# A comment.\n" + text.replace('"""', '"""Changed. ', 1))
        sections = folder / "simharness/scenario/sections/people_section.py"
        text = sections.read_text()
        assert 'key(4, "number' in text
        sections.write_text(text.replace('key(4, "number', 'key(4, "changed number', 1))
        assert code() == before

    def test_a_renamed_module_counts(self, copied):
        folder, code = copied
        before = code()
        (folder / "mvpose" / "camera.py").rename(folder / "mvpose" / "cameras.py")
        assert code().method != before.method


@pytest.mark.slow
@pytest.mark.parametrize("folders", [identity.SIMULATION, identity.SCORES, identity.FAILURES])
def test_folders_that_make_results_import_nothing_else(folders):
    """Their imports from the package are in these folders too; ``runtime`` runs work and makes no results."""
    root = Path(simharness.__file__).parent
    inside = {file for folder in folders for file in files_of(root / folder) if file.suffix == ".py"}
    inside -= {root / each for each in identity.BESIDE_THE_SIMULATION}
    assert len(inside) > 10
    outside = {}
    for file in inside:
        for module in imported(ast.parse(file.read_bytes())):
            target = root.joinpath(*module.split(".")[1:])
            target = target / "__init__.py" if target.is_dir() else target.with_suffix(".py")
            if target.exists() and target.name != "__init__.py" and target not in inside:
                outside.setdefault(target.relative_to(root).parts[0], set()).add(file.name)
    assert outside.keys() <= {"runtime"}, outside


def test_the_method_imports_nothing_that_does_not_count():
    root = Path(mvpose.__file__).parent
    beside = [root / each for each in identity.BESIDE_THE_METHOD]
    modules = [file for file in files_of(root) if file.suffix == ".py"]
    counted = [file for file in modules if not any(map(file.is_relative_to, beside))]
    names = tuple(f"mvpose.{each.removesuffix('.py').replace('/', '.')}" for each in identity.BESIDE_THE_METHOD)
    assert all(each.exists() for each in beside)
    wrong = [
        f"{file.name} imports {module}"
        for file in counted
        for module in imported(ast.parse(file.read_bytes()), "mvpose")
        if any(module == name or module.startswith(f"{name}.") for name in names)
    ]
    assert 50 < len(counted) < len(modules)
    assert not wrong


def imported(tree, package="simharness"):
    """Return the modules of a package that a syntax tree imports anywhere."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(package):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_the_lag_counts_for_presets_that_track_alone():
    def entries(lag):
        study = load_study(QUICKSTART, overrides=[f"method.lag={lag}"], variants=["full", "track", "track-fast"])
        return plan(study)[0].entries

    one, other = entries(0.2), entries(0.4)
    assert {name for name in one if one[name] != other[name]} == {"track", "track-fast"}
    assert one == entries(0.2)
