"""Presets that track: one frame alone, recordings in order, and what reaches the tracker."""

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

PATHS = [(-0.8, -0.5, 0.4, 0.2), (0.8, 0.6, -0.3, -0.3)]
ALONE = {"track": "full", "track-fast": "fast"}


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
