"""Compiled kernels of pixels in the shadows of moving bodies: still surfaces are darkened where they lie.

The map of the floor is divided into blocks; pixels over blocks in which nothing is dark are left as they are.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.surface_kernels import DrawnPixels, PixelRays

_ZERO, _UNIT, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
HEIGHTS = np.array([0.0, 0.5, 1.1, 1.9], np.float32)
"""Heights of the maps above the floor, metres; nothing is shaded above the last."""

_TOP = float(HEIGHTS[-1])
_FLOOR = np.float32(0.02)  # metres: what is lower is the floor


class ShadowLayers(NamedTuple):
    """Share of the light that moving bodies leave to still surfaces that face up."""

    corner: NDArray[np.float64]
    """x and y of the corner of the maps, (2,)."""
    cell: float
    """Size of a cell of ``fine``; a cell of ``coarse`` is twice as large."""
    fine: NDArray[np.float32]
    """Share on the floor, (rows, columns) float32."""
    coarse: NDArray[np.float32]
    """Share at several heights, (heights, rows / 2, columns / 2) float32."""
    heights: NDArray[np.float32]
    """These heights, (heights,) float32."""
    touched: NDArray[np.bool_]
    """Blocks of ``BLOCK`` x ``BLOCK`` cells of ``fine`` in which anything is dark, (rows, columns)."""


@njit(cache=True, error_model="numpy")
def blocks_below(
    triangle: np.ndarray,
    inverse_depth: np.ndarray,
    view: PixelRays,
    corner: np.ndarray,
    side: float,
    shape: tuple[int, int],
) -> np.ndarray:
    """Return over which block of a map of the floor each pixel of still meshes lies, (h, w); rows * columns for none.

    Args:
        triangle: visible faces of the still meshes, (h, w); -1 for none.
        inverse_depth: their inverse depths, (h, w).
        view: rays of the pixels.
        corner: x and y of the corner of the map, (2,).
        side: side of a block, metres.
        shape: rows and columns of blocks.
    """
    center, rays = view
    blocks = np.full(triangle.shape, shape[0] * shape[1], np.uint16)
    for y in range(triangle.shape[0]):
        for x in range(triangle.shape[1]):
            away = 1.0 / np.float64(inverse_depth[y, x])
            if triangle[y, x] < 0 or not center[2] + away * (rays[2, 0] * x + rays[2, 1] * y + rays[2, 2]) <= _TOP:
                continue
            place, inside = 0, True
            for axis, count in ((1, shape[0]), (0, shape[1])):
                at = center[axis] + away * (rays[axis, 0] * x + rays[axis, 1] * y + rays[axis, 2])
                block = (at - corner[axis]) / side
                # The walls lie on the border of the map.
                block = np.floor(block - 1e-3 if block > 0.5 * count else block + 1e-3)
                inside = inside and 0 <= block < count
                place = place * count + int(block) if inside else 0
            if inside:
                blocks[y, x] = place
    return blocks


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def dim(
    drawn: DrawnPixels, blocks: np.ndarray, view: PixelRays, layers: ShadowLayers, dimming: np.ndarray, rgb: np.ndarray
) -> None:
    """Darken the pixels of still meshes that moving ones shade, in place.

    Args:
        drawn: what the pixels show.
        blocks: blocks of the map over which the pixels of still meshes lie, see :func:`blocks_below`.
        view: rays of the pixels.
        layers: the shadows.
        dimming: see :func:`.tone.dimming`.
        rgb: picture to change, (h, w, 3) uint8.
    """
    center, rays = view
    origin, cell, fine, coarse, heights, touched = layers
    dark = np.append(touched.ravel(), False)
    steps = np.float32(len(dimming) - 1)
    per_cell, levels = np.float32(1.0 / cell), len(heights)
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    from_x, from_y = np.float32(center[0] - origin[0]), np.float32(center[1] - origin[1])
    from_z = np.float32(center[2])
    for y in range(rgb.shape[0]):
        ray_x, ray_y = np.float32(rays[0, 1] * y + rays[0, 2]), np.float32(rays[1, 1] * y + rays[1, 2])
        ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
        for x in range(rgb.shape[1]):
            if not dark[blocks[y, x]]:
                continue
            far, place = _UNIT / drawn.inverse_depth[y, x], np.float32(x)
            u = (from_x + far * (rise_x * place + ray_x)) * per_cell
            v = (from_y + far * (rise_y * place + ray_y)) * per_cell
            z = from_z + far * (rise_z * place + ray_z)
            if z < _FLOOR:
                left = _between(fine, u - _HALF, v - _HALF)
            else:
                level = 0
                while level < levels - 2 and z > heights[level + 1]:
                    level += 1
                share = (z - heights[level]) / (heights[level + 1] - heights[level])
                share = min(max(share, _ZERO), _UNIT)
                u, v = _HALF * u - _HALF, _HALF * v - _HALF
                left = _between(coarse[level], u, v)
                left += share * (_between(coarse[level + 1], u, v) - left)
            shade = dimming[np.int32(left * steps + _HALF)]
            for k in range(3):
                rgb[y, x, k] = shade[rgb[y, x, k]]


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"}, inline="always")
def _between(grid: np.ndarray, u: np.float32, v: np.float32) -> np.float32:
    """Return the value of a grid at column u and row v, by bilinear interpolation."""
    u, v = min(max(u, _ZERO), np.float32(grid.shape[1] - 1.001)), min(max(v, _ZERO), np.float32(grid.shape[0] - 1.001))
    i, j = np.uint32(np.int32(u)), np.uint32(np.int32(v))
    u, v = u - np.float32(i), v - np.float32(j)
    below = j + np.uint32(1)
    one, two = grid[j, i], grid[below, i]
    one += u * (grid[j, i + np.uint32(1)] - one)
    two += u * (grid[below, i + np.uint32(1)] - two)
    return one + v * (two - one)
