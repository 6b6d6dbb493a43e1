"""People who were never there: upright postures in space, from a handful of normal numbers each.

Nothing of them needs to be exact: they are what a detector takes shadows and coats for. Lengths are shares of stature
(Drillis & Contini, Body segment parameters, 1966).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from mvpose.arrays import Floats

DRAWS = 20
"""Normal numbers that make one posture."""

_SEATED = 0.15  # share of those who half sit
_THIGH, _SHANK, _ANKLE = 0.245, 0.246, 0.039
_UPPER_ARM, _FOREARM, _TRUNK = 0.186, 0.146, 0.288
_HIP, _SHOULDER = 0.050, 0.115  # half the distance of the two joints' centres
# The face from the middle of the shoulders, of one who looks ahead along x: nose, eyes, ears.
_FACE = np.array(
    [(0.062, 0.0, 0.100), (0.052, 0.018, 0.118), (0.052, -0.018, 0.118), (0.0, 0.043, 0.110), (0.0, -0.043, 0.110)]
)


def postures(normals: Floats) -> Floats:
    """COCO-17 joints (n, 17, 3), metres, from standard normal numbers (n, DRAWS).

    They stand on z = 0 around the origin and face along x: upright or half seated, arms hanging, bent or raised.
    """
    stature = np.clip(1.70 + 0.10 * normals[:, 0], 1.45, 1.95)
    seated = (ndtr(normals[:, 1]) < _SEATED)[:, None]
    legs, arms = normals[:, 6:12].reshape(-1, 2, 3), normals[:, 12:18].reshape(-1, 2, 3)
    side = np.array([1.0, -1.0])

    hips = _points(0.0, _HIP * side, 0.0, shape=legs.shape[:2])
    flexed = np.where(seated, 1.2, 0.10) + 0.15 * legs[..., 0]
    bent = np.where(seated, 1.3, 0.08) + 0.15 * np.abs(legs[..., 1])
    abducted = 0.06 + 0.05 * np.abs(legs[..., 2])
    knees = hips + _THIGH * _hanging(flexed, side * abducted)
    ankles = knees + _SHANK * _hanging(flexed - bent, side * abducted)

    pitch = 0.05 + 0.08 * normals[:, 2] + 0.1 * seated[:, 0]
    roll = 0.05 * normals[:, 3]
    chest = _TRUNK * np.stack([np.sin(pitch), np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=-1)
    shoulders = chest[:, None] + _points(0.0, _SHOULDER * side, 0.0, shape=arms.shape[:2])
    raised = 0.1 + 0.45 * arms[..., 0]
    apart = 0.12 + 0.25 * np.abs(arms[..., 1])
    elbows = shoulders + _UPPER_ARM * _hanging(raised, side * apart)
    folded = np.minimum(0.25 + 0.6 * np.abs(arms[..., 2]), 2.3)
    wrists = elbows + _FOREARM * _hanging(raised + folded, side * apart * 0.5)

    face = chest[:, None] + _nodded(turned(np.broadcast_to(_FACE, (len(normals), 5, 3)), 0.35 * normals[:, 4]), normals)
    joints = np.concatenate([face, shoulders, elbows, wrists, hips, knees, ankles], axis=1)
    joints[..., 2] += _ANKLE - ankles[..., 2].min(axis=1, keepdims=True)
    return joints * stature[:, None, None]


def turned(points: Floats, yaw: Floats) -> Floats:
    """Points (n, k, 3) turned about the z axis by yaw (n,), radians."""
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def seen_from(points: Floats, yaw: Floats, tilt: Floats) -> Floats:
    """Points (n, k, 3) as a far camera shows them, (n, k, 2), x to the right and y down, in boxes of height 1 about 0.

    Args:
        points: who faces along x.
        yaw: by how much each is turned away from the camera, (n,), radians.
        tilt: by how much the camera looks down, (n,), radians.
    """
    x, y, z = np.moveaxis(turned(points, yaw), -1, 0)
    flat = np.stack([y, x * np.sin(tilt)[:, None] - z * np.cos(tilt)[:, None]], axis=-1)
    low, high = flat.min(axis=1, keepdims=True), flat.max(axis=1, keepdims=True)
    return (flat - (low + high) / 2) / (high - low)[..., 1:]


def _nodded(face: Floats, normals: Floats) -> Floats:
    c, s = np.cos(0.12 * normals[:, 5])[:, None], np.sin(0.12 * normals[:, 5])[:, None]
    x, y, z = np.moveaxis(face, -1, 0)
    return np.stack([c * x - s * z, y, s * x + c * z], axis=-1)


def _hanging(forward: Floats, outward: Floats) -> Floats:
    """Unit vectors (n, 2, 3) of limbs: down, turned forward and then outward by angles (n, 2)."""
    return np.stack([np.sin(forward) * np.cos(outward), np.sin(outward), -np.cos(forward) * np.cos(outward)], axis=-1)


def _points(x: float, y: Floats, z: float, *, shape: tuple[int, int]) -> Floats:
    return np.stack(np.broadcast_arrays(np.full(shape, x), y, z), axis=-1)
