"""Compiled kernels of the light that reaches still surfaces and places in the air.

Irradiance is in the unit of :mod:`simharness.types.lighting`: under a hemisphere of radiance L it is L.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.box_tree_kernels import DEEPEST, BoxTree, trace

_SIDE = 4  # points on an area light along each side, of which shadow rays are cast
_OFF = 2e-3  # metres from a surface to the start of its rays
SKY, DARK = -1, -2  # what a ray meets: nothing; the back of a surface


class SourceArrays(NamedTuple):
    """Sources of light as the kernels take them."""

    areas: NDArray[np.float64]
    """Area lights: centre, right, up, radiance, focus, (m, 13)."""
    windows: NDArray[np.bool_]
    """Which of them are windows, (m,) bool."""
    sun: NDArray[np.float64]
    """Unit direction to the sun and its irradiance, (6,)."""


class SampledFaces(NamedTuple):
    """Faces that rays may meet, and their light samples."""

    order: NDArray[np.int64]
    """Index of the face of each triangle of the tree."""
    face_normals: NDArray[np.float32]
    """Unit normals of the faces, (k, 3)."""
    corner_samples: NDArray[np.int32]
    """See :class:`.light_samples.LightSamples`."""
    divisions: NDArray[np.int32]
    """See :class:`.light_samples.LightSamples`."""


@njit(cache=True, error_model="numpy")
def from_area(
    place: tuple[float, float, float], area: np.ndarray, tree: BoxTree, stack: np.ndarray, received: np.ndarray
) -> float:
    """Write the light of an area light at a place by direction, and return the share of the light that is not blocked.

    Args:
        place: the place.
        area: row of :attr:`SourceArrays.areas`.
        tree: what blocks light.
        stack: memory.
        received: for every point of the light the unit direction to it, and the irradiance of a surface that faces it,
            for a radiance of 1, written, (``_SIDE ** 2``, 4); 0 where something blocks it.
    """
    x, y, z = place
    ax, ay, az, bx, by, bz = area[3], area[4], area[5], area[6], area[7], area[8]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / size, ny / size, nz / size
    share = 4.0 * size / (_SIDE * _SIDE * math.pi)
    total = 0.0
    for n in range(_SIDE * _SIDE):
        i, j = n // _SIDE, n % _SIDE
        across, up = (2.0 * i + 1.0) / _SIDE - 1.0, (2.0 * j + 1.0) / _SIDE - 1.0
        dx = area[0] + across * ax + up * bx - x
        dy = area[1] + across * ay + up * by - y
        dz = area[2] + across * az + up * bz - z
        square = max(dx * dx + dy * dy + dz * dz, 1e-6)
        scale = 1.0 / math.sqrt(square)
        ahead = -(nx * dx + ny * dy + nz * dz) * scale
        value = 0.0
        if ahead > 0:
            value = share * ahead / square
            if area[12] > 0:
                value *= ahead ** area[12]
        received[n, 0], received[n, 1], received[n, 2], received[n, 3] = dx * scale, dy * scale, dz * scale, value
        total += value
    if total <= 0:
        return 0.0
    # The outer points first: if they agree, so do mostly those between them.
    seen = 0
    for n in (0, _SIDE - 1, _SIDE * (_SIDE - 1), _SIDE * _SIDE - 1):
        seen += _open_to(place, area, n, tree, stack)
    if seen == 4:
        return 1.0
    left = 0.0
    for n in range(_SIDE * _SIDE):
        if seen == 0 or not _open_to(place, area, n, tree, stack):
            received[n, 3] = 0.0
        left += received[n, 3]
    return left / total


@njit(cache=True, error_model="numpy")
def _open_to(place: tuple[float, float, float], area: np.ndarray, n: int, tree: BoxTree, stack: np.ndarray) -> bool:
    x, y, z = place
    across, up = (2.0 * (n // _SIDE) + 1.0) / _SIDE - 1.0, (2.0 * (n % _SIDE) + 1.0) / _SIDE - 1.0
    dx = area[0] + across * area[3] + up * area[6] - x
    dy = area[1] + across * area[4] + up * area[7] - y
    dz = area[2] + across * area[5] + up * area[8] - z
    return trace(tree, stack, place, (dx, dy, dz), 0.995, True)[0] < 0


@njit(cache=True, error_model="numpy")
def sunlit(place: tuple[float, float, float], sources: SourceArrays, tree: BoxTree, stack: np.ndarray) -> bool:
    """Return whether the sun shines at a place: through a window if there are any, else where nothing is in the way.

    Args:
        place: the place.
        sources: sources of light.
        tree: what blocks light.
        stack: memory.
    """
    x, y, z = place
    areas, windows, sun = sources
    for k in range(len(areas)):
        if not windows[k]:
            continue
        ax, ay, az, bx, by, bz = areas[k, 3], areas[k, 4], areas[k, 5], areas[k, 6], areas[k, 7], areas[k, 8]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        along = nx * sun[0] + ny * sun[1] + nz * sun[2]
        if along >= 0:
            continue
        cx, cy, cz = areas[k, 0] - x, areas[k, 1] - y, areas[k, 2] - z
        far = (nx * cx + ny * cy + nz * cz) / along
        if far <= 0:
            continue
        hx, hy, hz = far * sun[0] - cx, far * sun[1] - cy, far * sun[2] - cz
        right, up = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
        if abs(hx * ax + hy * ay + hz * az) > right or abs(hx * bx + hy * by + hz * bz) > up:
            continue
        if trace(tree, stack, place, (sun[0], sun[1], sun[2]), far - 0.02, True)[0] < 0:
            return True
    if windows.any():
        return False
    return trace(tree, stack, place, (sun[0], sun[1], sun[2]), 1e4, True)[0] < 0


@njit(cache=True, error_model="numpy")
def direct_light(
    places: np.ndarray, normals: np.ndarray, reach_of: np.ndarray, sources: SourceArrays, tree: BoxTree
) -> np.ndarray:
    """Return the irradiance (n, 3) of surfaces by area lights and the sun, with soft shadows.

    Args:
        places: points on surfaces, (n, 3).
        normals: their unit normals, (n, 3).
        reach_of: side of the square that each stands for, metres, (n,).
        sources: sources of light.
        tree: what blocks light.
    """
    areas, _, sun = sources
    light = np.zeros((len(places), 3), np.float32)
    received, stack = np.empty((_SIDE * _SIDE, 4)), np.empty(DEEPEST, np.int32)
    for s in range(len(places)):
        nx, ny, nz = np.float64(normals[s, 0]), np.float64(normals[s, 1]), np.float64(normals[s, 2])
        x, y, z = places[s, 0] + _OFF * nx, places[s, 1] + _OFF * ny, places[s, 2] + _OFF * nz
        for k in range(len(areas)):
            reach = 0.0
            for c in range(3):
                reach += abs(areas[k, 3 + c]) + abs(areas[k, 6 + c])
            if nx * (areas[k, 0] - x) + ny * (areas[k, 1] - y) + nz * (areas[k, 2] - z) < -reach:
                continue  # the light is behind the surface
            if from_area((x, y, z), areas[k], tree, stack, received) <= 0:
                continue
            value = 0.0
            for n in range(_SIDE * _SIDE):
                cosine = nx * received[n, 0] + ny * received[n, 1] + nz * received[n, 2]
                value += received[n, 3] * max(cosine, 0.0)
            for c in range(3):
                light[s, c] += np.float32(value * areas[k, 9 + c])
        cosine = nx * sun[0] + ny * sun[1] + nz * sun[2]
        if cosine <= 0 or sun[3] + sun[4] + sun[5] <= 0:
            continue
        # The edges of sunlight are sharper than the distances between samples: each stands for its neighbourhood.
        ux, uy, uz, vx, vy, vz = _basis(nx, ny, nz)
        hits = 0
        for n in range(_SIDE * _SIDE):
            u = reach_of[s] * ((n // _SIDE + 0.5) / _SIDE - 0.5)
            v = reach_of[s] * ((n % _SIDE + 0.5) / _SIDE - 0.5)
            hits += sunlit((x + u * ux + v * vx, y + u * uy + v * vy, z + u * uz + v * vz), sources, tree, stack)
        for c in range(3):
            light[s, c] += np.float32(cosine * sun[3 + c] * hits / (_SIDE * _SIDE))
    return light


@njit(cache=True, error_model="numpy")
def met(places: np.ndarray, normals: np.ndarray, ways: np.ndarray, tree: BoxTree, faces: SampledFaces) -> np.ndarray:
    """Return the light sample that every ray meets, or ``SKY`` or ``DARK``, (n, rays) int32.

    Args:
        places: starts, (n, 3) float64.
        normals: unit normals there, about which the directions are turned, (n, 3); zeros: they are not turned.
        ways: unit directions of the rays, for a normal along z, (rays, 3).
        tree: the triangles.
        faces: their faces.
    """
    order, face_normals, corner_samples, divisions = faces
    found, stack = np.full((len(places), len(ways)), SKY, np.int32), np.empty(DEEPEST, np.int32)
    for s in range(len(places)):
        nx, ny, nz = np.float64(normals[s, 0]), np.float64(normals[s, 1]), np.float64(normals[s, 2])
        x, y, z = places[s, 0] + _OFF * nx, places[s, 1] + _OFF * ny, places[s, 2] + _OFF * nz
        turned = nx * nx + ny * ny + nz * nz > 0.5
        ux, uy, uz, vx, vy, vz = _basis(nx, ny, nz)
        for r in range(len(ways)):
            u, v, w = ways[r, 0], ways[r, 1], ways[r, 2]
            if turned:
                dx, dy, dz = u * ux + v * vx + w * nx, u * uy + v * vy + w * ny, u * uz + v * vz + w * nz
            else:
                dx, dy, dz = u, v, w
            t, _, second, third = trace(tree, stack, (x, y, z), (dx, dy, dz), 1e4, False)
            if t < 0:
                continue
            f = order[t]
            if dx * face_normals[f, 0] + dy * face_normals[f, 1] + dz * face_normals[f, 2] > 0:
                found[s, r] = DARK
                continue
            n = divisions[f]
            if n > 1:
                i, j = int(second * n + 0.5), int(third * n + 0.5)
                i = min(i, n)
                j = min(j, n - i)
                found[s, r] = corner_samples[f, 0] + i * (n + 1) - i * (i - 1) // 2 + j
            else:
                first = 1.0 - second - third
                best = 0 if first >= max(second, third) else (1 if second >= third else 2)
                found[s, r] = corner_samples[f, best]
    return found


@njit(cache=True, error_model="numpy")
def _basis(nx: float, ny: float, nz: float) -> tuple[float, float, float, float, float, float]:
    """Return two unit vectors, perpendicular to each other and to a unit normal.

    Duff et al., "Building an orthonormal basis, revisited", Journal of Computer Graphics Techniques 6(1), 2017.
    """
    sign = 1.0 if nz >= 0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@njit(cache=True, error_model="numpy")
def gathered(found: np.ndarray, radiance: np.ndarray, sky: np.ndarray) -> np.ndarray:
    """Return the mean radiance (n, 3) that the rays of each place bring.

    Args:
        found: see :func:`met`, (n, rays).
        radiance: radiance of the light samples, (m, 3).
        sky: radiance of the sky, (3,).
    """
    light = np.zeros((len(found), 3), np.float32)
    share = np.float32(1.0 / found.shape[1])
    for s in range(len(found)):
        red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for r in range(found.shape[1]):
            k = found[s, r]
            if k >= 0:
                red, green, blue = red + radiance[k, 0], green + radiance[k, 1], blue + radiance[k, 2]
            elif k == SKY:
                red, green, blue = red + sky[0], green + sky[1], blue + sky[2]
        light[s, 0], light[s, 1], light[s, 2] = share * red, share * green, share * blue
    return light


@njit(cache=True, error_model="numpy")
def probe_light(
    places: np.ndarray,
    found: np.ndarray,
    ways: np.ndarray,
    radiance: np.ndarray,
    sky: np.ndarray,
    sources: SourceArrays,
    tree: BoxTree,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the light at places in the air.

    Args:
        places: places, (n, 3).
        found: what the rays from them meet, see :func:`met`, (n, rays).
        ways: unit directions of the rays, all around, (rays, 3).
        radiance: radiance of the light samples, (m, 3).
        sky: radiance of the sky, (3,).
        sources: sources of light.
        tree: what blocks light.

    Returns:
        Irradiance of surfaces that face +x, -x, +y, -y, +z, -z, with all light (n, 6, 3), and by area lights and the
        sun alone (n, 6, 3); share of each area light, and last of the sun, that nothing blocks (n, areas + 1).
    """
    areas, _, sun = sources
    every, straight = np.zeros((len(places), 6, 3), np.float32), np.zeros((len(places), 6, 3), np.float32)
    shares = np.zeros((len(places), len(areas) + 1), np.float32)
    received, stack = np.empty((_SIDE * _SIDE, 4)), np.empty(DEEPEST, np.int32)
    sums = np.zeros(6)
    for r in range(len(ways)):
        for axis in range(6):
            sums[axis] += max(ways[r, axis // 2] * (1.0 - 2.0 * (axis % 2)), 0.0)
    for s in range(len(places)):
        x, y, z = np.float64(places[s, 0]), np.float64(places[s, 1]), np.float64(places[s, 2])
        for k in range(len(areas)):
            shares[s, k] = from_area((x, y, z), areas[k], tree, stack, received)
            if shares[s, k] <= 0:
                continue
            for axis in range(6):
                value, sign = 0.0, 1.0 - 2.0 * (axis % 2)
                for n in range(_SIDE * _SIDE):
                    value += received[n, 3] * max(sign * received[n, axis // 2], 0.0)
                for c in range(3):
                    straight[s, axis, c] += np.float32(value * areas[k, 9 + c])
        if sun[3] + sun[4] + sun[5] > 0 and sunlit((x, y, z), sources, tree, stack):
            shares[s, len(areas)] = 1.0
            for axis in range(6):
                cosine = max(sun[axis // 2] * (1.0 - 2.0 * (axis % 2)), 0.0)
                for c in range(3):
                    straight[s, axis, c] += np.float32(cosine * sun[3 + c])
        for r in range(len(ways)):
            k = found[s, r]
            if k == DARK:
                continue
            for axis in range(6):
                cosine = max(ways[r, axis // 2] * (1.0 - 2.0 * (axis % 2)), 0.0) / sums[axis]
                if cosine <= 0:
                    continue
                for c in range(3):
                    every[s, axis, c] += np.float32(cosine * (radiance[k, c] if k >= 0 else sky[c]))
        for axis in range(6):
            for c in range(3):
                every[s, axis, c] += straight[s, axis, c]
    return every, straight, shares
