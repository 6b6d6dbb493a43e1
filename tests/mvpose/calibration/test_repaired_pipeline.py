"""Estimation with repair in front: clocks that are off cost nothing, and labels are those of the given detections."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import disturbed, walk
from people import ring

from mvpose import Detections, preset
from mvpose.calibration.clocks import estimate_clocks
from mvpose.calibration.repaired_pipeline import RepairedPipeline, resampled
from mvpose.estimators import SequenceEstimator

RIG = ring(4)
PERIOD, FINE = 0.04, 0.005  # s: of frames, and of the true motion
FRAMES, MARGIN = 150, 60  # frames; steps of the true motion before the first frame
OFFSETS = np.array([0.0, 0.12, 0.0, -0.07])  # s; the first and third camera agree, so that frames keep their times


@pytest.fixture(scope="module")
def motion():
    return walk(2, frames=2 * MARGIN + round(FRAMES * PERIOD / FINE), period=FINE)


def filmed(motion, offsets):
    """Detections of each frame, of both people in all views, in the order of views and people."""
    noise, frames = np.random.default_rng(0), []
    for frame in range(FRAMES):
        steps = MARGIN + frame * round(PERIOD / FINE) + np.round(np.asarray(offsets) / FINE).astype(int)
        pixels = np.concatenate([camera.project(motion[step]) for camera, step in zip(RIG, steps, strict=True)])
        pixels = pixels + 2.0 * noise.standard_normal(pixels.shape)
        view = np.repeat(np.arange(len(RIG)), 2)
        frames.append(Detections.from_keypoints(view, pixels, np.full(pixels.shape[:2], 0.9)))
    return frames


def errors(estimates, motion):
    """Distance of the true joints from the nearest estimated person, (F,), metres."""
    result = []
    for frame, estimate in enumerate(estimates):
        true = motion[MARGIN + frame * round(PERIOD / FINE)]
        apart = np.linalg.norm(estimate.joints[None] - true[:, None], axis=-1).mean(axis=-1)
        result.append(apart.min(axis=1).mean())
    return np.array(result)


@pytest.mark.slow
def test_clocks_that_are_off_cost_little_after_repair(motion):
    plain = preset("fast")
    perfect = errors([plain.estimate(RIG, each) for each in filmed(motion, np.zeros(4))], motion)
    frames = filmed(motion, OFFSETS)
    unrepaired = errors([plain.estimate(RIG, each) for each in frames], motion)
    estimates = list(preset("fast+repair", period=PERIOD).track(RIG, frames))
    inner = slice(6, -6)  # pictures of the first and last frames were taken before and after the recording
    repaired = errors(estimates, motion)[inner].mean()
    assert unrepaired[inner].mean() > 1.5 * perfect[inner].mean()
    assert repaired < 1.15 * perfect[inner].mean()
    for estimate in estimates[inner]:
        labels = estimate.matching.labels.reshape(len(RIG), 2)
        assert (labels == labels[0]).all()
        assert set(labels[0]) == {0, 1}


def test_a_rig_that_is_off_is_repaired_before_people_are_estimated(motion):
    frames, rig = filmed(motion, np.zeros(4)), disturbed(RIG, 1.5, 0.1, seed=3, views=[2])
    plain = preset("fast")
    unrepaired = errors([plain.estimate(rig, each) for each in frames], motion).mean()
    assert errors(RepairedPipeline(plain, PERIOD).track(rig, frames), motion).mean() < 0.7 * unrepaired


def test_detections_of_cameras_in_time_stay_as_they_are(motion):
    frames = filmed(motion, np.zeros(4))[:60]
    clocks = estimate_clocks(RIG, frames, period=PERIOD)
    in_time = type(clocks)(
        **{**vars(clocks), "offsets": np.zeros(4), "times": PERIOD * np.tile(np.arange(60.0)[:, None], (1, 4))}
    )
    moved = resampled(RIG, frames, in_time)
    for given, each, rows in zip(frames, moved.frames, moved.rows, strict=True):
        np.testing.assert_allclose(given.keypoints, each.keypoints, atol=1e-9)
        np.testing.assert_array_equal(rows, np.arange(len(given)))


def test_boxes_move_with_their_keypoints(motion):
    """Pictures a third of a frame late are moved back by as much: boxes by the mean of their keypoints."""
    frames = filmed(motion, np.zeros(4))[:60]
    clocks = estimate_clocks(RIG, frames, period=PERIOD)
    times = PERIOD * np.tile(np.arange(60.0)[:, None], (1, 4)) + np.array([0.0, PERIOD / 3, 0.0, 0.0])
    moved = resampled(RIG, frames, replace(clocks, offsets=np.array([0.0, PERIOD / 3, 0.0, 0.0]), times=times))
    for given, each in zip(frames[5:-5], moved.frames[5:-5], strict=True):
        shift = (each.keypoints - given.keypoints).mean(axis=1)
        assert np.linalg.norm(shift[given.view == 1], axis=1).min() > 0.05
        np.testing.assert_allclose(each.boxes[:, :2] - given.boxes[:, :2], shift, atol=1e-9)
        np.testing.assert_allclose(each.boxes[:, 2:], given.boxes[:, 2:], atol=1e-9)


def test_presets_take_the_suffix():
    assert isinstance(preset("full+repair"), SequenceEstimator)
    assert isinstance(preset("track+repair", lag=0.0), RepairedPipeline)
    with pytest.raises(ValueError, match="unknown preset 'nothing'"):
        preset("nothing+repair")


def test_no_frames_give_no_estimates():
    assert list(RepairedPipeline(preset("fast")).track(RIG, [])) == []


@pytest.mark.parametrize("what", ["nobody", "one view", "no keypoints", "late pictures", "no pictures"])
def test_recordings_with_little_in_them_are_estimated(motion, what):
    frames = filmed(motion, np.zeros(4))[:30]
    if what == "nobody":
        frames = [each.select(np.zeros(len(each), bool)) for each in frames]
    elif what == "one view":
        frames = [each.select(each.view == 1) for each in frames]
    elif what == "no keypoints":
        frames = [replace(each, scores=np.zeros_like(each.scores)) for each in frames]
    elif what == "late pictures":
        frames = [replace(each, time=PERIOD * k - np.array([0, 0.1, 0, 0])) for k, each in enumerate(frames)]
    else:
        nobody = [each.select(np.zeros(len(each), bool)) for each in frames]
        frames = [replace(each, time=np.full(4, np.nan)) for each in nobody]
    for name in ("fast+repair", "track-fast+repair"):
        assert len(list(preset(name, period=PERIOD).track(RIG, frames))) == len(frames)
