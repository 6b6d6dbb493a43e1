"""Frames of a simulated scenario one after another, with pictures that are rendered when their frame is reached."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections, Rig
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.types.truth import Truth
from simharness.world.scene.playback import Playback

_FINER = 2  # samples per pixel along each axis, as of exported pictures


@dataclass(frozen=True)
class SimulatedFrame:
    """What the cameras give in one frame, and the truth."""

    time: float
    """Seconds."""
    rig: Rig
    """Believed cameras, V: the calibration that the method is given."""
    detections: Detections
    """Detections of all cameras."""
    truth: Truth
    """Ground truth."""
    pictures: tuple[NDArray[np.uint8], ...] = ()
    """Picture of each camera, (h, w, 3) RGB, black where none arrives; empty where pictures were not requested."""


def simulate_frames(scenario: Scenario, *, pictures: bool = False) -> Iterator[SimulatedFrame]:
    """Simulate a scenario, and yield its frames in order, with the same content as :func:`simharness.api.simulate`.

    Errors of detectors last for several frames, so detections of all frames are drawn before the first is yielded: some
    20 kB a frame. Pictures, which are a hundred times larger, are rendered frame by frame and not kept.

    Args:
        scenario: the scenario.
        pictures: whether the frames have the pictures of the cameras.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    result = run_trial(scenario, until="detect")
    recording, exposures = result.recording, result.trial.exposures
    source = picture_source_of(scenario, Playback(result.trial.scene)) if pictures else None
    views = range(len(recording.rig)) if source is not None else ()
    for frame, time in enumerate(recording.time.tolist()):
        shown = tuple(source.picture(exposures, frame, view, finer=_FINER) for view in views if source is not None)
        yield SimulatedFrame(time, recording.rig, recording.detections[frame], recording.truth[frame], shown)
