"""Frozen frames: the same detections as the frame, perfect ones without errors, and errors that are independent."""

import numpy as np
import pytest
from crowded_frames import crowd

from mvpose import COCO17, preset
from simharness.hunt.frozen_frame import freeze
from simharness.scoring.stage_blame import perfect_detections


def frozen(k, *more):
    recording = crowd(*more)
    return freeze(recording.rig, recording.detections[k], recording.truth[k])


def rows(detections, person):
    """Return detections as rows in an order that depends on their content alone."""
    table = np.column_stack(
        [detections.view, person, detections.box_scores, detections.scores, detections.keypoints.reshape(-1, 34)]
    )
    return table[np.lexsort(np.nan_to_num(table).round(4).T[::-1])]


@pytest.mark.parametrize("k", [0, 4, 9])
@pytest.mark.parametrize("more", [(), ("faults.rotation=1.0", "faults.clock_offset=0.1")], ids=["exact", "faults"])
def test_a_frozen_frame_has_the_detections_of_the_frame(k, more):
    recording = crowd(*more)
    rig, detections, truth = frozen(k, *more).detected()
    expected = rows(recording.detections[k], recording.truth[k].person)
    np.testing.assert_allclose(rows(detections, truth.person), expected, atol=1e-6)
    np.testing.assert_array_equal(truth.visibility, recording.truth[k].visibility)
    np.testing.assert_allclose(truth.pixels, recording.truth[k].pixels, atol=1e-6)
    answers = [
        preset("full").estimate(recording.rig, recording.detections[k]),
        preset("full").estimate(rig, detections),
    ]
    assert len(answers[0]) == len(answers[1])
    np.testing.assert_allclose(answers[1].joints, answers[0].joints, atol=1e-6)


def test_without_errors_detections_are_perfect():
    recording = crowd()
    _, detections, truth = frozen(4).with_errors(()).detected()
    perfect, of = perfect_detections(recording.detections[4], recording.truth[4])
    np.testing.assert_allclose(rows(detections, truth.person), rows(perfect, of.person), atol=1e-6)
    assert not truth.error[detections.scores > 0].any()


def test_removing_an_error_of_a_keypoint_changes_that_keypoint_alone():
    frame = frozen(4)
    _, before, of_before = frame.detected()
    moved = [e for e in frame.errors if e.kind == "keypoint" and e.offset is not None and np.hypot(*e.offset) > 1][:5]
    assert moved
    for error in moved:
        _, after, of_after = frame.with_errors(each for each in frame.errors if each != error).detected()
        np.testing.assert_array_equal(of_before.person, of_after.person)
        changed = np.argwhere((before.keypoints != after.keypoints).any(axis=-1) & (before.scores > 0))
        ((d, j),) = changed.tolist()
        view = [camera.name for camera in frame.cameras].index(error.camera)
        person = frame.numbers.index(error.person)
        assert (int(before.view[d]), int(of_before.person[d]), COCO17.joints[j]) == (view, person, error.joint)
        assert np.allclose(after.keypoints[d, j], of_after.pixels[view, person, j])


def test_fewer_people_and_cameras_leave_the_others_as_they_were():
    frame = frozen(4)
    part = frame.of(people=frame.people[1:3], cameras=frame.cameras[1:])
    _, whole, of_whole = frame.detected()
    _, some, of_some = part.detected()
    kept = (whole.view > 0) & np.isin(of_whole.person, [-1, 1, 2])
    renumbered = np.where(of_whole.person[kept] < 0, -1, of_whole.person[kept] - 1)
    moved = whole.select(kept)
    expected = rows(moved, renumbered)
    expected[:, 0] -= 1
    np.testing.assert_allclose(rows(some, of_some.person), expected, atol=1e-9)
    assert part.numbers == [1, 2]


def test_the_fault_of_a_calibration_is_an_error_of_pictures():
    faulty = ("faults.rotation=1.0", "faults.clock_offset=0.1")
    assert not [each for each in frozen(4).errors if each.kind == "picture"]
    frame = frozen(4, *faulty)
    assert [each for each in frame.errors if each.kind == "picture"]
    mended = frame.with_errors(each for each in frame.errors if each.kind != "picture")
    _, _, truth = mended.detected()
    rig, _, _ = mended.detected()
    np.testing.assert_allclose(truth.pixels[0], rig[0].project(truth.joints), atol=1e-9)
