"""What the pages say about the gate: commands, the assertion for test suites, the workflow."""

from __future__ import annotations

import json
import re
from statistics import fmean

import pytest
from call_commands import done
from doc_pages import ROOT, blocks, toml_file
from easy_suite import EASY
from known_commands import CHECK_OF_REPAIR, CHECK_OF_TRACKING, CHECKS, OWN_GATE


@pytest.mark.slow
def test_the_check(easy_workplace):
    plain, full = CHECKS
    own = "--baseline easy.json --workers 1"
    done(plain, f"{own} --update-baseline")
    assert "no regression" in done(plain, own)
    assert "no regression" in done(full, own)
    assert (easy_workplace / "junit.xml").read_text().startswith("<?xml")
    assert (easy_workplace / "summary.md").read_text().startswith("## easy: no regression")


def test_the_checks_of_other_suites():
    for suite in (CHECK_OF_TRACKING, CHECK_OF_REPAIR):
        assert "Usage" in done(suite, "--help")


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
        trials = json.loads((ROOT / "scenarios" / "baselines" / "ci.json").read_text())["trials"]
        (example,) = re.findall(r'assert_robust\("ci", seeds=(\d+), (.*)\)', "".join(blocks("python")))
        first = sorted({trial["seed"] for trial in trials})[: int(example[0])]
        of_full = [trial for trial in trials if trial["variant"] == "full" and trial["seed"] in first]
        for key, limit in re.findall(r"(\w+)=([\d.]+)", example[1]):
            mean = fmean(trial[key] for trial in of_full if trial[key] is not None)
            assert mean <= float(limit) if key == "ghosts" else mean >= float(limit)


def test_the_workflow_runs_the_check():
    workflow = blocks("yaml")[0]
    folded = " ".join(re.search(r"run: >\n((?: {10}.*\n)+)", workflow)[1].split())
    assert folded in CHECKS


def test_the_workflow_is_valid():
    yaml = pytest.importorskip("yaml")
    workflow, of_action, of_gitlab = map(yaml.safe_load, blocks("yaml"))
    (given,) = (step["with"] for step in of_action["jobs"]["check"]["steps"] if "with" in step)
    assert set(given) <= set(yaml.safe_load((ROOT / "action.yml").read_text())["inputs"])
    assert of_gitlab["robustness"]["script"][1].startswith(OWN_GATE[1])
    runs = [step["run"].strip() for step in workflow["jobs"]["check"]["steps"] if "run" in step]
    assert len(runs) == 3
    assert runs[0] == "pip install -e ."
    assert runs[1] in CHECKS
    (written,) = re.findall(r"--summary (\S+)", runs[1])
    assert f"if [ -f {written} ]; then cat {written} " in runs[2]
