"""Boxes of people in the pictures, estimated from their joints: recordings have no silhouettes."""

from __future__ import annotations

import numpy as np

from mvpose import Rig
from mvpose.arrays import Bools, Floats
from simharness.reality.detector_fit.sample import LIMB_JOINTS

FLESH = 0.085
"""Margin about every limb joint and the crown, metres. With this margin and CROWN, the median error of width and height
of the boxes is 1 % for simulated, dressed people who walk, reach, point and turn; the error of the root of the area is
below 10 % for 90 % of them."""

CROWN = 0.6
"""Height of the crown above the middle of the shoulders, as a share of the trunk's length."""

_CHIN = 0.35
"""Height of the face on the same scale."""

_SHOULDERS, _HIPS = [5, 6], [11, 12]


def head(joints: Floats, *, height: float) -> Floats:
    """Return a point of the head, (..., 3), from COCO-17 joints (..., 17, 3).

    Args:
        joints: metres.
        height: height above the middle of the shoulders, in lengths of the trunk.
    """
    shoulders, hips = joints[..., _SHOULDERS, :].mean(axis=-2), joints[..., _HIPS, :].mean(axis=-2)
    return shoulders + height * (shoulders - hips)


def boxes(joints: Floats, rig: Rig, *, flesh: float = FLESH, crown: float = CROWN) -> Floats:
    """Return the boxes x, y, width, height of people in the pictures, (T, V, P, 4); zeros where they are not visible.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres; only limb joints are used.
        rig: the V cameras.
        flesh: margin about every joint, metres.
        crown: height of the crown above the shoulders, in lengths of the trunk.
    """
    points = np.concatenate([joints[..., LIMB_JOINTS, :], head(joints, height=crown)[..., None, :]], axis=-2)
    result = []
    for camera in rig:
        pixels = camera.project(points)
        focal = np.sqrt(camera.K[0, 0] * camera.K[1, 1])
        with np.errstate(invalid="ignore", divide="ignore"):
            around = (flesh * focal / camera.depth(points))[..., None]
        limit = np.asarray(camera.size, float) - 1
        whole = np.all(np.isfinite(pixels), axis=(-1, -2))  # no box for people who are partly behind the camera
        low = np.clip(np.where(whole[..., None], (pixels - around).min(axis=-2), 0.0), 0, limit)
        high = np.clip(np.where(whole[..., None], (pixels + around).max(axis=-2), 0.0), 0, limit)
        result.append(np.concatenate([low, high - low], axis=-1))
    return np.stack(result, axis=1)


def in_picture(joints: Floats, rig: Rig) -> Bools:
    """Return which joints lie on the pictures, (T, V, P, 17); for joints of the face, the middle of the head."""
    points = joints.copy()
    points[..., : LIMB_JOINTS[0], :] = head(joints, height=_CHIN)[..., None, :]
    return np.stack([camera.inside(camera.project(points)) for camera in rig], axis=1)
