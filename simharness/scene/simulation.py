"""The truth at the frames' own times, whatever the cameras' clocks say."""

from __future__ import annotations

import numpy as np

from simharness.humans.landmarks import LANDMARKS
from simharness.scene.build import Scene
from simharness.scene.playback import Playback
from simharness.scene.sequence import Sequence


def simulate(scene: Scene) -> Sequence:
    """Play the scene through, frame by frame.

    Returns:
        The landmarks of everyone in every frame; arrays of P = 0 for an empty room.
    """
    landmarks = np.empty((len(scene.time), len(scene.bodies), len(LANDMARKS), 3))
    for frame, state in enumerate(Playback(scene).over(scene.time)):
        landmarks[frame] = state.landmarks
    return Sequence(landmarks=landmarks, ids=np.arange(len(scene.bodies)), time=scene.time)
