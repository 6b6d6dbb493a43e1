"""Compiled kernels of the shadows of moving bodies on still surfaces, as maps.

A shadow layer is a map at one height with the share of the light that bodies leave to surfaces that face up: of that of
lamps and the sun, or of that of the surroundings (see :mod:`simharness.capture.rendering.moving_light`).
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.moving_light import enclose, hide, light_at

BLOCK = 8  # cells along each side of a block: whole blocks without shadow are skipped

_MARGIN = 0.7  # metres around a body within which it keeps light of the surroundings from the floor
_LONGEST = 2.0  # metres: longest shadow
_AROUND = 0.35  # metres around where a shadow lies without penumbra
_FAINT = 0.06  # share of the light: a lamp that brings less casts no shadow
_STRONGEST = 4  # lamps that cast shadows of one body
_LEAST_AROUND = 0.5  # share of the light that comes from the surroundings at least: other lamps are part of them
_SEEN = 0.985  # share of the light: what is less dark cannot be seen


class ShadowLayer(NamedTuple):
    """Map at one height of the share of the light that bodies leave to surfaces that face up."""

    left: NDArray[np.float32]
    """The share, (rows, columns) float32."""
    corner: NDArray[np.float64]
    """x and y of the corner of the map, (2,)."""
    cell: float
    """Side of a cell, metres."""
    z: float
    """Height, metres."""


class UpwardLight(NamedTuple):
    """Light of a room on surfaces that face up."""

    areas: NDArray[np.float64]
    """Area lights with the luminance of their radiance: centre, right, up, luminance, focus, (m, 11)."""
    sun: NDArray[np.float64]
    """Unit direction to the sun and luminance of its irradiance, (4,)."""
    origin: NDArray[np.float64]
    """Origin of the probes, (3,)."""
    step: NDArray[np.float64]
    """Distances of the probes, (3,)."""
    every: NDArray[np.float32]
    """Luminance of all light at the probes, (nx, ny, nz, 1)."""
    shares: NDArray[np.float32]
    """Share of area lights and sun that still meshes leave, (nx, ny, nz, areas + 1)."""


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def cast(layer: ShadowLayer, bodies: np.ndarray, ranges: np.ndarray, room: UpwardLight, around_only: bool) -> None:
    """Multiply a map by the share of the light that bodies leave, in place.

    Args:
        layer: the map.
        bodies: capsules, see :func:`.moving_light.capsules`, (n, 7).
        ranges: first and end of the capsules of each body, (bodies, 2).
        room: light without the bodies.
        around_only: whether of the light that comes from the surroundings, else of that of area lights and sun.
    """
    left, corner, cell, z = layer
    areas, sun, origin, step, every, shares = room
    rows, columns = left.shape
    place, way = np.zeros((3, columns), np.float32), np.zeros((3, columns), np.float32)
    up = np.zeros((3, columns), np.float32)
    wide, far, open_ = np.zeros(columns, np.float32), np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    up[2] = 1.0
    lamps = len(areas) + 1
    share, total, strength = np.empty(lamps), np.empty(1), np.empty(lamps)
    normals, sizes = np.empty((lamps, 3)), np.empty(lamps)
    for m in range(len(areas)):
        normals[m, 0] = areas[m, 4] * areas[m, 8] - areas[m, 5] * areas[m, 7]
        normals[m, 1] = areas[m, 5] * areas[m, 6] - areas[m, 3] * areas[m, 8]
        normals[m, 2] = areas[m, 3] * areas[m, 7] - areas[m, 4] * areas[m, 6]
        sizes[m] = math.sqrt(normals[m, 0] ** 2 + normals[m, 1] ** 2 + normals[m, 2] ** 2)
        for c in range(3):
            normals[m, c] /= sizes[m]
        sizes[m] *= 4.0
    for body in range(len(ranges)):
        first, end = ranges[body, 0], ranges[body, 1]
        low_x, high_x, low_y, high_y, high = np.inf, -np.inf, np.inf, -np.inf, -np.inf
        for k in range(first, end):
            radius = bodies[k, 6]
            if radius <= 0:
                continue
            for tip in range(2):
                px, py = bodies[k, 0] + tip * bodies[k, 3], bodies[k, 1] + tip * bodies[k, 4]
                low_x, high_x = min(low_x, px - radius), max(high_x, px + radius)
                low_y, high_y = min(low_y, py - radius), max(high_y, py + radius)
                high = max(high, bodies[k, 2] + tip * bodies[k, 5] + radius)
        if not high > z:
            continue
        mid_x, mid_y = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
        light_at(origin, step, shares, mid_x, mid_y, max(z, 0.5 * high), share)
        light_at(origin, step, every, mid_x, mid_y, z + 0.05, total)
        if total[0] <= 0:
            continue
        # What each lamp brings to the middle; only the strongest cast shadows.
        straight = 0.0
        for m in range(lamps):
            strength[m] = share[m] * _brought(areas, sun, normals, sizes, m, mid_x, mid_y, z)
            straight += strength[m]
        around = max(1.0 - straight / total[0], _LEAST_AROUND)
        for _ in range(lamps - _STRONGEST):
            weakest = -1
            for m in range(lamps):
                if strength[m] > 0 and (weakest < 0 or strength[m] < strength[weakest]):
                    weakest = m
            count = 0
            for m in range(lamps):
                count += strength[m] > 0
            if count <= _STRONGEST:
                break
            strength[weakest] = 0.0
        if around_only:
            i0 = max(int((low_x - _MARGIN - corner[0]) / cell), 0)
            i1 = min(int((high_x + _MARGIN - corner[0]) / cell) + 1, columns)
            j0 = max(int((low_y - _MARGIN - corner[1]) / cell), 0)
            j1 = min(int((high_y + _MARGIN - corner[1]) / cell) + 1, rows)
            for j in range(j0, j1):
                y = corner[1] + (j + 0.5) * cell
                count = max(i1 - i0, 0)
                for n in range(count):
                    place[0, n], place[1, n], place[2, n] = corner[0] + (i0 + n + 0.5) * cell, y, z
                    open_[n] = 1.0
                for k in range(first, end):
                    if bodies[k, 6] > 0:
                        enclose(bodies[k], place, up, open_[:count])
                for n in range(count):
                    x = corner[0] + (i0 + n + 0.5) * cell
                    outside = max(low_x - x, x - high_x, low_y - y, y - high_y)
                    fade = min(max((_MARGIN - outside) / (0.5 * _MARGIN), 0.0), 1.0)
                    left[j, i0 + n] *= np.float32(1.0 - around * fade * (1.0 - open_[n]))
            continue
        for m in range(lamps):
            if strength[m] < _FAINT * total[0]:
                continue
            # The shadow lies between the body and where the lamp casts its top.
            if m < len(areas):
                rise = max(areas[m, 2] - high, 0.3)
                to_x, to_y = (mid_x - areas[m, 0]) * (high - z) / rise, (mid_y - areas[m, 1]) * (high - z) / rise
            else:
                rise = max(sun[2], 0.05)
                to_x, to_y = -sun[0] / rise * (high - z), -sun[1] / rise * (high - z)
            length = math.sqrt(to_x * to_x + to_y * to_y)
            if length > _LONGEST:
                to_x, to_y = to_x * _LONGEST / length, to_y * _LONGEST / length
            west, east = low_x + min(to_x, 0.0) - _AROUND, high_x + max(to_x, 0.0) + _AROUND
            south, north = low_y + min(to_y, 0.0) - _AROUND, high_y + max(to_y, 0.0) + _AROUND
            i0, i1 = max(int((west - corner[0]) / cell), 0), min(int((east - corner[0]) / cell) + 1, columns)
            j0, j1 = max(int((south - corner[1]) / cell), 0), min(int((north - corner[1]) / cell) + 1, rows)
            share_of_light = min(strength[m] / total[0], 0.9)
            for j in range(j0, j1):
                y = corner[1] + (j + 0.5) * cell
                count = max(i1 - i0, 0)
                for n in range(count):
                    x = corner[0] + (i0 + n + 0.5) * cell
                    if m < len(areas):
                        dx, dy, dz = areas[m, 0] - x, areas[m, 1] - y, areas[m, 2] - z
                        long = math.sqrt(dx * dx + dy * dy + dz * dz)
                        dz = max(dz, 0.05 * long)
                        dx, dy, dz = dx / long, dy / long, dz / long
                        facing = max(-(normals[m, 0] * dx + normals[m, 1] * dy + normals[m, 2] * dz), 0.05)
                        wide[n], far[n] = min(math.sqrt(sizes[m] * facing / math.pi) / long, 0.7), long
                    else:
                        dx, dy, dz = sun[0], sun[1], sun[2]
                        wide[n], far[n] = 0.03, 1e3
                    place[0, n], place[1, n], place[2, n], open_[n] = x, y, z, 1.0
                    way[0, n], way[1, n], way[2, n] = dx, dy, dz
                for k in range(first, end):
                    if bodies[k, 6] > 0:
                        hide(bodies[k], place, way, wide, far, open_[:count])
                for n in range(count):
                    # Towards the edge of the region the shadow ends gently.
                    x = corner[0] + (i0 + n + 0.5) * cell
                    edge = min(x - west, east - x, y - south, north - y)
                    fade = min(max(edge / _AROUND, 0.0), 1.0)
                    left[j, i0 + n] *= np.float32(1.0 - fade * share_of_light * (1.0 - open_[n]))


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _brought(
    areas: np.ndarray, sun: np.ndarray, normals: np.ndarray, sizes: np.ndarray, m: int, x: float, y: float, z: float
) -> float:
    """Return the luminance that lamp m brings to a surface that faces up."""
    if m == len(areas):
        return max(sun[2], 0.0) * sun[3]
    dx, dy, dz = areas[m, 0] - x, areas[m, 1] - y, max(areas[m, 2] - z, 0.0)
    square = dx * dx + dy * dy + dz * dz + 1e-6
    far = math.sqrt(square)
    ahead = max(-(normals[m, 0] * dx + normals[m, 1] * dy + normals[m, 2] * dz) / far, 0.0)
    value = areas[m, 9] * sizes[m] * ahead * (dz / far) / (math.pi * square)
    return value * ahead ** areas[m, 10] if areas[m, 10] > 0 else value


def touched_blocks(fine: NDArray[np.float32], coarse: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which blocks of a map are dark anywhere, (rows, columns) bool.

    Args:
        fine: map of the floor, in cells of whole blocks.
        coarse: maps at several heights, in cells twice as large, (heights, rows / 2, columns / 2), first the floor's.
    """
    rows, columns = fine.shape[0] // BLOCK, fine.shape[1] // BLOCK
    on_floor = fine.reshape(rows, BLOCK, columns, BLOCK).min(axis=(1, 3))
    above = coarse[1:].reshape(-1, rows, BLOCK // 2, columns, BLOCK // 2).min(axis=(0, 2, 4))
    return np.minimum(on_floor, above) < _SEEN
