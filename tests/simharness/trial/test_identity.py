"""What a trial is known by."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import mvpose
import simharness
from simharness.scenario.load import load
from simharness.scenario.sections.section import Section
from simharness.scenario.study_definition import load_study
from simharness.study.plan import plan
from simharness.trial import identity
from simharness.trial.identity import entry_identity, estimator_code, simulation_files, trial_identity

QUICKSTART = Path(__file__).parents[3] / "scenarios" / "quickstart.toml"


@pytest.fixture(scope="module")
def quickstart():
    return load(QUICKSTART)


def changed(section, above=()):
    """Every scenario that differs in one value from this one, by the dotted key of that value."""
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
def test_every_value_counts_but_names_and_variants(quickstart):
    identities = {dotted: trial_identity(other) for dotted, other in changed(quickstart)}
    assert len(identities) > 150
    own = trial_identity(quickstart)
    assert {dotted for dotted, each in identities.items() if each == own} == {*NAMES, "method.variants"}
    others = [each for each in identities.values() if each != own]
    assert len(set(others)) == len(others)


def test_renamed_and_moved_it_is_the_same(tmp_path, quickstart):
    text = QUICKSTART.read_text().replace('name = "quickstart"', 'name = "renamed"')
    (tmp_path / "other.toml").write_text(text)
    assert trial_identity(load(tmp_path / "other.toml")) == trial_identity(quickstart)


def test_however_a_study_says_it_a_trial_is_the_same(tmp_path):
    (tmp_path / "one.toml").write_text('name = "one"\nseeds = [3, 4]\n[cameras]\ncount = 4\n[people]\ncount = 2\n')
    (tmp_path / "base.toml").write_text('name = "base"\nseed = 4\npeople.count = 2\n')
    (tmp_path / "two.toml").write_text(
        'extends = "base.toml"\nname = "two"\nvariants = ["fast"]\nsweep.cameras.count = [3, 4]\n'
    )
    one, two = load_study(tmp_path / "one.toml"), load_study(tmp_path / "two.toml")
    assert trial_identity(one.at(one.settings[0], 4)) == trial_identity(two.at(two.settings[1], 4))
    assert trial_identity(one.at(one.settings[0], 3)) != trial_identity(two.at(two.settings[1], 4))


def test_code_and_versions_count(quickstart, monkeypatch):
    own, trial = identity.code(), trial_identity(quickstart)
    entry = entry_identity(trial, "full")
    monkeypatch.setattr(identity, "code", lambda: replace(own, method="another"))
    assert trial_identity(quickstart) == trial
    assert entry_identity(trial, "full") != entry
    monkeypatch.setattr(identity, "code", lambda: replace(own, simulation="another"))
    assert trial_identity(quickstart) != trial
    monkeypatch.setattr(identity, "code", lambda: own)
    assert trial_identity(quickstart) == trial
    monkeypatch.setattr(identity, "_versions", lambda: (("numpy", "1.0"),))
    assert trial_identity(quickstart) != trial


def test_an_entry_is_of_a_trial_and_a_variant(quickstart):
    trial = trial_identity(quickstart)
    identities = {entry_identity(each, name) for each in (trial, trial[::-1]) for name in ("full", "fast")}
    assert len(identities) == 4


def test_a_method_of_ones_own_counts_by_its_content(tmp_path, monkeypatch):
    places = {}
    for folder, text in (("one", "1"), ("same", "1"), ("other", "2"), ("helped", "1")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(text)
        places[folder] = f"{tmp_path / folder / 'mine.py'}:Mine"
    (tmp_path / "helped" / "helper.py").write_text("3")
    digests = {folder: estimator_code(place) for folder, place in places.items()}
    assert digests["one"] == digests["same"]
    digests["name"] = estimator_code(places["one"] + "2")
    assert len(set(digests.values())) == 4

    def identities(folder):
        path = tmp_path / "own.toml"
        path.write_text(f'name = "own"\nvariants = ["full", "mine"]\nmethod.estimators.mine = "{folder}/mine.py:Mine"')
        (planned,) = plan(load_study(path))
        return planned.trial, planned.entries["full"], planned.entries["mine"]

    assert identities("one") == identities("same")
    assert identities("one")[:2] == identities("other")[:2]
    assert identities("one")[2] != identities("other")[2]
    own = identity.code()
    mine = identities("one")[2]
    monkeypatch.setattr(identity, "code", lambda: replace(own, method="another"))
    assert identities("one")[2] != mine  # for it may use mvpose, too


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

    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    absent = at(here)
    for file in filter(None, (name, beside)):
        (here / file).write_bytes(b"one")
    (here / "README").write_text("nobody reads it")
    shutil.copytree(here, there)
    assert at(here) == at(there)
    assert len({absent, at(here), trial_identity(quickstart)}) == 3
    (there / "README").write_text("changed")
    assert at(here) == at(there)
    for file in filter(None, (beside, name)):
        before = at(there)
        (there / file).write_bytes(b"another")
        assert at(there) != before


class TestCode:
    @pytest.fixture
    def copied(self, tmp_path, monkeypatch):
        """Copies of both packages, and a function that gives their digests as they are now."""
        for package in (simharness, mvpose):
            source = Path(package.__file__).parent
            shutil.copytree(source, tmp_path / source.name, ignore=shutil.ignore_patterns("__pycache__"))
            monkeypatch.setattr(package, "__file__", str(tmp_path / source.name / "__init__.py"))
        return tmp_path, identity.code.__wrapped__

    @pytest.mark.parametrize(
        ("file", "simulation", "method"),
        [
            ("simharness/world/scene/build.py", True, False),
            ("simharness/world/humans/data/anny.npz", True, False),
            ("simharness/scoring/pcp.py", True, False),
            ("simharness/trial/measure.py", True, False),
            ("mvpose/matching/admm.py", False, True),
            ("mvpose/networks/data/reid.onnx", False, True),
            ("simharness/cli/run.py", False, False),
            ("simharness/report/run/page.py", False, False),
            ("simharness/study/trial_store.py", False, False),
            ("simharness/statistics/comparison.py", False, False),
            ("simharness/scenario/sweep.py", False, False),
            ("simharness/world/scene/__pycache__/build.cpython-311.pyc", False, False),
        ],
    )
    def test_a_byte_counts_where_it_makes_results(self, copied, file, simulation, method):
        folder, code = copied
        before = code()
        (folder / file).parent.mkdir(exist_ok=True)
        with (folder / file).open("ab") as opened:
            opened.write(b"\n")
        after = code()
        assert (before.simulation != after.simulation) is simulation
        assert (before.method != after.method) is method

    def test_a_renamed_module_counts(self, copied):
        folder, code = copied
        before = code()
        (folder / "mvpose" / "camera.py").rename(folder / "mvpose" / "cameras.py")
        assert code().method != before.method

    @pytest.mark.slow
    def test_every_module_that_a_trial_loads_counts(self):
        run = (
            "import json, sys\n"
            "from simharness.scenario.sections.scenario import Scenario\n"
            "from simharness.trial.measure import measure\n"
            "measure(Scenario.model_validate_json(sys.argv[1]), ['full', 'no-3dps'])\n"
            "print(json.dumps([m.__file__ for n, m in sys.modules.items() if n.startswith('simharness')]))"
        )
        cheap = ("rendering.renderer=rays", "duration=0.4", "rate=5", "people.count=2", "appearance.source=drawn")
        scenario = load(QUICKSTART, overrides=cheap).model_dump_json()
        done = subprocess.run([sys.executable, "-c", run, scenario], capture_output=True, text=True, check=True)
        loaded = {Path(file) for file in json.loads(done.stdout)}
        files = set(simulation_files())
        assert len(loaded & files) > 50
        forgotten = {file for file in loaded - files if file.name != "__init__.py"}
        assert not forgotten
