"""Smoothing against the batch solution of the same linear Gaussian problem, its effect, and the presets that track."""

from dataclasses import replace

import numpy as np
import pytest
from people import ring
from walking_people import film, identities

from mvpose import preset
from mvpose.affinity import AppearanceAffinity
from mvpose.estimators import SequenceEstimator
from mvpose.presets import PRESETS, TRACKING
from mvpose.tracking import Tracker, TrackingModel, TrackingPipeline, track
from mvpose.tracking.motion import condition, predict, transition
from mvpose.tracking.smoothing import smooth_joint, smoother_gain

SPEED, TIME, TRUNK = np.array([0.7]), np.array([0.8]), np.array([True])


PATHS = [(-0.8, -0.5, 0.4, 0.2), (0.8, 0.6, -0.3, -0.3)]
ALONE = {"track": "full", "track-fast": "fast"}


def test_smoothed_states_are_those_of_the_joint_gaussian():
    rng = np.random.default_rng(1)
    times, noise = np.cumsum(rng.uniform(0.02, 0.3, 6)), 0.05**2
    measured = rng.standard_normal((6, 3))
    state, covariance = np.zeros((1, 6)), np.eye(6)[None] * 2.0
    filtered, predicted = [], []
    for k in range(6):
        if k:
            predict(state, covariance, times[k] - times[k - 1], SPEED, TIME, TRUNK)
        predicted.append((state[0].copy(), covariance[0].copy()))
        prior = np.linalg.inv(covariance[0, :3, :3])
        posterior = np.linalg.inv(prior + np.eye(3) / noise)
        mean = posterior @ (prior @ state[0, :3] + measured[k] / noise)
        condition(state[0], covariance[0], mean, prior, posterior, np.empty((6, 3)))
        filtered.append((state[0].copy(), covariance[0].copy()))
    after, after_covariance = filtered[-1]
    for k in range(4, -1, -1):
        now, now_covariance = filtered[k]
        reach, decay, *_ = transition(times[k + 1] - times[k], 0.7, 0.8)
        gain = np.empty((6, 6))
        assert smoother_gain(gain, now_covariance, predicted[k + 1][1], reach, decay, np.empty((7, 6)))
        smooth_joint(now, now_covariance, *predicted[k + 1], after, after_covariance, gain, np.empty((12, 6)))
        after, after_covariance = now, now_covariance
    expected, expected_covariance = _batch(times, measured, noise)
    np.testing.assert_allclose(after, expected[:6], atol=1e-9)
    np.testing.assert_allclose(after_covariance, expected_covariance[:6, :6], atol=1e-9)


def _batch(times, measured, noise):
    """Mean and covariance of all states from one normal equation."""
    count = len(times)
    information, right = np.zeros((6 * count, 6 * count)), np.zeros(6 * count)
    information[:6, :6] += np.eye(6) / 2.0
    for k in range(count):
        block = slice(6 * k, 6 * k + 3)
        information[block, block] += np.eye(3) / noise
        right[block] += measured[k] / noise
        if k:
            reach, decay, q_xx, q_xv, q_vv = transition(times[k] - times[k - 1], 0.7, 0.8)
            F = np.block([[np.eye(3), reach * np.eye(3)], [np.zeros((3, 3)), decay * np.eye(3)]])
            Q = np.block([[q_xx * np.eye(3), q_xv * np.eye(3)], [q_xv * np.eye(3), q_vv * np.eye(3)]])
            both = np.hstack([-F, np.eye(6)])
            span = slice(6 * k - 6, 6 * k + 6)
            information[span, span] += both.T @ np.linalg.inv(Q) @ both
    covariance = np.linalg.inv(information)
    return covariance @ right, covariance


def test_later_frames_make_estimates_better_and_smoother():
    times = np.arange(25) / 25
    rig, frames, truth = film(PATHS, times, noise=6.0)
    errors, bends = [], []
    for lag in (0.0, 0.2, np.inf):
        estimates = list(track(Tracker(preset("fast")), rig, frames, lag=lag))
        assert [len(each) for each in estimates] == [2] * len(times)
        assert [each.time for each in estimates] == pytest.approx(list(times))
        ids = identities(estimates, truth)
        joints = np.array([each.joints[np.argsort(each.ids)] for each in estimates])
        true = truth[:, np.argsort(ids[0])]
        errors.append(np.linalg.norm(joints - true, axis=-1)[3:-3].mean())
        bends.append(np.linalg.norm(np.diff(joints - true, 2, axis=0), axis=-1).mean())
    assert errors[1] < 0.95 * errors[0]
    assert errors[2] < errors[1]
    assert bends[1] < 0.6 * bends[0]


def test_a_lag_also_corrects_the_first_frame():
    paths, errors = [(-1.0, 0.0, 0.5, 0.0), (1.0, 1.0, 0.0, 0.0)], []
    for seed in range(4):
        rig, frames, truth = film(paths, np.arange(15) / 25.0, noise=6.0, seed=seed)
        firsts = [next(track(Tracker(preset("fast")), rig, frames, lag=lag)) for lag in (0.0, 0.4)]
        errors.append([np.linalg.norm(np.sort(first.joints, axis=0) - np.sort(truth[0], axis=0)) for first in firsts])
    alone, corrected = np.mean(errors, axis=0)
    assert corrected < 0.8 * alone


def test_without_a_lag_estimates_are_those_of_the_tracker():
    rig, frames, _ = film(PATHS, np.arange(6) / 25)
    tracker = Tracker(preset("fast"))
    for one, other in zip(track(Tracker(preset("fast")), rig, frames), frames, strict=True):
        np.testing.assert_array_equal(one.joints, tracker.estimate(rig, other).joints)


def test_a_negative_lag_is_refused():
    rig, frames, _ = film(PATHS, [0.0])
    with pytest.raises(ValueError, match="lag must be 0 s or more"):
        list(track(Tracker(model=TrackingModel()), rig, frames, lag=-1.0))


def as_bytes(estimates):
    return [(each.joints.tobytes(), each.ids.tobytes(), each.time) for each in estimates]


def test_presets_with_memory_are_those_that_are_named_so():
    assert {name for name in PRESETS if isinstance(preset(name), SequenceEstimator)} == TRACKING == set(ALONE)


@pytest.mark.parametrize("name", ALONE)
def test_a_frame_alone_is_estimated_by_the_pipeline(name):
    rig, frames, _ = film(PATHS, [0.0])
    one, other = (preset(each).estimate(rig, frames[0]) for each in (name, ALONE[name]))
    assert one.joints.tobytes() == other.joints.tobytes()
    assert one.covariance.tobytes() == other.covariance.tobytes()
    assert one.ids is None


@pytest.mark.parametrize("name", ALONE)
def test_people_of_a_recording_have_identities_and_every_call_starts_anew(name):
    rig, frames, truth = film(PATHS, np.arange(8) / 25)
    estimator = preset(name)
    estimates = list(estimator.track(rig, frames))
    ids = identities(estimates, truth)
    assert sorted(ids[0]) == [0, 1]
    assert (ids == ids[0]).all()
    assert as_bytes(estimator.track(rig, iter(frames))) == as_bytes(estimates)


def test_the_lag_is_that_of_the_smoother():
    rig, frames, _ = film(PATHS, np.arange(10) / 25)
    for lag in (0.0, 0.1, np.inf):
        expected = track(Tracker(preset("fast")), rig, frames, lag=lag)
        assert as_bytes(preset("track-fast", lag=lag).track(rig, frames)) == as_bytes(expected)
    with pytest.raises(ValueError, match="lag must be 0 s or more, got -1"):
        preset("track", lag=-1.0)


def test_frames_without_times_are_a_period_apart():
    rig, frames, _ = film(PATHS, np.arange(5) / 8, timed=False)
    estimates = preset("track-fast", period=1 / 8).track(rig, frames)
    assert [each.time for each in estimates] == pytest.approx(np.arange(5) / 8)
    with pytest.raises(ValueError, match="period must be above 0 s"):
        preset("track", period=0.0)


@pytest.mark.parametrize("name", ALONE)
def test_the_scale_of_descriptors_reaches_the_tracker(name):
    appearance = AppearanceAffinity(0.123)
    assert preset(name, appearance=appearance).pipeline.affinity.appearance is appearance


def test_frames_before_the_first_picture_have_no_people():
    rig, frames, _ = film(PATHS, np.arange(8) / 25, lost=lambda frame, view: frame < 3)
    estimates = list(preset("track-fast").track(rig, frames))
    assert [len(each) for each in estimates] == [0] * 3 + [2] * 5
    assert [each.time for each in estimates[:3]] == [None] * 3
    assert all(each.ids is not None for each in estimates)
    assert as_bytes(estimates[3:]) == as_bytes(preset("track-fast").track(rig, frames[3:]))


def test_stages_can_be_replaced():
    rig, frames, _ = film(PATHS, np.arange(4) / 25)
    stages = preset("hungarian")
    estimator = TrackingPipeline(stages, TrackingModel(period=0.1), lag=0.0)
    expected = [Tracker(stages, model=estimator.model)]
    expected = [expected[0].estimate(rig, frame) for frame in frames]
    assert as_bytes(estimator.track(rig, frames)) == as_bytes(expected)


def test_pipelines_without_memory_ignore_the_times_of_pictures():
    rig, frames, _ = film(PATHS, [0.0], rig=ring(4))
    late = replace(frames[0], time=np.array([0.0, 5.0, -3.0, 100.0]))
    for name in PRESETS.keys() - TRACKING - {"appearance"}:
        one, other = (preset(name).estimate(rig, each) for each in (frames[0], late))
        assert one.joints.tobytes() == other.joints.tobytes(), name
