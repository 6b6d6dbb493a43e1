"""Systematic offset of a detector's joints from the anatomical ones, e.g. annotated hips above the hip joints."""

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.scenario.sections.detector_section import BiasSection
from simharness.world.rigs.projection import project_to_image

_LEFT_SHOULDER, _RIGHT_SHOULDER, _LEFT_HIP, _RIGHT_HIP = 5, 6, 11, 12
SIDE = np.array([1, *[1, -1] * 8])
"""Outward direction of each COCO-17 joint, (17,): 1 to the left (also of the nose), -1 to the right."""


def body_axes(joints: ArrayLike) -> Floats:
    """Return unit vectors forward, left and up of bodies, (..., 3, 3) as rows, from COCO-17 joints (..., 17, 3).

    Up goes from the middle of the hips to the middle of the shoulders. Left goes from the right shoulder and hip to
    the left ones, perpendicular to up.
    """
    joints = np.asarray(joints, float)
    shoulders, hips = joints[..., [_LEFT_SHOULDER, _RIGHT_SHOULDER], :], joints[..., [_LEFT_HIP, _RIGHT_HIP], :]
    up = unit(shoulders.mean(axis=-2) - hips.mean(axis=-2))
    across = shoulders[..., 0, :] - shoulders[..., 1, :] + hips[..., 0, :] - hips[..., 1, :]
    left = unit(across - (across * up).sum(axis=-1, keepdims=True) * up)
    return np.stack([np.cross(left, up), left, up], axis=-2)


def world_offsets(joints: ArrayLike, bias: BiasSection) -> Floats:
    """Return the offsets of the detector's joints from the anatomical joints (..., 17, 3), (..., 17, 3) metres."""
    in_body = np.array(bias.by_joint()) * np.stack([np.ones(17), SIDE, np.ones(17)], axis=1)
    return in_body @ body_axes(joints)


def pixel_offsets(joints: Floats, bias: BiasSection, rig: Rig) -> Floats:
    """Return the same offsets in the pictures of V cameras: joints (T, P, 17, 3) metres to (T, V, P, 17, 2) pixels.

    The cameras are those of the first frame. Where cameras drift, this is a small error of a small offset.
    """
    moved = joints + world_offsets(joints, bias)
    return np.stack([project_to_image(camera, moved) - project_to_image(camera, joints) for camera in rig], axis=1)


def unit(vector: Floats) -> Floats:
    """Return vectors (..., 3) at length 1; NaN for vectors without length."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vector / np.linalg.norm(vector, axis=-1, keepdims=True)
