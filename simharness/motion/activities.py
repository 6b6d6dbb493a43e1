"""One door to all motions: an activity's name and a track in, a motion out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    rng: np.random.Generator,
    pace: float = 1.0,
) -> Motion:
    """Let one person do one activity.

    Args:
        activity: "walk" on a loop, or a key of ``gestures.GESTURES`` on a spot.
        kinematics: the body.
        track: where.
        time: seconds, (T,).
        rng: draws the manner.
        pace: quick short steps are above 1; see ``make_gait``.

    Raises:
        ValueError: an activity that does not go with the track.
    """
    if (activity == "walk") != isinstance(track, Loop):
        raise ValueError(f"{activity!r} does not go with a {type(track).__name__}: walk on a Loop, all else on a Spot")
    if isinstance(track, Loop):
        return walk(kinematics, track, time, rng=rng, pace=pace)
    return gesture(activity, kinematics, track, time, rng=rng)
