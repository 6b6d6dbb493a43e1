"""Frames one by one: the content of the whole recording, and pictures that are exported, of which none is kept."""

from __future__ import annotations

import weakref
from dataclasses import fields

import numpy as np
import pytest

import simharness
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

KEYS = ["people.count=2", "duration=0.4", "cameras.count=2", "cameras.size=[96, 72]", 'rendering.renderer="rays"']


def arrays_of(thing):
    """Return the arrays of a dataclass by name."""
    found = {field.name: getattr(thing, field.name) for field in fields(thing)}
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray)}


def test_frames_have_the_bytes_of_the_whole_recording():
    scenario = simharness.load_scenario("quickstart", overrides=KEYS, seed=3)
    recording = simharness.simulate(scenario)
    frames = list(simharness.simulate_frames(scenario))
    assert [frame.time for frame in frames] == recording.time.tolist()
    for frame, detections, truth in zip(frames, recording.detections, recording.truth, strict=True):
        for one, other in ((frame.detections, detections), (frame.truth, truth)):
            mine, whole = arrays_of(one), arrays_of(other)
            assert mine.keys() == whole.keys()
            assert len(mine) >= 5
            assert {name: array.tobytes() for name, array in mine.items()} == {
                name: array.tobytes() for name, array in whole.items()
            }
        assert frame.pictures == ()


@pytest.mark.slow
def test_pictures_are_those_of_the_cameras_and_are_not_kept():
    scenario = simharness.load_scenario("quickstart", overrides=[*KEYS, "faults.dropped=0.3"], seed=3)
    trial = build_trial(scenario)
    source, lost, last = picture_source_of(scenario, Playback(trial.scene)), 0, None
    for number, frame in enumerate(simharness.simulate_frames(scenario, pictures=True)):
        assert last is None or last() is None  # the picture of the frame before is gone
        for view, picture in enumerate(frame.pictures):
            assert picture.tobytes() == source.picture(trial.exposures, number, view, finer=2).tobytes()
            assert picture.any() == trial.exposures.delivered[number, view]
            lost += not picture.any()
        last = weakref.ref(frame.pictures[0])
        del frame, picture
    assert 0 < lost < 8
