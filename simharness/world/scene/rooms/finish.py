"""Surface finish of a floor or a wall, and what drawing one needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats

FLOOR_RESOLUTION = 192  # pixels per metre
WALL_RESOLUTION = 160
SKIRTING = 0.1  # metres: height of the skirting board


@dataclass(frozen=True)
class Finish:
    """Surface finish: a texture (h, w, 3) uint8, sRGB, of a patch with width and height ``size``, metres."""

    texture: NDArray[np.uint8]
    size: tuple[float, float]


def wall_shape(width: float, height: float) -> tuple[int, int]:
    """Return rows and columns of the picture of a wall with a width and height in metres."""
    return max(round(height * WALL_RESOLUTION), 1), round(width * WALL_RESOLUTION)


def skirted(picture: Floats, tint: Floats | None = None) -> Finish:
    """Add a skirting board along the floor and return the finish."""
    board = min(round(SKIRTING * WALL_RESOLUTION), len(picture) // 2)
    picture[-board:] = (0.56, 0.54, 0.52) if tint is None else tint
    picture[-board : -board + 2] *= 1.15
    return finish(picture, WALL_RESOLUTION)


def finish(picture: Floats, resolution: int) -> Finish:
    """Return the finish of a picture (h, w, 3) with values from 0 to 1."""
    texture = np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)
    return Finish(texture, (texture.shape[1] / resolution, texture.shape[0] / resolution))


def to_edge(length: int, cell: int) -> NDArray[np.int_]:
    """Return the distance of every pixel to the nearest border between cells."""
    at = np.arange(length) % cell
    return np.minimum(at, cell - 1 - at)


def checks(side: int, half: int) -> NDArray[np.bool_]:
    """Return the squares of a chessboard, (side, side)."""
    i, j = np.meshgrid(np.arange(side) // half, np.arange(side) // half, indexing="ij")
    return np.asarray((i + j) % 2 == 0)
