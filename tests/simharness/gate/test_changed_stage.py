"""Stage and joints that a changed score names."""

import pytest

from simharness.gate.baseline import DETECTED, FRAMES, KEPT, TIME, Measurement
from simharness.gate.compare import compare
from simharness.gate.gate_reports import sentence
from simharness.gate.trial_command import TrialKey
from simharness.scenario.sections.gate_section import GateSection


def measured(**changed):
    """Return a suite of two cases at eight seeds; scores change in the case "b"."""
    scores = {}
    for case in ("a", "b"):
        for seed in range(8):
            usual = dict.fromkeys(KEPT, 50.0) | {FRAMES: 100.0, DETECTED: 300.0 + seed}
            added = changed if case == "b" else {}
            row = {key: None if key in added and added[key] is None else usual[key] + added.get(key, 0) for key in KEPT}
            scores[TrialKey(case, seed, "full")] = row
    return Measurement("suite", "0123456789", "1", "zen", scores)


def where(before=None, **changed):
    changes = compare(measured(**(before or {})), measured(**changed), GateSection()).with_verdict("worse")
    (found,) = [change for change in changes if (change.score, change.case) == ("pcp", "b")]
    assert found.where == "" or found.where in sentence(found)
    return found.where


@pytest.mark.parametrize(
    ("moved", "stage"),
    [
        ({DETECTED: 0.2, "match_f1": -4.0}, "from detection on"),
        ({DETECTED: 0.2}, "from detection on"),
        ({"match_f1": -4.0}, "from matching on"),
        ({"match_f1": 0.03}, "from matching on"),  # matched otherwise, although not worse
        ({"recall": -9.0}, "in reconstruction"),
        ({DETECTED: 1e-4}, "in reconstruction"),  # another processor
    ],
)
def test_the_first_stage_whose_result_changed_is_named(moved, stage):
    assert where(pcp=-5.0, **moved) == stage


def test_a_baseline_of_an_earlier_version_does_not_tell_detection_from_matching():
    old = {DETECTED: None}
    assert where(old, pcp=-5.0, match_f1=-3.0) == "from detection or matching on"
    assert where(old, pcp=-5.0) == "in reconstruction"
    assert where({"match_f1": None}, pcp=-5.0) == ""  # a method that returns no labels


def test_the_joints_that_changed_most_are_named():
    named = where(pcp=-5.0, pcp_lower_arms=-12.0, pcp_head=3.0, pcp_torso=-1.0)
    assert named == "in reconstruction, most in PCP lower arms (-12.0)"


def test_time_and_unchanged_scores_name_nothing():
    changes = compare(measured(), measured(**{TIME: 50.0}, pcp_head=-30.0), GateSection()).changes
    assert any(change.verdict == "worse" for change in changes)
    assert {change.where for change in changes} == {""}
