"""Compiled kernels of pixels in the shadows of moving bodies: still surfaces are darkened where they lie.

The map of the floor is divided into blocks. Which pixels of a camera lie over which block does not change: they are
kept as runs along the rows, and pictures look at those over blocks in which anything is dark.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.surface_kernels import PixelRays

_ZERO, _UNIT, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_FLOOR = np.float32(0.02)  # metres: what is lower is the floor
_PIXELS = 128  # processed together
# Rows of memory, which the compiler knows to be apart.
_U, _V, _Z, _LEFT, _ONE, _TWO, _THREE, _FOUR, _MEMORY = (_PIXELS * row for row in range(9))


class BlockGrid(NamedTuple):
    """Blocks of a map of the floor."""

    corner: NDArray[np.float64]
    """x and y of the corner of the map, (2,)."""
    side: float
    """Side of a block, metres."""
    rows: int
    """Number of blocks along y."""
    columns: int
    """Number of blocks along x."""


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
    """Blocks in which anything is dark, (blocks + 1,)."""


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def runs_below(
    triangle: np.ndarray, inverse_depth: np.ndarray, view: PixelRays, grid: BlockGrid, highest: float
) -> np.ndarray:
    """Return runs of pixels over the same block of a map of the floor, (n, 5) int32.

    A run is a row of the picture, its first and its end column, the block, and whether the pixels show the floor.

    Args:
        triangle: visible face or -1, (h, w) int32.
        inverse_depth: inverse depth, 1/m, (h, w) float32.
        view: rays of the pixels.
        grid: blocks of the map.
        highest: height above which nothing is shaded, metres.
    """
    center, rays = view
    origin, block, rows, columns = grid
    height, width = triangle.shape
    runs, count = np.empty((max(height * width // 8, 1), 5), np.int32), 0
    rise_z, from_z = np.float32(rays[2, 0]), np.float32(center[2])
    for y in range(height):
        last, was_floor, ray_z = -1, 0, np.float32(rays[2, 1] * y + rays[2, 2])
        for x in range(width):
            place, is_floor = -1, 0
            if triangle[y, x] >= 0:
                far = 1.0 / inverse_depth[y, x]
                u = (center[0] + far * (rays[0, 0] * x + rays[0, 1] * y + rays[0, 2]) - origin[0]) / block
                v = (center[1] + far * (rays[1, 0] * x + rays[1, 1] * y + rays[1, 2]) - origin[1]) / block
                # The walls lie on the border of the map.
                i = math.floor(u - 1e-3 if u > 0.5 * columns else u + 1e-3)
                j = math.floor(v - 1e-3 if v > 0.5 * rows else v + 1e-3)
                low = center[2] + far * (rays[2, 0] * x + rays[2, 1] * y + rays[2, 2]) <= highest
                if low and 0 <= i < columns and 0 <= j < rows:
                    place = int(j) * columns + int(i)
                    z = from_z + (_UNIT / inverse_depth[y, x]) * (rise_z * np.float32(x) + ray_z)
                    is_floor = int(z < _FLOOR)
            if place >= 0 and place == last and is_floor == was_floor:
                runs[count - 1, 2] = x + 1
            elif place >= 0:
                if count == len(runs):
                    runs = np.concatenate((runs, np.empty_like(runs)))
                runs[count, 0], runs[count, 1], runs[count, 2], runs[count, 3] = y, x, x + 1, place
                runs[count, 4] = is_floor
                count += 1
            last, was_floor = place, is_floor
    return runs[:count].copy()


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def dim(
    inverse_depth: np.ndarray,
    runs: np.ndarray,
    view: PixelRays,
    layers: ShadowLayers,
    dimming: np.ndarray,
    rgb: np.ndarray,
) -> None:
    """Darken the pixels of still meshes that moving ones shade, in place.

    Args:
        inverse_depth: inverse depth of still meshes, 1/m, (h, w) float32.
        runs: runs of pixels over the blocks of the map, see :func:`runs_below`.
        view: rays of the pixels.
        layers: the shadows.
        dimming: see :func:`.tone.dimming`.
        rgb: picture to change, (h, w, 3) uint8.
    """
    center, rays = view
    origin, cell, fine, coarse, heights, touched = layers
    steps = np.float32(len(dimming) - 1)
    per_cell, levels = np.float32(1.0 / cell), len(heights)
    rise_x, rise_y, rise_z = np.float32(rays[0, 0]), np.float32(rays[1, 0]), np.float32(rays[2, 0])
    from_x, from_y = np.float32(center[0] - origin[0]), np.float32(center[1] - origin[1])
    from_z = np.float32(center[2])
    work, near, whole, k = np.zeros(_MEMORY, np.float32), np.ones(_PIXELS, np.float32), np.zeros(_PIXELS, np.int32), 0
    floor, colors, shades = fine.reshape(-1), rgb.reshape(-1), dimming.reshape(-1)
    rows, columns, width = np.int32(fine.shape[0]), np.int32(fine.shape[1]), rgb.shape[1]
    while k < len(runs):
        y, begin, end, on_floor = runs[k, 0], runs[k, 1], runs[k, 2], runs[k, 4]
        dark = touched[runs[k, 3]]
        k += 1
        if not dark:
            continue
        while (
            k < len(runs) and runs[k, 0] == y and runs[k, 1] == end and runs[k, 4] == on_floor and touched[runs[k, 3]]
        ):
            end = runs[k, 2]
            k += 1
        ray_x, ray_y = np.float32(rays[0, 1] * y + rays[0, 2]), np.float32(rays[1, 1] * y + rays[1, 2])
        ray_z = np.float32(rays[2, 1] * y + rays[2, 2])
        for start in range(begin, end, _PIXELS):
            size = min(end - start, _PIXELS)
            for n in range(size):
                near[n] = inverse_depth[y, start + n]
            for n in range(_PIXELS):
                far, column = _UNIT / near[n], np.float32(start + n)
                work[_U + n] = (from_x + far * (rise_x * column + ray_x)) * per_cell
                work[_V + n] = (from_y + far * (rise_y * column + ray_y)) * per_cell
                work[_Z + n] = from_z + far * (rise_z * column + ray_z)
            if on_floor:
                _left_on_floor(floor, rows, columns, size, work, whole)
            else:
                for n in range(size):
                    z, level = work[_Z + n], 0
                    while level < levels - 2 and z > heights[level + 1]:
                        level += 1
                    share = (z - heights[level]) / (heights[level + 1] - heights[level])
                    share = min(max(share, _ZERO), _UNIT)
                    u, v = _HALF * work[_U + n] - _HALF, _HALF * work[_V + n] - _HALF
                    left = _between(coarse[level], u, v)
                    work[_LEFT + n] = left + share * (_between(coarse[level + 1], u, v) - left)
            for n in range(_PIXELS):
                whole[n] = np.int32(work[_LEFT + n] * steps + _HALF)
            pixels = colors[3 * (y * width + start) : 3 * (y * width + start + size)]
            for n in range(size):
                row, red = np.uint32(whole[n]) << np.uint32(8), np.uint32(3 * n)
                green, blue = red + np.uint32(1), red + np.uint32(2)
                pixels[red] = shades[row | np.uint32(pixels[red])]
                pixels[green] = shades[row | np.uint32(pixels[green])]
                pixels[blue] = shades[row | np.uint32(pixels[blue])]


@njit(cache=True, borrows=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _left_on_floor(
    floor: np.ndarray, rows: np.int32, columns: np.int32, size: int, work: np.ndarray, cells: np.ndarray
) -> None:
    """Write the share of the light that is left on the floor, by bilinear interpolation, as :func:`_between`.

    Args:
        floor: map of the floor, (rows * columns,).
        rows: its rows.
        columns: its columns.
        size: number of pixels.
        work: rows of memory; columns and rows of places on the map in units of cells are read, and overwritten.
        cells: memory for one index of each pixel.
    """
    right, bottom = np.float32(columns - 1.001), np.float32(rows - 1.001)
    for n in range(_PIXELS):
        u = min(max(work[_U + n] - _HALF, _ZERO), right)
        v = min(max(work[_V + n] - _HALF, _ZERO), bottom)
        i, j = np.int32(u), np.int32(v)
        cells[n] = j * columns + i
        work[_U + n], work[_V + n] = u - np.float32(i), v - np.float32(j)
    for n in range(size):
        at, below = np.uint32(cells[n]), np.uint32(cells[n] + columns)
        work[_ONE + n], work[_TWO + n] = floor[at], floor[at + np.uint32(1)]
        work[_THREE + n], work[_FOUR + n] = floor[below], floor[below + np.uint32(1)]
    for n in range(_PIXELS):
        u, one, two = work[_U + n], work[_ONE + n], work[_THREE + n]
        one += u * (work[_TWO + n] - one)
        two += u * (work[_FOUR + n] - two)
        work[_LEFT + n] = one + work[_V + n] * (two - one)


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
