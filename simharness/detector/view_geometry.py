"""Geometry of people in views: image axes in space, bearings, and shares of hidden joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.detector.bias import body_axes, unit
from simharness.types.views import Visibility

_HIDDEN = (Visibility.OCCLUDED_BY_PERSON, Visibility.OCCLUDED_BY_CLUTTER, Visibility.OUTSIDE)


def image_axes(centers: Floats, rig: Rig) -> Floats:
    """Return right and down in the pictures of V cameras, perpendicular to the direction to people's centers.

    Args:
        centers: positions of people, (T, P, 3) metres.
        rig: the V cameras.

    Returns:
        Unit vectors in the world, (T, V, P, 2, 3).
    """
    result = []
    for camera in rig:
        forward = centers - camera.center
        forward = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
        right = np.cross(camera.R[1], forward)
        right /= np.linalg.norm(right, axis=-1, keepdims=True)
        result.append(np.stack([right, np.cross(forward, right)], axis=-2))
    return np.stack(result, axis=1)


def bearings(joints: ArrayLike, rig: Rig) -> Floats:
    """Return the bearings of V cameras from people (T, P, 17, 3), radians to the left of straight ahead, (T, V, P)."""
    joints = np.asarray(joints, float)
    forward = body_axes(joints)[..., 0, :2]
    hips = joints[..., 11:13, :2].mean(axis=-2)
    result = []
    for camera in rig:
        toward = camera.center[:2] - hips
        result.append(np.arctan2(toward[..., 1], toward[..., 0]) - np.arctan2(forward[..., 1], forward[..., 0]))
    return np.stack(result, axis=1)


def hidden_shares(visibility: NDArray[np.int8]) -> Floats:
    """Return the share of joints (..., J) that other people or objects hide or the border cuts off, (...)."""
    return np.isin(visibility, _HIDDEN).mean(axis=-1)


def head_bearings(joints: ArrayLike, rig: Rig) -> Floats:
    """Return the bearings of V cameras from heads, radians to the left of straight ahead, (T, V, P); NaN where unknown.

    Ahead points from the middle of the ears to the nose, left from the right ear to the left one.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres; NaN where unknown.
        rig: the V cameras.
    """
    joints = np.asarray(joints, float)
    nose, left_ear, right_ear = joints[..., 0, :], joints[..., 3, :], joints[..., 4, :]
    center = (left_ear + right_ear) / 2
    left = unit(left_ear - right_ear)
    ahead = nose - center
    ahead = unit(ahead - (ahead * left).sum(axis=-1, keepdims=True) * left)
    toward = np.stack([camera.center - center for camera in rig], axis=1)
    return np.arctan2((toward * left[:, None]).sum(axis=-1), (toward * ahead[:, None]).sum(axis=-1))
