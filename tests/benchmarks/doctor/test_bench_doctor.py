"""Benchmark of the doctor: recordings on disk, faults that are what they say, and a run that goes on."""

import json

import numpy as np
import pytest

from benchmarks.doctor import faults, runner
from benchmarks.doctor.confusion_page import write_page
from benchmarks.doctor.experiments import TrialKey, trials, true_corrections
from benchmarks.doctor.measures import aligned, camera_errors
from benchmarks.doctor.recordings import BenchRecording, Recordings, write
from benchmarks.doctor.report import confusion_of, misses_of, rows_of, write_report
from benchmarks.method.scenes import ring, stick_people
from mvpose import Detections, Rig
from mvpose.calibration.findings import KINDS
from mvpose.calibration.tracklet_matching import corrected


@pytest.fixture(scope="module")
def recording():
    rng, rig = np.random.default_rng(0), ring(4, 2)
    people = stick_people(np.array([[0.0, 0.0], [0.8, 0.3]]), rng)
    frames = []
    for k in range(12):
        pixels = rig.project(people + [0.02 * k, 0.0, 0.0])
        view = np.repeat(np.arange(len(rig)), 2)
        frames.append(Detections.from_keypoints(view, pixels.reshape(-1, 17, 2), np.full((len(view), 17), 0.5)))
    return BenchRecording("rig00", rig, tuple(frames), np.zeros((12, 2, 14, 3)), np.zeros(4), 0.04)


def test_recordings_come_back_from_disk(recording, tmp_path):
    write(tmp_path / "r.npz", [recording])
    back = Recordings(tmp_path / "r.npz")["rig00"]
    for a, b in zip(back.rig, recording.rig, strict=True):
        np.testing.assert_array_equal(a.P, b.P)
        assert a.size == b.size
    for a, b in zip(back.frames, recording.frames, strict=True):
        np.testing.assert_array_equal(a.view, b.view)
        np.testing.assert_allclose(a.keypoints, b.keypoints, atol=1 / 64)
        np.testing.assert_array_equal(a.scores, b.scores)


def test_errors_of_a_moved_camera_are_those_it_was_moved_by(recording):
    case = faults.move_one(recording, 2, 2.0, 0.2, np.random.default_rng(1))
    degrees, metres = camera_errors(case.rig, recording.rig)
    np.testing.assert_allclose(degrees, [0, 0, 2, 0], atol=1e-5)
    np.testing.assert_allclose(metres, [0, 0, 0.2, 0], atol=1e-9)


def test_a_rig_that_is_moved_as_a_whole_has_no_error_when_aligned(recording):
    turn, shift = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([1.0, 2, 3])
    whole = Rig([type(c)(c.K, c.R @ turn.T, c.t - c.R @ turn.T @ shift, c.distortion, c.size) for c in recording.rig])
    degrees, metres = camera_errors(aligned(whole, recording.rig), recording.rig)
    np.testing.assert_allclose(degrees, 0.0, atol=1e-5)
    np.testing.assert_allclose(metres, 0.0, atol=1e-9)


@pytest.mark.parametrize("name", [*faults.CONVENTIONS, *faults.OTHERS])
def test_every_fault_changes_what_the_doctor_is_given(recording, name):
    fault, kinds = {**faults.CONVENTIONS, **faults.OTHERS}[name]
    assert kinds <= set(KINDS)
    case = fault(recording, np.random.default_rng(0))
    rigs_differ = any(not np.array_equal(a.P, b.P) for a, b in zip(case.rig, recording.rig, strict=True))
    frames_differ = len(case.frames) != len(recording.frames) or any(
        len(a) != len(b) or not np.array_equal(a.keypoints, b.keypoints, equal_nan=True)
        for a, b in zip(case.frames, recording.frames, strict=True)
    )
    assert rigs_differ or frames_differ
    changed = {int(v) for a, b in zip(case.frames, recording.frames, strict=False) for v in changed_views(a, b)}
    if case.view is not None and frames_differ:
        assert changed == {case.view}


def changed_views(a, b):
    for view in range(4):
        one, other = a.select(a.view == view), b.select(b.view == view)
        if not np.array_equal(one.keypoints, other.keypoints, equal_nan=True):
            yield view


def test_a_run_goes_on_where_it_stopped(recording, tmp_path, monkeypatch):
    write(tmp_path / "r.npz", [recording])
    results = tmp_path / "t.jsonl"
    key = TrialKey("clean", "rig00")
    results.write_text(json.dumps({"trial": str(key), "verdict": "fine", "findings": []}) + '\n{"trial": "half')
    monkeypatch.setattr(runner, "measure", None)  # it would fail if the trial were run again
    assert runner.run(tmp_path / "r.npz", [key], results, workers=1) == 0
    assert list(runner.read_results(results)) == [str(key)]


def test_trials_cover_every_fault_and_differ(recording):
    keys = list(trials({"rig00": recording}))
    assert len({str(key) for key in keys}) == len(keys)
    assert {key.case for key in keys if key.experiment in ("conventions", "faults")} == {
        *faults.CONVENTIONS,
        *faults.OTHERS,
    }


def test_tables_count_alarms_by_fault_and_list_what_was_missed(tmp_path):
    alarm = {"kind": "moved-camera", "view": 1, "severity": "alarm"}
    note = {"kind": "clock-offset", "view": 1, "severity": "note"}
    base = {"view": None, "verdict": "fine"}
    unsure = {**base, "verdict": "cannot tell", "unchanged": True, "refused": "two cameras"}
    results = {
        "clean/rig00//0": {**base, "findings": [note], "false_alarm": False},
        "clean/rig01//0": {**base, "findings": [alarm], "false_alarm": True},
        "faults/rig00/x/0": {**base, "findings": [alarm, note], "named": True, "camera": True},
        "faults/rig01/x/0": {**base, "findings": [alarm], "named": True, "camera": False, "view": 2},
        "refusals/rig00/two cameras/0": {**unsure, "findings": [note]},
        "refusals/rig01/two cameras/0": {**unsure, "findings": [alarm], "verdict": "faults"},
    }
    assert confusion_of(results) == {
        "no fault": {"nothing": 1, "moved-camera": 1, "recordings": 2},
        "x": {"moved-camera": 2, "recordings": 2},
        "two cameras": {"cannot tell": 1, "moved-camera": 1, "recordings": 2},
    }
    (row,) = (row for row in rows_of(results) if "false alarms" in row.what)
    assert (row.measured, row.met) == ("50.0 %", False)
    missed = [line.split(":")[0] for line in misses_of(results)]
    assert missed == ["clean/rig01//0", "faults/rig01/x/0, camera 2", "refusals/rig01/two cameras/0"]
    write_report(results, tmp_path)
    write_page(tmp_path)
    assert all(fault in (tmp_path / "confusion.html").read_text() for fault in confusion_of(results))
    assert all(line in (tmp_path / "doctor.md").read_text() for line in misses_of(results))
    assert json.loads((tmp_path / "doctor.json").read_text())["misses"] == misses_of(results)


def test_a_turned_camera_may_be_unsure_but_not_fine():
    verdicts = ("faults", "cannot tell", "fine", "faults")  # the last of another camera
    results = {
        f"turned/rig00/1/{draw}": {"view": 1, "verdict": verdict, "findings": [], "named": draw == 0}
        for draw, verdict in enumerate(verdicts)
    }
    assert [line.split(",")[0] for line in misses_of(results)] == ["turned/rig00/1/2", "turned/rig00/1/3"]
    named, fine = rows_of(results)
    assert named.what == "one camera turned by 1 degree: named"
    assert (named.measured, named.met) == ("25.0 %", None)
    assert (fine.measured, fine.met) == ("25.0 %", False)
    smaller = {key.replace("/1/", "/0.5/"): result for key, result in results.items()}
    assert [row.met for row in rows_of(smaller)] == [None, None]
    assert list(confusion_of(smaller)) == ["one camera turned by 0.5 degrees"]


def test_true_corrections_turn_the_believed_rig_into_the_true_one(recording):
    believed = faults.move_all(recording, 1.0, 0.05, np.random.default_rng(2)).rig
    turns, shifts = true_corrections(believed, recording.rig)
    for camera, turn, shift, true in zip(believed, turns, shifts, recording.rig, strict=True):
        mended = corrected(camera, turn, shift)
        np.testing.assert_allclose(mended.R, true.R, atol=1e-9)
        np.testing.assert_allclose(mended.t, true.t, atol=1e-9)
