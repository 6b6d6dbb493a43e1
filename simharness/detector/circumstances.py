"""Circumstances in which a detector takes left for right, or one person for another: factors of the shares of errors.

A detector distinguishes left and right by the face and by which limb hides the other: from behind and from the side
they are inverted more often than from the front. A joint is taken for its counterpart, or for that of another person,
where both are near in the picture.
"""

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.detector.viewing_conditions import head_bearings
from simharness.scenario.sections.detector_section import FACTOR_BEARINGS


def inversion_factors(joints: ArrayLike, rig: Rig, factors: tuple[float, ...] | None) -> Floats:
    """Return the factors of inversions of people, (T, V, P), by the bearing of the camera from the head.

    Args:
        joints: true joints in the world, (T, P, 17, 3) metres.
        rig: the V cameras.
        factors: factor at each of FACTOR_BEARINGS from straight ahead, with linear interpolation, to both sides alike;
            None: 1 everywhere.
    """
    joints = np.asarray(joints, float)
    if factors is None:
        return np.ones((len(joints), len(rig), joints.shape[1]))
    away = np.abs(np.mod(np.nan_to_num(head_bearings(joints, rig)) + np.pi, 2 * np.pi) - np.pi)
    return np.interp(away, np.deg2rad(FACTOR_BEARINGS), factors)


def distance_factors(target: Floats, other: Floats, height: Floats, reach: float) -> Floats:
    """Return the factors of inversions or swaps, (..., J): exp(-distance / (reach x height)); 1 with a reach of 0.

    Args:
        target: true places of the joints, (..., J, 2) pixels.
        other: places of their counterparts, or of the same joints of the other person, (..., J, 2) pixels.
        height: height of the person's box, (...) pixels.
        reach: distance at which a factor of 1 has fallen to 1 / e, heights.
    """
    if reach == 0:
        return np.ones(target.shape[:-1])
    with np.errstate(invalid="ignore"):
        far = np.hypot(*np.moveaxis(target - other, -1, 0)) / np.maximum(height, 1.0)[..., None]
    return np.nan_to_num(np.exp(-far / reach))
