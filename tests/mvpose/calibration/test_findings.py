"""Findings and diagnoses: their order, their verdict, and what they write as JSON."""

import copy
import itertools
import json
from types import SimpleNamespace

import numpy as np
import pytest

from mvpose import Camera, Rig
from mvpose.calibration.camera_findings import possible_errors
from mvpose.calibration.findings import (
    ALARM,
    EXCLUDED,
    KINDS,
    Diagnosis,
    Finding,
    camera_names,
    is_fine,
    joined_options,
    judged,
)


def diagnosis(*findings):
    return Diagnosis.of_findings(findings, evidence=["e"], cameras=["a", "b"], residuals=np.array([1.0, np.nan]))


def test_findings_are_in_the_same_order_however_they_come():
    findings = [
        Finding("moved-camera", "m", cost=0.1, camera="a", view=0),
        Finding("focal-length", "f", cost=0.3, camera="b", view=1),
        Finding("cannot-tell", "c", severity="unknown", cost=9.0),
        Finding("moved-camera", "n", severity="note", cost=5.0),
    ]
    for order in itertools.permutations(findings):
        assert [each.text for each in diagnosis(*order).findings] == ["f", "m", "c", "n"]


@pytest.mark.parametrize(
    ("severities", "verdict"),
    [
        ([], "fine"),
        (["note"], "fine"),
        (["unknown"], "cannot tell"),
        (["unknown", "alarm"], "faults"),
        (["note", "alarm"], "faults"),
    ],
)
def test_the_verdict_follows_from_the_severities(severities, verdict):
    assert diagnosis(*(Finding("cannot-tell", "x", severity=each) for each in severities)).verdict == verdict


def test_json_holds_no_number_that_json_lacks():
    finding = Finding("moved-camera", "m", size={"degrees": np.nan}, interval={"degrees": (0.0, np.inf)})
    written = json.loads(json.dumps(diagnosis(finding).to_json(), allow_nan=False))
    assert written["findings"][0]["interval"] == {"degrees": [0.0, None]}
    assert written["residuals_px"] == {"a": 1.0, "b": None}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "other"}, "kind of a finding must be one of"),
        ({"severity": "bad"}, "severity must be one of alarm"),
        ({"probability": 1.1}, "probability must lie in 0..1"),
        ({"cost": -1.0}, "cost must be 0 or more"),
        ({"interval": {"ms": (0.0, 1.0)}}, "which size does not have"),
    ],
)
def test_wrong_findings_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Finding(**{"kind": "clock-offset", "text": "t", **wrong})


def test_a_diagnosis_can_be_copied_and_every_kind_is_explained():
    again = copy.deepcopy(diagnosis(Finding("moved-camera", "m")))
    assert again.findings[0].kind == "moved-camera"
    assert all(KINDS.values())


def test_names_of_cameras_differ():
    def camera(name, x):
        return Camera(np.diag([500.0, 500.0, 1.0]), np.eye(3), np.array([x, 0.0, 0.0]), size=(640, 480), name=name)

    rig = Rig([camera("a", 0.0), camera("", 1.0), camera("a", 2.0), camera("b", 3.0)])
    names = camera_names(rig)
    assert len(set(names)) == 4
    assert names[1] == "camera 1"
    assert names[3] == "b"


@pytest.mark.parametrize("name", ALARM)
def test_no_error_as_large_as_an_alarm_is_a_note(name):
    """Size decides between note and more, evidence between unknown and alarm."""
    limit = ALARM[name]
    assert judged({name: 0.99 * limit}, {name: 0.9 * limit}) == "note"
    for sign in (1.0, -1.0):
        assert judged({name: sign * limit}, {name: 0.0}) == "alarm"
        assert judged({name: sign * limit}, {name: 0.0}, determined=False) == "unknown"
        assert judged({name: sign * 9 * limit}, {name: 1.9 * limit}, determined=False) == "unknown"
        assert judged({name: sign * 9 * limit}, {name: 3 * limit}, determined=False, probability=0.5) == "unknown"
        assert judged({name: sign * 9 * limit}, {name: 3 * limit}, determined=False) == "alarm"
    assert judged({name: 0.0, "since_s": 1e9}, {}) == "note"


def test_fine_excludes_each_size():
    size = {"degrees": 0.99 * ALARM["degrees"], "metres": 2 * ALARM["metres"]}
    assert is_fine(size, {name: 0.99 * limit for name, limit in EXCLUDED.items()})
    for name in EXCLUDED:
        assert not is_fine(size, {**{each: 0.0 for each in EXCLUDED}, name: EXCLUDED[name]})


def test_a_turn_as_large_as_an_alarm_is_not_fine():
    assert not is_fine({"degrees": ALARM["degrees"], "metres": 0.0}, dict.fromkeys(EXCLUDED, 0.0))


def test_options_of_all_alarms_make_one_command():
    found = [
        Finding("moved-camera", "m", cost=9.0, repair=("--free", "extrinsics")),
        Finding("wrong-unit", "u", repair=("--mend", "unit:0.001")),
        Finding("moved-camera", "n", severity="note", repair=("--mend", "turn:1,2,3@a")),
        Finding("clock-offset", "c", repair=("--new-times", "TIMES")),
        Finding("extrinsics-inverted", "i", repair=("--mend", "inverted@a")),
        Finding("other-people", "o"),
    ]
    wanted = ("--mend", "unit:0.001", "--mend", "inverted@a", "--free", "extrinsics", "--new-times", "TIMES")
    assert diagnosis(*found).repair == wanted  # mends in the order in which they were found
    assert joined_options([("--free", "focal"), ("--free", "extrinsics,focal")]) == ("--free", "focal,extrinsics")
    assert joined_options([]) == ()


def test_an_error_that_is_excluded_is_beyond_nineteen_twentieths_of_the_draws():
    pose, sigma = np.array([0.004, 0.0, 0.0, 0.0, 0.03, 0.0]), np.array([0.002] * 3 + [0.01] * 3)
    fit = SimpleNamespace(freed=lambda view: (pose, np.diag(sigma**2)))
    draws = pose + sigma * np.random.default_rng(0).standard_normal((20_000, 6))
    high = possible_errors(fit, 0)
    assert np.mean(np.degrees(draws[:, 0]) < high["degrees"]) == pytest.approx(0.95, abs=0.005)
    assert np.mean(draws[:, 4] < high["metres"]) == pytest.approx(0.95, abs=0.005)
