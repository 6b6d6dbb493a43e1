"""Information that sightings give about joints, and the covariance of the joints that follows.

A camera that reports a joint at a pixel with standard deviation s (in x and in y) gives the information
``Jᵀ J / s²`` (3, 3), where J (2, 3) is the derivative of the pixel with respect to the joint. The information of
several cameras adds up, and the inverse of the sum is the covariance of the joint (Cramér-Rao bound of triangulation;
Hartley & Zisserman, "Multiple View Geometry", section 5.2).
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.world.rigs.projection import project_to_image

_STEP = 1e-4  # metres, of the differences by which the projection is derived
_SINGULAR = 1e-4  # reciprocal condition of a sum of information below which one direction is unknown


def information(camera: Camera, joints: Floats, deviation: Floats) -> Floats:
    """Return the information of sightings, (..., 3, 3) per square metre; zeros where nothing is seen.

    Args:
        camera: the camera.
        joints: positions (..., 3), metres.
        deviation: standard deviation of the keypoint, pixels, (...); NaN where the joint is not reported.
    """
    steps = _STEP * np.eye(3)
    ahead = project_to_image(camera, joints[..., None, :] + steps)
    behind = project_to_image(camera, joints[..., None, :] - steps)
    jacobian = (ahead - behind) / (2 * _STEP) / deviation[..., None, None]  # (..., 3, 2): its transpose
    return np.nan_to_num(jacobian @ np.swapaxes(jacobian, -1, -2))


def covariance(total: Floats) -> Floats:
    """Return the covariance of joints, (..., 3, 3) square metres, of the summed information (..., 3, 3).

    NaN where the information leaves a direction open: fewer than two rays, or rays that are nearly parallel.
    """
    values, vectors = np.linalg.eigh(total)
    known = values[..., :1] > _SINGULAR * np.maximum(values[..., -1:], 1e-12)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(known, 1.0 / values, np.nan)
    return (vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def expected_distance(covariance_: Floats) -> Floats:
    """Return the root mean square distance of joints from the truth, metres, (...)."""
    return np.sqrt(np.trace(covariance_, axis1=-2, axis2=-1))
