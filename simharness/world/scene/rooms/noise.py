"""Smooth periodic noise, of which procedural textures are made."""

from __future__ import annotations

import cv2
import numpy as np

from mvpose.arrays import Floats


def smooth_noise(rng: np.random.Generator, shape: tuple[int, int], cell: int, *, across: int | None = None) -> Floats:
    """Return smooth periodic noise of about unit amplitude, with blobs ``cell`` pixels wide and ``across`` high."""
    down = cell if across is None else across
    rows, columns = max(shape[0] // down, 1), max(shape[1] // cell, 1)
    coarse = np.pad(rng.uniform(-1, 1, (rows, columns)), 2, mode="wrap")
    scale = np.array([shape[1] / columns, shape[0] / rows])
    size = (round(scale[0] * (columns + 4)), round(scale[1] * (rows + 4)))
    fine = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    top, left = round(2 * scale[1]), round(2 * scale[0])
    return np.asarray(fine[top : top + shape[0], left : left + shape[1]], float)
