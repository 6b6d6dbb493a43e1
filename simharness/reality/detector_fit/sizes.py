"""How large people are in the pictures, from their joints alone: recordings come without silhouettes."""

from __future__ import annotations

import numpy as np

from mvpose import Rig
from mvpose.arrays import Bools, Floats
from simharness.reality.detector_fit.sample import LIMBS

FLESH = 0.085
"""Metres about every joint of the limbs and the crown. With CROWN: widths and heights of the boxes are right to 1 % in
the median for simulated, dressed people who walk, reach, point and turn; the root of the area is right to 10 % for 90 %
of them."""

CROWN = 0.6
"""How far the crown is above the middle of the shoulders, as a share of the trunk's length."""

_CHIN = 0.35
"""Where the face is, on the same scale."""

_SHOULDERS, _HIPS = [5, 6], [11, 12]


def head(joints: Floats, *, height: float) -> Floats:
    """A point of the head, (..., 3), above the shoulders of COCO-17 joints (..., 17, 3) by a share of the trunk."""
    shoulders, hips = joints[..., _SHOULDERS, :].mean(axis=-2), joints[..., _HIPS, :].mean(axis=-2)
    return shoulders + height * (shoulders - hips)


def boxes(joints: Floats, rig: Rig, *, flesh: float = FLESH, crown: float = CROWN) -> Floats:
    """Boxes x, y, width, height of what the pictures show of people, (T, V, P, 4); zeros where they do not.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres; only the limbs are looked at.
        rig: the V cameras.
        flesh: metres about every joint.
        crown: above the shoulders, in lengths of the trunk.
    """
    points = np.concatenate([joints[..., LIMBS, :], head(joints, height=crown)[..., None, :]], axis=-2)
    result = []
    for camera in rig:
        pixels = camera.project(points)
        focal = np.sqrt(camera.K[0, 0] * camera.K[1, 1])
        with np.errstate(invalid="ignore", divide="ignore"):
            around = (flesh * focal / camera.depth(points))[..., None]
        limit = np.asarray(camera.size, float) - 1
        whole = np.all(np.isfinite(pixels), axis=(-1, -2))  # nobody who is partly behind the camera
        low = np.clip(np.where(whole[..., None], (pixels - around).min(axis=-2), 0.0), 0, limit)
        high = np.clip(np.where(whole[..., None], (pixels + around).max(axis=-2), 0.0), 0, limit)
        result.append(np.concatenate([low, high - low], axis=-1))
    return np.stack(result, axis=1)


def in_picture(joints: Floats, rig: Rig) -> Bools:
    """Which joints fall on the pictures, (T, V, P, 17); of the face, whether the middle of the head does."""
    points = joints.copy()
    points[..., : LIMBS[0], :] = head(joints, height=_CHIN)[..., None, :]
    return np.stack([camera.inside(camera.project(points)) for camera in rig], axis=1)
