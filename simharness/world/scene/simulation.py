"""The truth at the frames' own times, whatever the cameras' clocks say."""

from __future__ import annotations

import numpy as np

from simharness.types.landmarks import LANDMARKS
from simharness.types.sequence import Sequence
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback


def simulate(scene: Scene) -> Sequence:
    """Play the scene through, frame by frame.

    Returns:
        The landmarks of everyone in every frame; arrays of P = 0 for an empty room.
    """
    landmarks = np.empty((len(scene.time), len(scene.bodies), len(LANDMARKS), 3))
    for frame, state in enumerate(Playback(scene).over(scene.time)):
        landmarks[frame] = state.landmarks
    return Sequence(landmarks=landmarks, ids=np.arange(len(scene.bodies)), time=scene.time)
