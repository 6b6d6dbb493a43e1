from dataclasses import replace

import numpy as np
import pytest
from recordings import record, ring, walk

from mvpose import Camera, Rig
from simharness.scoring.assessment import reprojection_errors
from simharness.types.recording import Recording
from simharness.types.views import Visibility


def test_the_truth_has_no_error_and_detections_have_their_noise():
    recording = record(frames=40, noise=3.0, phantoms=2)
    estimate, detection = reprojection_errors(recording, walk(40, 2))
    assert len(estimate) == 40 * 2 * 3 * 17
    np.testing.assert_allclose(estimate, 0, atol=1e-9)
    assert np.median(detection) == pytest.approx(3.0 * np.sqrt(2 * np.log(2)), rel=0.03)  # Rayleigh


def test_a_wrong_believed_rig_changes_the_error_of_estimates_only():
    recording = record()
    shifted = [
        Camera(K=camera.K + [[0, 0, 4.0], [0, 0, 3.0], [0, 0, 0]], R=camera.R, t=camera.t, size=camera.size)
        for camera in ring(3)
    ]
    believed = Recording(recording.time, Rig(shifted), recording.detections, recording.truth)
    estimate, detection = reprojection_errors(believed, walk(5, 2))
    np.testing.assert_allclose(estimate, 5.0)
    np.testing.assert_allclose(detection, 0, atol=1e-9)


def test_both_errors_are_over_the_visible_detected_joints_of_people_found():
    recording, placed = record(people=3), walk(5, 3)
    hidden = recording.truth[0].visibility.copy()
    hidden[1, 0, :4] = Visibility.SELF_OCCLUDED  # frame 0, view 1, person 0: four joints
    missing = recording.detections[1].scores.copy()
    missing[0, :5] = 0.0  # frame 1, the detection of person 0 in view 0: five keypoints
    missed = recording.truth[2].person.copy()
    missed[missed == 1] = -1  # frame 2: person 1 is not detected, in three views
    recording = Recording(
        recording.time,
        recording.rig,
        (recording.detections[0], replace(recording.detections[1], scores=missing), *recording.detections[2:]),
        (
            replace(recording.truth[0], visibility=hidden),
            recording.truth[1],
            replace(recording.truth[2], person=missed),
            *recording.truth[3:],
        ),
    )
    placed[3, 2] = np.nan  # frame 3: person 2 was missed, in three views
    placed[4, 1, 7] = np.nan  # frame 4: an elbow is missing, in three views
    placed[4, 0] += 0.1  # and person 0 is off
    estimate, detection = reprojection_errors(recording, placed)
    assert len(estimate) == len(detection) == 5 * 3 * 3 * 17 - 4 - 5 - 3 * 17 - 3 * 17 - 3
    assert (estimate > 1.0).sum() == 3 * 17
    np.testing.assert_allclose(detection, 0, atol=1e-9)


def test_a_second_detection_in_a_view_is_compared_too():
    recording = record(frames=1, people=1)
    truth = replace(recording.truth[0], person=[0, 0, 0], error=np.zeros((3, 17)))
    twice = replace(recording.detections[0], view=[0, 0, 1])
    estimate, detection = reprojection_errors(Recording(recording.time, recording.rig, (twice,), (truth,)), walk(1, 1))
    assert len(estimate) == len(detection) == 3 * 17
    assert (detection[17:34] > 1.0).all()  # the pixels of view 1 are wrong in view 0
    np.testing.assert_allclose(estimate, 0, atol=1e-9)


def test_no_detections():
    recording = record(people=0)
    estimate, detection = reprojection_errors(recording, walk(5, 0))
    assert len(estimate) == len(detection) == 0


def test_a_joint_behind_a_believed_camera_has_no_pixel():
    recording, placed = record(frames=1, people=1), walk(1, 1)
    placed[0, 0] += 2 * recording.rig.centers[0] - placed[0, 0].mean(axis=0)  # behind camera 0
    assert len(reprojection_errors(recording, placed)[0]) == 2 * 17
