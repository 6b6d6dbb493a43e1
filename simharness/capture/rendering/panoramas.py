"""Pixels without a surface: the background colour of the lighting, or its panorama.

It is done once for a camera that stands still, so that NumPy is fast enough, and nothing is compiled for it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.capture.rendering import tone
from simharness.types.lighting import Lighting
from simharness.types.srgb import from_linear, to_linear

_COLUMNS = 1024  # pixels that are looked up in one row: OpenCV takes no rows of whole pictures


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
    panorama = lighting.panorama
    if panorama is None:
        rgb[empty] = np.round(255 * np.array(lighting.background)).astype(np.uint8)
        return
    row, column = np.nonzero(empty)
    if not len(row):
        return
    ways = column[:, None] * rays[:, 0] + row[:, None] * rays[:, 1] + rays[:, 2]
    if lighting.mirror is not None:
        normal = np.array(lighting.mirror.normal)
        ways -= 2 * (ways @ normal)[:, None] * normal
    light = to_linear(np.arange(256))[:, None] * np.asarray(exposure, float) * panorama.emission
    shown = np.round(from_linear(tone.tone(light))).astype(np.uint8)
    rgb[empty] = cv2.LUT(_found(panorama.picture, panorama.places(ways))[None], shown[None])[0]


def _found(picture: NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of a panorama at columns and rows (n, 2), bilinear."""
    spare = -len(places) % _COLUMNS
    column, row = np.pad(places, ((0, spare), (0, 0))).astype(np.float32).T.reshape(2, -1, _COLUMNS)
    row = np.clip(row, 0, len(picture) - 1)
    colors = np.empty((*row.shape, 3), np.uint8)
    for k in range(len(row)):
        around = cv2.remap(picture, column[k : k + 1], row[k : k + 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        colors[k] = around[0]
    return colors.reshape(-1, 3)[: len(places)]
