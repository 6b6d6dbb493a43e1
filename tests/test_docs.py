"""README, CONTRIBUTING and guide: every command in them works, and every code block runs."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from statistics import fmean

import numpy as np
import pytest
from typer.testing import CliRunner

import simharness
from mvpose.formats.calibration.voxelpose import write_calibration
from mvpose.wholebody import read_skeleton
from simharness.cli import app
from simharness.scenario.sections.detector import Detector
from simharness.scenario.study_definition import load_study

ROOT = Path(__file__).parents[1]
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs" / "guide").glob("*.md")))
}

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_INDENTED = re.compile(r"(?<=\n\n)(?: {4}.*\n)+")  # after an empty line; otherwise it continues a list item
_PROGRAM = re.compile(r"(simharness|make|(\S*/)?python3? -m) \S")
_COMMENT = re.compile(r"\s+# .*")

# What each simharness command gets in addition, to be cheap; the last of an option given twice counts.
SMALL_SCENE = "--set people.count=2 --set duration=0.4 --set rate=5"
RAYS = f"{SMALL_SCENE} --set cameras.count=3 --set cameras.size=[160,120] --set rendering.renderer=rays"
PICTURES = f"{SMALL_SCENE} --set cameras.count=2 --set cameras.size=[160,120] --set clutter.shelves=0"
LAB = f"{RAYS} --set sweep.cameras.height=[1.7] --set sweep.people.count=[2] --variant fast --workers 1"
ALONE = {
    "simharness run quickstart": RAYS,
    "simharness run quickstart --set people.count=6 --set cameras.count=3 --seed 1 --workers 2": f"{RAYS} --workers 1",
    "simharness export gathering benchmark": f"{PICTURES} --every 2",
    "simharness render gathering --video --overlay truth,detections,estimates": PICTURES,
    "simharness run passage": RAYS,
    "simharness scenarios": "",
    "simharness schema": "",
    "simharness show FILE": "",
    "simharness show passage": "",
    "simharness show quickstart": "",
}
# Commands that read a file of the user, which the test makes.
USER_FILES = {
    "clip.bvh": ("simharness run quickstart --set 'people.activities=[\"mocap\"]' --set people.motion.file=clip.bvh"),
    "calibration.json": (
        "simharness run quickstart --set cameras.layout=file --set cameras.file=calibration.json "
        "--set 'cameras.size=[1032,776]'"
    ),
    "night.toml": "simharness run quickstart --set detector.profile=night.toml",
}
NAMES = ("simharness check", "simharness export", "simharness fit-detector", "simharness evaluate seeds")  # mentioned
CHECKS = (
    "simharness check ci --baseline results/baselines/ci.json --workers 2",
    "simharness check ci --baseline results/baselines/ci.json --workers 2 --junit junit.xml --summary summary.md",
)
CHECK_OF_TRACKING = "simharness check ci_tracking --baseline results/baselines/ci_tracking.json --workers 2"
SHELF = (
    "simharness evaluate shelf FOLDER",
    "simharness evaluate twin shelf FOLDER",
    "simharness fit-detector shelf FOLDER --out fitted.toml",
    "simharness validate shelf FOLDER",
)
OWN_RECORDING = "simharness evaluate hall.toml"
OWN_STUDY = {
    "simharness study my-lab.toml --workers 2": f"{LAB} --seeds 1",
    "simharness study my-lab.toml --seeds 40": f"{LAB} --seeds 2",
    "simharness report results/studies/my-lab --rerun my-lab.rrd": "",
    "simharness report STUDY --digest FOLDER": "",
}
OWN_GATE = (
    "simharness check my-ci.toml --baseline my-ci.json --update-baseline",
    "simharness check my-ci.toml --baseline my-ci.json",
)
IN_PARTS = {
    "simharness study my-lab.toml --shard 1/3 --store part1": f"{LAB} --seeds 2",
    "simharness merge part1 part2 part3 --into results/studies/store": "",
    "simharness study my-lab.toml": f"{LAB} --seeds 2",
}
MAKE = ("make demo", "make test", "make docs", "make lint", "make lint docs", "make results")
CI = ".ci/run"
PYTEST = ('pytest -m "not slow"', "pytest tests/simharness/detector")
MVPOSE = (  # run by tests/mvpose/cli
    "mvpose estimate CALIBRATION DETECTIONS --out results",
    "mvpose doctor CALIBRATION DETECTIONS",
    "mvpose repair CALIBRATION DETECTIONS --out NEW",
    "mvpose detect VIDEO... --detector det.onnx --pose pose.onnx --out FOLDER",
    "mvpose run CALIBRATION VIDEO... --detector det.onnx --pose pose.onnx --out results",
)
SHELL = (". .venv/bin/activate",)
MODULES = tuple(
    f"python -m {name}"
    for name in (
        "benchmarks.doctor",
        "benchmarks.expected_error",
        "benchmarks.method",
        "benchmarks.simulator",
        "benchmarks.tracking",
        "benchmarks.planted_bugs",
        "tools.page_pictures",
        "tools.reid",
    )
)
ON_SHELF = "python -m benchmarks.tracking --shelf FOLDER"  # tests/benchmarks/tracking/test_shelf_losses.py
BAKE = "python -m tools.body.bake"  # takes no arguments: it would go and bake
KNOWN = {
    *ALONE,
    *USER_FILES.values(),
    *NAMES,
    *CHECKS,
    CHECK_OF_TRACKING,
    *SHELF,
    OWN_RECORDING,
    *OWN_STUDY,
    *OWN_GATE,
    *IN_PARTS,
    *MAKE,
    *MODULES,
    ON_SHELF,
    BAKE,
    CI,
    *PYTEST,
    *SHELL,
    *MVPOSE,
}

# Replaces the shipped suite ci, which takes minutes: nothing here is hard for the method.
EASY = f"""
extends = {json.dumps(str(ROOT / "scenarios" / "quickstart.toml"))}
name = "easy"
seeds = 6          # the fewest that the gate accepts
variants = ["fast"]
duration = 0.4
rate = 5.0
rendering.renderer = "rays"
people.count = 2
detector.profile = "perfect"

[clutter]
boxes = 0
shelves = 0
"""


def commands(text: str) -> Iterator[str]:
    """Yield the shell commands of a Markdown text: indented lines, lines of shell blocks, and inline code."""
    for language, block in _FENCE.findall(text):
        if language in ("", "sh", "bash", "shell", "console"):
            yield from (_COMMENT.sub("", line).strip() for line in block.splitlines() if line.strip())
    prose = _FENCE.sub("", text)
    for block in _INDENTED.findall(prose):
        yield from (_COMMENT.sub("", line).strip() for line in block.splitlines())
    for span in re.findall(r"`([^`]+)`", _INDENTED.sub("", prose)):
        if _PROGRAM.match(one_line := " ".join(span.split())):
            yield one_line


def blocks(language: str) -> list[str]:
    """Return the code blocks of a language in all pages."""
    return [block for page in PAGES.values() for name, block in _FENCE.findall(page) if name == language]


def toml_file(name: str) -> str:
    """Return the TOML block whose first line is its file name; all pages with that file have the same."""
    (block,) = {block for block in blocks("toml") if block.startswith(f"# {name}\n")}
    return block


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Return a folder like that of a checkout, with the files that the pages write."""
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    for name in ("my-lab.toml", "night.toml"):
        (tmp_path / name).write_text(toml_file(name), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def easy_workplace(tmp_path, monkeypatch):
    """Return a folder like that of a checkout, with an easy suite."""
    (tmp_path / "ci.toml").write_text(EASY)  # a file in the working directory goes before a shipped scenario
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(command: str, more: str = ""):
    """Return the result of a command of simharness with more options."""
    program, *words = shlex.split(command)
    assert program == "simharness"
    return CliRunner().invoke(app, [*words, *shlex.split(more)], catch_exceptions=False)


def done(command: str, more: str = "") -> str:
    """Run a command of simharness, which has to succeed, and return what it prints."""
    result = call(command, more)
    assert result.exit_code == 0, f"{command} {more}\n{result.stderr}"
    return result.stdout


def test_commands_are_found_in_blocks_and_in_prose():
    text = """`simharness` and `make` are names, `simharness/gate` is a folder; `simharness show
FILE` and `python -m json.tool` stand in prose.
10. An item
    that goes on

    make demo   # says what
    pip install .

```sh
simharness run a#b.toml
```

```toml
    a = 1
```
"""
    found = ["simharness run a#b.toml", "make demo", "pip install .", "simharness show FILE", "python -m json.tool"]
    assert list(commands(text)) == found


def test_every_command_is_run_here():
    present = {command: name for name, page in PAGES.items() for command in commands(page)}
    new = {command: name for command, name in present.items() if command not in KNOWN}
    assert not new, f"commands in the pages that no test here runs: {new}"
    gone = sorted(KNOWN - set(present))
    assert not gone, f"commands that are no longer in any page: {gone}"


def test_every_block_is_tested_here():
    languages = Counter(language for page in PAGES.values() for language, _ in _FENCE.findall(page))
    assert languages == {"python": 13, "toml": 8, "yaml": 1}


def test_the_shares_of_the_face_are_valid():
    (block,) = {block for block in blocks("toml") if block.startswith("[keypoints.face]\n")}
    assert Detector.model_validate(tomllib.loads(block)).keypoints.face.ears[9] == 0.99  # 270 degrees: the far side


@pytest.mark.parametrize("name", PAGES)
def test_links_to_files_resolve(name):
    targets = re.findall(r"\]\((?!https?:)([^)#\s]+)", _FENCE.sub("", PAGES[name]))
    assert not [target for target in targets if not ((ROOT / name).parent / target).exists()]


OUTPUT = {
    "run": "results/runs/*/report.html",
    "export": "benchmark/gathering/manifest.json",
    "render": "results/renders/gathering/mosaic*",
    "study": "results/*/*/report.html",
}


@pytest.mark.slow
@pytest.mark.parametrize("command", ALONE)
def test_commands_that_stand_alone(workplace, command):
    assert done(command.replace("FILE", "my-lab.toml"), ALONE[command])
    if output := OUTPUT.get(command.split()[1]):
        assert list(workplace.glob(output))


@pytest.mark.slow
@pytest.mark.parametrize("file", USER_FILES)
def test_commands_with_a_file_of_the_user(workplace, file):
    small = RAYS.replace("--set cameras.count=3 ", "").replace("--set cameras.size=[160,120] ", "")
    if file == "calibration.json":
        ring = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))["ring"](3, radius=3.2, size=(1032, 776))
        write_calibration(workplace / file, ring)
        small += " --set people.area=1.0"
    elif file == "clip.bvh":
        made = runpy.run_path(str(ROOT / "tests" / "simharness" / "world" / "motion" / "test_mocap_retarget.py"))
        (workplace / file).write_text(made["bvh"](**made["HANG"]), encoding="utf-8")
    assert "full" in done(USER_FILES[file], f"{small} --set clutter.boxes=0 --set clutter.shelves=0")


@pytest.mark.parametrize("command", NAMES)
def test_commands_that_are_only_mentioned(command):
    assert "Usage" in done(command, "--help")


def test_the_check(easy_workplace):
    plain, full = CHECKS
    done(plain, "--update-baseline --workers 1")
    assert "no regression" in done(plain, "--workers 1")
    assert "no regression" in done(full, "--workers 1")
    assert (easy_workplace / "junit.xml").read_text().startswith("<?xml")
    assert (easy_workplace / "summary.md").read_text().startswith("## easy: no regression")


def test_the_check_of_tracking():
    assert "Usage" in done(CHECK_OF_TRACKING, "--help")


@pytest.mark.slow
def test_the_custom_suite(easy_workplace):
    for name in ("wrapped.py", "program.py"):
        (easy_workplace / name).symlink_to(ROOT / "tests" / "simharness" / "trial" / "foreign" / name)
    (easy_workplace / "my-ci.toml").write_text(toml_file("my-ci.toml"), encoding="utf-8")
    one_frame = EASY.replace("duration = 0.4", "duration = 0.2")  # a program is started for each
    (easy_workplace / "ci.toml").write_text(one_frame)
    first, again = OWN_GATE
    done(first)
    trials = json.loads((easy_workplace / "my-ci.json").read_text())["trials"]
    assert {trial["variant"] for trial in trials} == {"foreign"}
    assert "no regression" in done(again)


@pytest.mark.parametrize("command", SHELF)
def test_commands_on_shelf_without_data(workplace, command):
    result = call(command)
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")  # and no usage: the options are right
    assert "no such folder" in result.stderr


def test_the_described_recording_has_valid_keys(workplace):
    (workplace / "hall.toml").write_text(toml_file("hall.toml"), encoding="utf-8")
    result = call(OWN_RECORDING)
    assert result.exit_code == 2
    assert "hall.toml: calibration.file: calibration.json: no such file" in result.stderr


@pytest.mark.slow
def test_shelf_is_evaluated(workplace, shared_data):
    (workplace / "FOLDER").symlink_to(shared_data / "shelf")
    assert "PCP" in done(SHELF[0], "--method fast")


def test_the_custom_study_has_the_described_settings(workplace):
    study = load_study("my-lab.toml")
    file = tomllib.loads(toml_file("my-lab.toml"))
    heights, people = file["sweep"]["cameras"]["height"], file["sweep"]["people"]["count"]
    assert (people["from"], people["to"], people["steps"]) == (2, 8, 4)
    assert len(study.seeds) == file["seeds"]
    assert list(study.variants) == file["variants"]
    settings = {(each.case, *map(each.factors.get, ("cameras.height", "people.count"))) for each in study.settings}
    assert settings == set(product(file["cases"], heights, (2, 4, 6, 8)))


@pytest.mark.slow
def test_the_custom_study(workplace):
    first, more, recording, digest = OWN_STUDY
    assert "2 trials: 0 kept from before, 2 run, 0 failed" in done(first, OWN_STUDY[first])
    assert "4 trials: 2 kept from before, 2 run, 0 failed" in done(more, OWN_STUDY[more])
    assert (workplace / "results/studies/my-lab/report.html").is_file()
    done(digest.replace("STUDY", "results/studies/my-lab").replace("FOLDER", "kept"))
    assert {"digest.json", "table.md"} <= {path.name for path in (workplace / "kept").iterdir()}
    if importlib.util.find_spec("rerun"):
        done(recording)
        assert (workplace / "my-lab.rrd").stat().st_size
    else:
        result = call(recording)
        assert (result.exit_code, "needs the rerun SDK" in result.stderr) == (2, True)


@pytest.mark.slow
def test_the_study_in_parts(workplace):
    first, merge, whole = IN_PARTS
    for k in (1, 2, 3):
        done(first.replace("1/3", f"{k}/3").replace("part1", f"part{k}"), IN_PARTS[first])
    assert "4 entries copied" in done(merge)
    assert "4 trials: 4 kept from before, 0 run, 0 failed" in done(whole, IN_PARTS[whole])


@pytest.mark.parametrize("command", MAKE)
def test_make_knows_its_targets(command):
    program, *targets = command.split()
    dry = subprocess.run([program, "-n", *targets], cwd=ROOT, capture_output=True, text=True, check=False)
    assert dry.returncode == 0, dry.stderr
    assert dry.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("command", MODULES)
def test_modules_have_a_command_line(command):
    _, *words = command.split()
    process = subprocess.run([sys.executable, *words, "--help"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    assert process.stdout.startswith(f"usage: {command} ")


def test_the_command_that_bakes_the_body_is_a_program():
    spec = importlib.util.find_spec(BAKE.rsplit(maxsplit=1)[-1])
    assert '\nif __name__ == "__main__":\n' in Path(spec.origin).read_text(encoding="utf-8")


def test_ci_is_a_program():
    assert os.access(ROOT / CI, os.X_OK)


def test_pytest_deselects_slow_tests():
    _, *words = shlex.split(PYTEST[0])
    file = ROOT / "tests" / "simharness" / "test_cli.py"
    process = subprocess.run(
        [sys.executable, "-m", "pytest", *words, str(file), "--collect-only"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stdout
    assert "test_unknown_key" in process.stdout
    assert "deselected" in process.stdout


def test_the_area_of_tests_exists():
    assert list((ROOT / PYTEST[1].split()[1]).glob("test_*.py"))


@pytest.fixture
def shorter(monkeypatch):
    """Load scenarios at a tenth of their duration, without changing the code of an example."""
    load = simharness.load_scenario

    def load_short(name, *, overrides=(), **options):
        return load(name, overrides=[*overrides, "duration=0.4"], **options)

    monkeypatch.setattr(simharness, "load_scenario", load_short)


def run_block(*words: str) -> dict:
    """Run the Python block that holds all of some words; return its names."""
    (block,) = (block for block in blocks("python") if all(word in block for word in words))
    names: dict = {}
    exec(block, names)
    return names


@pytest.mark.slow
def test_the_example_of_the_readme(shorter):
    names = run_block("simharness.score")
    assert 50 < names["scores"]["pcp"] <= 100
    assert names["result"].results.keys() == {"full", "fast"}
    assert names["result"].results["full"].scores["pcp"] == names["scores"]["pcp"]
    assert {"kind", "stage"} <= set(names["result"].results["fast"].failures.columns)


@pytest.mark.slow
def test_the_example_of_getting_started(shorter):
    trial = run_block("trial = simharness.run_trial")["trial"]
    assert trial.results.keys() == {"full", "fast"}
    assert 50 < trial.results["full"].scores["pcp"] <= 100
    assert {"kind", "stage"} <= set(trial.results["full"].failures.columns)


def test_the_foreign_program_is_the_one_that_is_tested():
    wrapped = (ROOT / "tests/simharness/trial/foreign/wrapped.py").read_text(encoding="utf-8")
    (shown,) = (block for block in blocks("python") if "subprocess" in block)
    assert wrapped.endswith(shown)


def test_the_example_of_mvpose():
    example = next(block for block in blocks("python") if "Rig(cameras)" in block)
    made = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))  # rigs and people, without the simulator
    rig, true = made["ring"](4), made["crowd"](2)
    seen, person = made["detect"](rig, true)
    names = {"cameras": rig.cameras, "view": seen.view, "keypoints": seen.keypoints, "scores": seen.scores}
    exec(example, names)
    people = names["people"]
    assert people.joints.shape == (2, 17, 3)
    assert people.covariance.shape == (2, 17, 3, 3)
    labels = people.matching.labels
    assert labels.shape == person.shape == (8,)
    for k in range(2):
        (label,) = set(labels[person == k])
        np.testing.assert_allclose(people.joints[label], true[k], atol=0.05)


class TestAssertRobust:
    """The assertion for test suites, as the page on the gate shows it."""

    @staticmethod
    def example():
        names: dict = {}
        exec(next(block for block in blocks("python") if "assert_robust" in block), names)
        (test,) = (each for name, each in names.items() if name.startswith("test_"))
        return test

    def test_it_passes_on_an_easy_suite(self, easy_workplace):
        self.example()()

    def test_it_fails_where_cameras_see_nobody(self, easy_workplace):
        (easy_workplace / "ci.toml").write_text(EASY + "[cameras]\ncount = 2\nfov = 25.0\n")
        with pytest.raises(AssertionError, match="expected at least 90"):
            self.example()()

    def test_its_numbers_are_right_for_the_suite_that_ships(self):
        trials = json.loads((ROOT / "results" / "baselines" / "ci.json").read_text())["trials"]
        (example,) = re.findall(r'assert_robust\("ci", seeds=(\d+), (.*)\)', "".join(blocks("python")))
        first = sorted({trial["seed"] for trial in trials})[: int(example[0])]
        of_full = [trial for trial in trials if trial["variant"] == "full" and trial["seed"] in first]
        for key, limit in re.findall(r"(\w+)=([\d.]+)", example[1]):
            mean = fmean(trial[key] for trial in of_full if trial[key] is not None)
            assert mean <= float(limit) if key == "ghosts" else mean >= float(limit)


def test_the_workflow_runs_the_check():
    (workflow,) = blocks("yaml")
    folded = " ".join(re.search(r"run: >\n((?: {10}.*\n)+)", workflow)[1].split())
    assert folded in CHECKS


def test_the_workflow_is_valid():
    yaml = pytest.importorskip("yaml")
    (workflow,) = map(yaml.safe_load, blocks("yaml"))
    runs = [step["run"].strip() for step in workflow["jobs"]["check"]["steps"] if "run" in step]
    assert len(runs) == 3
    assert runs[0] == "pip install -e ."
    assert runs[1] in CHECKS
    (written,) = re.findall(r"--summary (\S+)", runs[1])
    assert f"cat {written} " in runs[2]


def test_the_block_of_the_repair_runs(capsys):
    made = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))
    rig = made["ring"](4)
    (block,) = [block for block in blocks("python") if "found = repair(" in block]
    exec(block, {"rig": rig, "frames": [made["detect"](rig, made["crowd"](1))[0]] * 20})
    assert capsys.readouterr().out.startswith("cannot tell: people were in too few places")


def test_the_block_of_the_tracker_runs():
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.4", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    (block,) = [block for block in blocks("python") if "Tracker(" in block]
    names = {"rig": recording.rig, "frames": recording.detections}
    exec(block, names)
    assert len(names["smooth"]) == len(recording.detections)
    assert names["estimate"].ids.tolist() == names["smooth"][-1].ids.tolist()
    assert len(names["estimate"]) == 4


def test_the_block_of_people_files_runs(tmp_path):
    scenario = simharness.load_scenario("quickstart", overrides=["duration=0.4", 'rendering.renderer="rays"'])
    recording = simharness.simulate(scenario)
    (block,) = [block for block in blocks("python") if "write_people(" in block]
    exec(block, {"rig": recording.rig, "frames": recording.detections, "folder": tmp_path})
    names = {path.name for path in tmp_path.iterdir()}
    assert {"poses.parquet", "person_0.trc", "person_0.c3d"} <= names


def test_the_blocks_of_the_whole_body_run(tmp_path):
    rig = simharness.simulate(simharness.load_scenario("quickstart", overrides=["duration=0.1"])).rig
    points = np.array([0.0, 0.0, 1.2]) + np.random.default_rng(0).uniform(-0.3, 0.3, (133, 3))
    (block,) = [block for block in blocks("python") if "whole_body(" in block]
    views = len(rig)
    names = {"rig": rig, "view": np.arange(views), "keypoints": rig.project(points), "scores": np.ones((views, 133))}
    exec(block, names)
    np.testing.assert_allclose(names["people"].joints[0, 17:], points[17:], atol=0.02)
    (file,) = [block for block in blocks("toml") if "[joints]" in block]
    (tmp_path / "feet.toml").write_text(file)
    assert len(read_skeleton(tmp_path / "feet.toml")) == 4


@pytest.mark.parametrize(("words", "page"), [("write_page(", "recording.html"), ("write_doctor_page(", "doctor.html")])
def test_the_blocks_of_the_pages_run(tmp_path, words, page):
    made = runpy.run_path(str(ROOT / "tests" / "mvpose" / "people.py"))
    rig, step = made["ring"](4), np.array([0.05, 0.02, 0.0])
    frames = [made["detect"](rig, made["crowd"](2) + k * step, noise=1.0, seed=k)[0] for k in range(30)]
    (block,) = [block for block in blocks("python") if words in block]
    exec(block, {"rig": rig, "frames": frames, "folder": tmp_path})
    assert (tmp_path / page).read_text(encoding="utf-8").startswith("<!doctype html>")
