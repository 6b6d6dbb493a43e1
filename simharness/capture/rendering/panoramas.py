"""Pixels without a surface: the background colour of the lighting, or its panorama."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.kernels import njit
from simharness.capture.rendering import tone
from simharness.capture.srgb import from_linear, to_linear
from simharness.types.lighting import Lighting


def fill_empty(
    rgb: NDArray[np.uint8],
    empty: NDArray[np.bool_],
    lighting: Lighting,
    rays: NDArray[np.float64],
    exposure: ArrayLike = (1.0, 1.0, 1.0),
) -> None:
    """Colour the pixels of a picture that show no surface, in place.

    Args:
        rgb: picture to change, (h, w, 3) uint8.
        empty: pixels without a surface, (h, w).
        lighting: lighting of the scene.
        rays: matrix (3, 3) that turns pixels (x, y, 1) into directions.
        exposure: factor of the radiance of the panorama.
    """
    if lighting.panorama is None:
        rgb[empty] = np.round(255 * np.array(lighting.background)).astype(np.uint8)
        return
    if not empty.any():
        return
    panorama, normal = lighting.panorama, np.zeros(3)
    if lighting.mirror is not None:
        normal[:] = lighting.mirror.normal
    light = to_linear(np.arange(256))[:, None] * np.asarray(exposure, float) * panorama.emission
    shown = from_linear(tone.tone(light))
    _fill(rgb, empty, rays, normal, panorama.picture, panorama.lowest, shown)


@njit(cache=True)
def _fill(
    rgb: np.ndarray,
    empty: np.ndarray,
    rays: np.ndarray,
    normal: np.ndarray,
    picture: np.ndarray,
    lowest: float,
    shown: np.ndarray,
) -> None:
    """Show the panorama at empty pixels, bilinear; directions are reflected at a plane with a normal, zeros for none.

    ``shown`` are the values that pictures show for the 256 values of each channel of the panorama, (256, 3).
    """
    rows, columns = picture.shape[:2]
    across, down = columns / (2 * math.pi), rows / (math.pi / 2 - lowest)
    for v in range(empty.shape[0]):
        for u in range(empty.shape[1]):
            if not empty[v, u]:
                continue
            x = rays[0, 0] * u + rays[0, 1] * v + rays[0, 2]
            y = rays[1, 0] * u + rays[1, 1] * v + rays[1, 2]
            z = rays[2, 0] * u + rays[2, 1] * v + rays[2, 2]
            behind = 2.0 * (x * normal[0] + y * normal[1] + z * normal[2])
            x, y, z = x - behind * normal[0], y - behind * normal[1], z - behind * normal[2]
            column = (math.atan2(y, x) + math.pi) * across - 0.5
            row = (math.pi / 2 - math.atan2(z, math.sqrt(x * x + y * y))) * down - 0.5
            row = min(max(row, 0.0), rows - 1.0)
            left, top = math.floor(column), min(int(row), rows - 2)
            a, b = column - left, row - top
            left, right = left % columns, (left + 1) % columns
            for c in range(3):
                high = (1 - a) * shown[picture[top, left, c], c] + a * shown[picture[top, right, c], c]
                low = (1 - a) * shown[picture[top + 1, left, c], c] + a * shown[picture[top + 1, right, c], c]
                rgb[v, u, c] = int((1 - b) * high + b * low + 0.5)
