"""Where points of the world appear in a camera's picture, as the renderers draw them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.camera import Camera

_ROUND_TRIP = 0.5  # pixels: a lens that folds over brings directions back that it does not image


def appear(camera: Camera, points: ArrayLike, *, near: float = 0.0) -> NDArray[np.float64]:
    """Project world points (..., 3) to pixels (..., 2); NaN where ``camera`` images nothing of them.

    That is behind the plane ``near`` metres before its centre, and beyond the angle at which the polynomial of its
    lens folds over: :meth:`Camera.project` gives such directions a second place inside of the picture.
    """
    # Row by row rather than by a matrix product: BLAS may round differently from one process to the next.
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    u, v, depth = (row[0] * x + row[1] * y + row[2] * z + row[3] for row in camera.P)
    front = depth > near
    depth = np.where(front, depth, np.nan)
    straight = np.stack([u / depth, v / depth], axis=-1)
    if not camera.distortion.any():
        return straight
    bent = camera.project(np.where(front[..., None], points, np.nan))
    with np.errstate(invalid="ignore"):
        seen = np.linalg.norm(camera.undistort(bent) - straight, axis=-1) < _ROUND_TRIP
    return np.where(seen[..., None], bent, np.nan)
