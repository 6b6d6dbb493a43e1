"""What counts as a find: failures with the bug that the unchanged code does not have, in two scenes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.planted_bugs import hunting
from benchmarks.planted_bugs.checkout import ROOT, Finished
from mvpose import Matching, preset
from simharness.hunt.kept_failure import read_failure


@pytest.fixture
def answered(monkeypatch):
    """A frame of two people without errors, and its answer; the unchanged code is the code of this checkout."""
    monkeypatch.setenv("PLANTED_BUGS_UNCHANGED", str(ROOT))
    frame = read_failure(ROOT / "scenarios" / "failures" / "crowd-merged-488c19.toml").with_errors(())
    rig, detections, truth = frame.detected()
    estimate = preset("full").estimate(rig, detections)
    assert len(estimate) == 2
    return rig, detections, truth, estimate


@pytest.mark.slow
def test_only_failures_that_the_unchanged_code_does_not_have_count(answered):
    *frame, estimate = answered
    assert hunting.worse(*frame, estimate) == ""
    lost = replace(
        estimate,
        joints=estimate.joints[:1],
        scores=estimate.scores[:1],
        covariance=estimate.covariance[:1],
        freedom=estimate.freedom[:1],
        matching=Matching(np.where(estimate.matching.labels == 0, 0, -1)),
    )
    assert hunting.worse(*frame, lost).startswith("missed")
    np.testing.assert_array_equal(hunting.unchanged(*frame[:2]).joints, estimate.joints)


@pytest.mark.parametrize(("scenes", "found"), [((3, 4), True), ((3, 3), False), ((3,), False), ((), False)])
def test_a_find_takes_two_scenes(tmp_path, scenes, found):
    path, rows = tmp_path / "trials.jsonl", [{"seed": 1, "findings": []}]
    rows += [{"seed": scene, "findings": [{"violated": "worse"}]} for scene in scenes]
    path.write_text("".join(json.dumps(row) + "\n" for row in ({"scenario": "first line"}, *rows)))
    assert hunting.summary(path) == ("failures that are none without the bug, in 2 scenes" if found else "")


def test_a_bug_is_hunted_in_both_copies_until_it_is_found(tmp_path):
    """The copies are programs that note how they are called; the second batch finds the bug."""

    class Copy:
        root = ROOT

        def planted(self, bug):
            return self

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def run(self, arguments, *, limit, environment):
            options = dict(zip(arguments[4::2], arguments[5::2], strict=True))
            calls.append((int(options["--trials"]), limit))
            assert environment == {"PLANTED_BUGS_UNCHANGED": str(ROOT)}
            assert options["--property"] == "benchmarks.planted_bugs.hunting:worse"
            path = tmp_path / "hunted" / "trials.jsonl"
            path.parent.mkdir(parents=True, exist_ok=True)
            rows = [{"seed": k, "findings": [{}]} for k in range(len(calls))]
            path.write_text("".join(json.dumps(row) + "\n" for row in ({}, *rows)))
            return Finished(0, "", 30.0)

    calls = []
    outcome = hunting.hunt_bug(Copy(), None, folder=tmp_path, limit=100.0)
    assert (outcome.caught, outcome.seconds) == (True, 60.0)
    assert outcome.what == "failures that are none without the bug, in 2 scenes, within 32 trials"
    assert calls == [(16, 100.0), (32, 70.0)]
