"""Height of a pelvis that follows its legs: high over a standing person, lower while steps are long."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import minimum_filter1d

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, pelvis_height
from simharness.world.motion.poses.kinematics import Kinematics

_SAMPLES = 8  # from knot to knot of the spline

Stances = Callable[[Floats], tuple[Pelvis, Mapping[str, Foot]]]
"""Motion of pelvis and feet at times (T,) in seconds."""


def following_height(
    kinematics: Kinematics, stances: Stances, time: Floats, *, straightest: float, within: float
) -> Floats:
    """Return the greatest smooth height of the pelvis at which no knee flexes less than ``straightest``, (T,) metres.

    A cubic B-spline is a mean of those of its coefficients whose knots are near. Each coefficient is the lowest height
    that the legs allow near its knot, so the mean is nowhere higher than the legs allow. Where the legs allow the same
    height once in every ``2 * within`` seconds, as at the steps of a walk, the height is constant. It depends on the
    stances up to ``2 * within`` seconds away, and on no other times of ``time``.

    Args:
        kinematics: body.
        stances: motion of pelvis and feet; the height is that without the ``bob`` of the pelvis.
        time: times in seconds, (T,).
        straightest: smallest flexion of a knee, radians.
        within: time in which the height follows the legs, seconds.
    """
    if not len(time):
        return np.zeros(0)
    apart = within / 2  # between knots, of which the two on either side count
    first, last = int(np.floor(time.min() / apart)) - 2, int(np.ceil(time.max() / apart)) + 2
    reach = 2 * _SAMPLES
    sampled: Floats = np.arange(first * _SAMPLES - reach, last * _SAMPLES + reach + 1, dtype=float) * (apart / _SAMPLES)
    pelvis, feet = stances(sampled)
    turn = pelvis.turn.as_matrix()
    allowed = [pelvis_height(kinematics, side, pelvis.ground, turn, feet[side].ankle, straightest) for side in SIDES]
    lowest = minimum_filter1d(np.min(allowed, axis=0) - pelvis.bob, 2 * reach + 1)[reach:-reach:_SAMPLES]
    knots = np.arange(first - 2, last + 3) * apart
    return np.asarray(BSpline(knots, lowest, 3)(time))
