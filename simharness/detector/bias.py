"""Where a detector's joints are beside anatomy's: a hip that annotators click is not the centre of the hip joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.scenario.sections.detector import Bias

_LEFT_SHOULDER, _RIGHT_SHOULDER, _LEFT_HIP, _RIGHT_HIP = 5, 6, 11, 12
SIDE = np.array([1, *[1, -1] * 8])
"""Which way outward is for each of COCO-17, (17,): 1 to the left (the nose too), -1 to the right."""


def body_axes(joints: ArrayLike) -> Floats:
    """Unit vectors forward, left and up of bodies, (..., 3, 3) as rows, from COCO-17 joints (..., 17, 3).

    Up goes from the middle of the hips to the middle of the shoulders, left from the right shoulder and hip to the
    left ones, at right angles to it.
    """
    joints = np.asarray(joints, float)
    shoulders, hips = joints[..., [_LEFT_SHOULDER, _RIGHT_SHOULDER], :], joints[..., [_LEFT_HIP, _RIGHT_HIP], :]
    up = _unit(shoulders.mean(axis=-2) - hips.mean(axis=-2))
    across = shoulders[..., 0, :] - shoulders[..., 1, :] + hips[..., 0, :] - hips[..., 1, :]
    left = _unit(across - (across * up).sum(axis=-1, keepdims=True) * up)
    return np.stack([np.cross(left, up), left, up], axis=-2)


def offsets(joints: ArrayLike, bias: Bias) -> Floats:
    """How far the detector's joints are from anatomy's (..., 17, 3) in the world, (..., 17, 3) metres."""
    own = np.array(bias.by_joint()) * np.stack([np.ones(17), SIDE, np.ones(17)], axis=1)
    return own @ body_axes(joints)


def shifts(joints: Floats, bias: Bias, rig: Rig) -> Floats:
    """The same in the pictures of V cameras: (T, P, 17, 3) metres to (T, V, P, 17, 2) pixels.

    Through the cameras as they hang at the beginning: where they drift, a small error of a small offset.
    """
    moved = joints + offsets(joints, bias)
    return np.stack([camera.project(moved) - camera.project(joints) for camera in rig], axis=1)


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)
