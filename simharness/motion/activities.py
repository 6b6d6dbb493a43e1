"""One door to all motions: an activity's name and a track in, a motion out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simharness.motion.gait import Gait
from simharness.motion.gestures import gesture
from simharness.motion.kinematics import Kinematics
from simharness.motion.motion import Motion
from simharness.motion.paths import Loop, Track
from simharness.motion.walking import walk


def perform(
    activity: str,
    kinematics: Kinematics,
    track: Track,
    time: NDArray[np.float64],
    *,
    gait: Gait | None,
    rng: np.random.Generator,
) -> Motion:
    """Let one person do one activity.

    Args:
        activity: "walk" on a loop, or a key of ``gestures.GESTURES`` on a spot.
        kinematics: the body.
        track: where.
        time: seconds, (T,).
        gait: how the body walks; needed on a loop only.
        rng: draws the manner.
    """
    if isinstance(track, Loop):
        if gait is None:
            raise ValueError(f"to {activity} on a loop needs a gait: make_gait(kinematics)")
        return walk(kinematics, track, gait, time, rng)
    return gesture(activity, kinematics, track, time, rng)
