"""Camera layouts: from the section of a scenario to a calibrated rig."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.camera import Camera, Rig
from simharness.scenario.models import Cameras

_STEEPEST = 1e-6  # sine of the angle to the vertical below which a camera has no upright roll


def build_rig(cameras: Cameras) -> Rig:
    """Place the cameras of a scenario.

    Camera k of a ring stands at the bearing ``start + 360 k / count`` degrees, counter-clockwise from the x
    axis as seen from above; cameras are upright, have square pixels and no distortion, and look at ``aim``.

    Returns:
        The rig, its cameras named "cam0", "cam1", ...

    Raises:
        ValueError: fewer than two cameras, or an aim that a camera cannot look at upright (it stands in the
            aim, or straight above or below it).
    """
    bearings = np.radians(cameras.start + 360.0 * np.arange(cameras.count) / max(cameras.count, 1))
    centers = np.column_stack(
        [
            cameras.radius * np.cos(bearings),
            cameras.radius * np.sin(bearings),
            np.full(cameras.count, cameras.height),
        ]
    )
    K = intrinsics(cameras.fov, cameras.size)
    return Rig([look_at(c, cameras.aim, K=K, size=cameras.size, name=f"cam{k}") for k, c in enumerate(centers)])


def intrinsics(fov: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """Intrinsics (3, 3) of a lens with square pixels, its axis in the middle of the image.

    Args:
        fov: horizontal field of view, degrees, from the outer edge of the first pixel to that of the last.
        size: width and height in pixels.
    """
    width, height = size
    focal = width / (2 * math.tan(math.radians(fov) / 2))
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])


def look_at(center: ArrayLike, aim: ArrayLike, *, K: ArrayLike, size: tuple[int, int], name: str = "") -> Camera:
    """Return the upright camera at ``center`` that looks at ``aim``: image y is down, the horizon is level.

    Args:
        center: where the camera stands, (3,), metres.
        aim: the point on its optical axis, (3,), metres.
        K: intrinsics, (3, 3).
        size: width and height in pixels.
        name: the camera's name.

    Raises:
        ValueError: the camera stands in the point, or straight above or below it.
    """
    center, aim = np.asarray(center, float), np.asarray(aim, float)
    forward = aim - center
    distance = float(np.linalg.norm(forward))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) <= _STEEPEST * max(distance, 1e-9):
        raise ValueError(
            f"camera {name!r} at {center.tolist()} cannot look at {aim.tolist()} upright: the point must not "
            "lie in the camera or straight above or below it; move the aim or the camera sideways"
        )
    forward /= distance
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    return Camera(K=np.asarray(K, float), R=R, t=-R @ center, size=size, name=name)
