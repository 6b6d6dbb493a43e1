"""Lenses of simulated cameras: intrinsics from a field of view, and validity of a distortion polynomial."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.world.rigs.projection import undistorted

_SAMPLES = 33  # samples of a picture in each direction, edges included


def intrinsics(fov: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the intrinsics (3, 3) of a lens with square pixels and its axis in the middle of the image.

    Args:
        fov: horizontal field of view before distortion, degrees, from the outer edge of the first pixel to the outer
            edge of the last.
        size: width and height in pixels.
    """
    width, height = size
    focal = width / (2 * math.tan(math.radians(fov) / 2))
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])


def check_lens(camera: Camera) -> None:
    """Check that every point of the picture images exactly one direction.

    Brown's polynomial folds over beyond some angle, and a barrel lens images nothing beyond it.

    Raises:
        ValueError: the picture extends beyond the fold.
    """
    if not camera.distortion.any():
        return
    width, height = camera.size
    u, v = np.meshgrid(np.linspace(-0.5, width - 0.5, _SAMPLES), np.linspace(-0.5, height - 0.5, _SAMPLES))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    folded = ~np.isfinite(undistorted(camera, pixels)).all(axis=1)
    if folded.any():
        radius = np.linalg.norm(pixels - camera.K[:2, 2], axis=1)
        terms = ", ".join(f"{term:g}" for term in camera.distortion)
        raise ValueError(
            f"camera {camera.name!r}: its lens, k1 k2 p1 p2 k3 = {terms}, folds over {radius[folded].min():.0f} pixels "
            f"from its axis, inside the picture, which extends to {radius.max():.0f} pixels; expected one direction "
            "for every pixel: use smaller terms or a narrower field of view, or calibrate with points in the corners"
        )
