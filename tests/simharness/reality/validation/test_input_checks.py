"""Refusals of recordings that cannot be validated."""

from dataclasses import replace

import numpy as np
import pytest
from turning_people import joints_of, walkers

from mvpose import Detections
from mvpose.skeleton import SHELF14, coco17_to_shelf14
from simharness.reality.validation.input_checks import check_recording

RECORDING = replace(walkers(frames=120, people=2, cameras=3), rate=25.0)


def of_truth(change):
    truth = RECORDING.truth.copy()
    change(truth)
    return replace(RECORDING, truth=truth)


def walking(rate, *, speed=1.4):
    """People who walk at 25 frames per second, in a file with another rate."""
    joints = joints_of(120, 2)
    joints[..., 0] += (speed / 25.0 * np.arange(120))[:, None, None]
    return replace(RECORDING, truth=coco17_to_shelf14(joints), rate=rate)


def test_a_usual_recording_is_accepted():
    check_recording(RECORDING)
    check_recording(walking(25.0))


def test_a_short_recording_has_no_intervals():
    with pytest.raises(ValueError, match=r"expected 4 s or more of annotated frames, got 2 s at 25 frames per second"):
        check_recording(RECORDING.during(np.arange(50)))


def test_a_sprint_is_accepted_and_a_wrong_rate_is_not():
    check_recording(walking(25.0, speed=10.0))
    with pytest.raises(ValueError, match=r"slower than 12.4 m/s.* at 250 frames per second; correct the rate"):
        check_recording(walking(250.0))


def test_a_single_jump_is_no_wrong_rate():
    def swap(truth):
        truth[20:] = truth[20:, ::-1]

    check_recording(of_truth(swap))


def test_gaps_in_the_frames_are_no_speed():
    apart = replace(walking(25.0), frames=np.append(np.arange(20), np.arange(1000, 1100)))
    truth = apart.truth.copy()
    truth[20:] += 50.0
    check_recording(replace(apart, truth=truth))


def test_truth_without_legs_is_named():
    def cut(truth):
        legs = [k for k, part in enumerate(SHELF14.parts) if part in {"knee", "ankle"}]
        truth[:, :, legs] = np.nan

    with pytest.raises(ValueError, match=r"with all 12 joints .* no left knee, right knee, left ankle, right ankle"):
        check_recording(of_truth(cut))


def test_nobody_and_nothing_are_refused():
    def empty(truth):
        truth[:] = np.nan

    with pytest.raises(ValueError, match="expected frames with annotated people, got none in 120 frames"):
        check_recording(of_truth(empty))
    nothing = (Detections.empty(),) * 120
    with pytest.raises(ValueError, match="expected detections, got none in 120 frames"):
        check_recording(replace(RECORDING, detections=nothing))
