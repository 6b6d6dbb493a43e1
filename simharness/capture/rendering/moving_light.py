"""Compiled kernels of the light on moving bodies: that of the room, less what bodies keep from each other.

The light of the room is known at probes in the air. Bodies are capsules, one for each part. A lamp, as seen from a
place, is a disc in the sky with an angular radius; a capsule hides of it what overlaps the disc. Of the light from all
around it hides about its form factor, the share of a sphere at its nearest point (Quilez, "Sphere ambient occlusion"
and "Capsule ambient occlusion", 2006 and 2013).
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.types.srgb import LUMINANCE

_CHUNK = 512  # samples processed together
_LEVELS = 6  # heights at which the light of the room is taken for a body
_RED, _GREEN, _BLUE = LUMINANCE
_LARGEST = 0.6  # metres: a part with a larger radius is no body
_NONE, _ONE, _TWO, _THREE, _TINY = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(3.0), np.float32(1e-6)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def light_at(
    origin: np.ndarray, step: np.ndarray, values: np.ndarray, x: float, y: float, z: float, out: np.ndarray
) -> None:
    """Write the values (c,) of a grid (nx, ny, nz, c) at a place, by trilinear interpolation; at its border outside."""
    out[:] = 0.0
    u = min(max((x - origin[0]) / step[0], 0.0), values.shape[0] - 1.001)
    v = min(max((y - origin[1]) / step[1], 0.0), values.shape[1] - 1.001)
    w = min(max((z - origin[2]) / step[2], 0.0), values.shape[2] - 1.001)
    i, j, k = int(u), int(v), int(w)
    u, v, w = u - i, v - j, w - k
    for n in range(8):
        di, dj, dk = n & 1, (n >> 1) & 1, n >> 2
        weight = (u if di else 1.0 - u) * (v if dj else 1.0 - v) * (w if dk else 1.0 - w)
        if weight <= 0:
            continue
        for c in range(len(out)):
            out[c] += weight * values[i + di, j + dj, k + dk, c]


class MovingMeshes(NamedTuple):
    """Moving meshes of a scene at a time."""

    vertices: NDArray[np.float32]
    """Vertices, (v, 3)."""
    face_normals: NDArray[np.float32]
    """Unit normals of the faces, (k, 3)."""
    vertex_normals: NDArray[np.float32]
    """Unit normals of the vertices, (v, 3)."""


class AirLight(NamedTuple):
    """Light at the nodes of a grid in the air."""

    origin: NDArray[np.float64]
    """Position of the first node, (3,)."""
    step: NDArray[np.float64]
    """Distances between nodes, (3,)."""
    every: NDArray[np.float32]
    """Light of all sources by the six directions, (nx, ny, nz, 18)."""
    straight: NDArray[np.float32]
    """Luminance of what comes straight from area lights and sun, (nx, ny, nz, 6)."""


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def moving_light(
    meshes: MovingMeshes,
    samples: tuple[np.ndarray, np.ndarray, np.ndarray],
    bodies: np.ndarray,
    ranges: np.ndarray,
    air: AirLight,
) -> np.ndarray:
    """Return the irradiance (n, 3) at the light samples of moving meshes.

    The light of the room is taken along the axis of each mesh, upright through its middle; what the mesh itself and
    others nearby keep from it, at every sample.

    Args:
        meshes: the meshes.
        samples: vertex of each sample, (n,); face whose normal a sample has, or -1 for that of its vertex, (n,); first
            and end of the samples of each mesh, (meshes, 2).
        bodies: capsules, see :func:`capsules`, (c, 7).
        ranges: first and end of the capsules of each mesh, (meshes, 2).
        air: light of the room.
    """
    vertices, face_normals, vertex_normals = meshes
    of_vertex, of_face, spans = samples
    origin, step, every, straight = air
    light = np.zeros((len(of_vertex), 3), np.float32)
    column, direct = np.empty((_LEVELS, 18)), np.empty((_LEVELS, 6))
    ways = np.empty((_LEVELS, 4))
    place, normal = np.empty((3, _CHUNK), np.float32), np.empty((3, _CHUNK), np.float32)
    way, wide, far = np.empty((3, _CHUNK), np.float32), np.empty(_CHUNK, np.float32), np.empty(_CHUNK, np.float32)
    seen, around = np.empty(_CHUNK, np.float32), np.empty(_CHUNK, np.float32)
    for mesh in range(len(spans)):
        first, end = spans[mesh, 0], spans[mesh, 1]
        if first == end:
            continue
        low = np.full(3, np.inf)
        high = np.full(3, -np.inf)
        for s in range(first, end):
            for c in range(3):
                value = np.float64(vertices[of_vertex[s], c])
                low[c], high[c] = min(low[c], value), max(high[c], value)
        mid_x, mid_y = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
        rise = max(high[2] - low[2], 1e-3) / (_LEVELS - 1)
        for n in range(_LEVELS):
            z = low[2] + n * rise
            light_at(origin, step, every, mid_x, mid_y, z, column[n])
            light_at(origin, step, straight, mid_x, mid_y, z, direct[n])
            # Direction and spread of the direct light: sources all around cancel.
            dx, dy, dz = direct[n, 0] - direct[n, 1], direct[n, 2] - direct[n, 3], direct[n, 4] - direct[n, 5]
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            whole = 1e-6
            for axis in range(6):
                whole += direct[n, axis]
            if length > 1e-6:
                ways[n, 0], ways[n, 1], ways[n, 2] = dx / length, dy / length, dz / length
            else:
                ways[n, 0], ways[n, 1], ways[n, 2] = 0.0, 0.0, 1.0
            ways[n, 3] = min(max(0.9 - 0.8 * length / whole, 0.15), 0.7)
        # The capsules of this body and of others that are near.
        near, count = np.empty(len(bodies), np.int64), 0
        for k in range(len(bodies)):
            radius = bodies[k, 6]
            own = ranges[mesh, 0] <= k < ranges[mesh, 1]
            if radius <= 0:
                continue
            px, py = bodies[k, 0] + 0.5 * bodies[k, 3], bodies[k, 1] + 0.5 * bodies[k, 4]
            if own or max(low[0] - px, px - high[0], low[1] - py, py - high[1]) < 0.6:
                near[count] = k
                count += 1
        for start in range(first, end, _CHUNK):
            size = min(end - start, _CHUNK)
            for s in range(size):
                i, f = of_vertex[start + s], of_face[start + s]
                place[0, s], place[1, s], place[2, s] = vertices[i, 0], vertices[i, 1], vertices[i, 2]
                for c in range(3):
                    normal[c, s] = vertex_normals[i, c] if f < 0 else face_normals[f, c]
                at = (np.float64(place[2, s]) - low[2]) / rise
                n = min(int(at), _LEVELS - 2)
                at -= n
                lx, ly = (1.0 - at) * ways[n, 0] + at * ways[n + 1, 0], (1.0 - at) * ways[n, 1] + at * ways[n + 1, 1]
                lz = (1.0 - at) * ways[n, 2] + at * ways[n + 1, 2]
                length = 1.0 / math.sqrt(lx * lx + ly * ly + lz * lz + 1e-12)
                way[0, s], way[1, s], way[2, s] = length * lx, length * ly, length * lz
                wide[s] = (1.0 - at) * ways[n, 3] + at * ways[n + 1, 3]
                far[s], seen[s], around[s] = 3.0, 1.0, 1.0
            for c in range(count):
                enclose(bodies[near[c]], place, normal, around[:size])
                hide(bodies[near[c]], place, way, wide, far, seen[:size])
            for s in range(size):
                nx, ny, nz = normal[0, s], normal[1, s], normal[2, s]
                at = (np.float64(place[2, s]) - low[2]) / rise
                n = min(int(at), _LEVELS - 2)
                at -= n
                one, two, three = (0 if nx >= 0 else 1), (2 if ny >= 0 else 3), (4 if nz >= 0 else 5)
                xx, yy, zz = nx * nx, ny * ny, nz * nz
                part = (1.0 - at) * (xx * direct[n, one] + yy * direct[n, two] + zz * direct[n, three])
                part += at * (xx * direct[n + 1, one] + yy * direct[n + 1, two] + zz * direct[n + 1, three])
                whole = 1e-9
                for c in range(3):
                    i, j, k = 3 * one + c, 3 * two + c, 3 * three + c
                    value = (1.0 - at) * (xx * column[n, i] + yy * column[n, j] + zz * column[n, k])
                    value += at * (xx * column[n + 1, i] + yy * column[n + 1, j] + zz * column[n + 1, k])
                    light[start + s, c] = value
                    whole += value * (_RED if c == 0 else (_GREEN if c == 1 else _BLUE))
                share = min(part / whole, 1.0)
                factor = np.float32(share * seen[s] + (1.0 - share) * around[s])
                for c in range(3):
                    light[start + s, c] *= factor
    return light


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def capsules(vertices: np.ndarray, group: np.ndarray, count: int) -> np.ndarray:
    """Return the capsules around groups of vertices: start, way to the end, radius, (count, 7); radius 0 for none.

    The vertices are taken for samples of a cylinder: along its axis they scatter with a third of half the length, in
    squares, and across with half the radius, in squares.

    Args:
        vertices: positions, (n, 3).
        group: group of each vertex, -1 for none, (n,).
        count: number of groups.
    """
    sums, result = np.zeros((count, 10)), np.zeros((count, 7), np.float32)
    for i in range(len(vertices)):
        g = group[i]
        if g < 0:
            continue
        x, y, z = np.float64(vertices[i, 0]), np.float64(vertices[i, 1]), np.float64(vertices[i, 2])
        row = sums[g]
        row[0], row[1], row[2], row[3] = row[0] + 1.0, row[1] + x, row[2] + y, row[3] + z
        row[4], row[5], row[6] = row[4] + x * x, row[5] + x * y, row[6] + x * z
        row[7], row[8], row[9] = row[7] + y * y, row[8] + y * z, row[9] + z * z
    for g in range(count):
        n = sums[g, 0]
        if n < 4:
            continue
        x, y, z = sums[g, 1] / n, sums[g, 2] / n, sums[g, 3] / n
        xx, xy, xz = sums[g, 4] / n - x * x, sums[g, 5] / n - x * y, sums[g, 6] / n - x * z
        yy, yz, zz = sums[g, 7] / n - y * y, sums[g, 8] / n - y * z, sums[g, 9] / n - z * z
        ax, ay, az, most = 0.37, 0.29, 0.88, 0.0
        for _ in range(16):  # power iteration: the longest axis
            bx, by, bz = xx * ax + xy * ay + xz * az, xy * ax + yy * ay + yz * az, xz * ax + yz * ay + zz * az
            most = math.sqrt(bx * bx + by * by + bz * bz)
            if most < 1e-12:
                break
            ax, ay, az = bx / most, by / most, bz / most
        radius = math.sqrt(max(xx + yy + zz - most, 0.0))
        if most < 1e-12 or radius > _LARGEST or radius < 1e-3:
            continue
        half = max(math.sqrt(3.0 * most) - radius, 0.0)
        result[g, 0], result[g, 1], result[g, 2] = x - half * ax, y - half * ay, z - half * az
        result[g, 3], result[g, 4], result[g, 5] = 2 * half * ax, 2 * half * ay, 2 * half * az
        result[g, 6] = radius
    return result


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def hide(
    body: np.ndarray, place: np.ndarray, way: np.ndarray, wide: np.ndarray, far: np.ndarray, left: np.ndarray
) -> None:
    """Multiply by the share of a lamp that a capsule leaves to places, in place.

    Args:
        body: capsule, (7,).
        place: places, (3, n) float32.
        way: unit directions to the lamp, (3, n) float32.
        wide: sine of its angular radius, (n,) float32.
        far: its distance, (n,) float32.
        left: share, (n,) float32.
    """
    ax, ay, az, bx, by, bz, radius = body[0], body[1], body[2], body[3], body[4], body[5], body[6]
    square, per_radius = bx * bx + by * by + bz * bz + _TINY, _ONE / radius
    x, y, z, lx, ly, lz = place[0], place[1], place[2], way[0], way[1], way[2]
    for n in range(len(left)):
        wx, wy, wz = ax - x[n], ay - y[n], az - z[n]
        along = bx * lx[n] + by * ly[n] + bz * lz[n]
        ahead = wx * lx[n] + wy * ly[n] + wz * lz[n]
        # The point of the axis that is nearest to the line to the lamp, ``t`` along the line.
        share = (along * ahead - (bx * wx + by * wy + bz * wz)) / (square - along * along)
        share = min(max(share, _NONE), _ONE)
        t = ahead + share * along
        qx, qy, qz = wx + share * bx, wy + share * by, wz + share * bz
        off = np.float32(math.sqrt(max(qx * qx + qy * qy + qz * qz - t * t, _NONE)))
        # All lengths at the distance of the capsule. What is closer than its radius is the body itself.
        disc = max(wide[n] * t, _TINY)
        gap = min(max((radius + disc - off) / (_TWO * min(radius, disc)), _NONE), _ONE)
        hidden = gap * gap * (_THREE - _TWO * gap) * min(_ONE, np.float32(1.2) * radius / disc)
        hidden *= min(max(t * per_radius - np.float32(0.3), _NONE), _ONE)
        left[n] *= _ONE - (hidden if t < far[n] else _NONE)


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def enclose(body: np.ndarray, place: np.ndarray, normal: np.ndarray, left: np.ndarray) -> None:
    """Multiply by the share of the light from all around that a capsule leaves to surfaces, in place.

    Args:
        body: capsule, (7,).
        place: places, (3, n) float32.
        normal: unit normals there, (3, n) float32.
        left: share, (n,) float32.
    """
    ax, ay, az, bx, by, bz, radius = body[0], body[1], body[2], body[3], body[4], body[5], body[6]
    per_square, own = _ONE / (bx * bx + by * by + bz * bz + _TINY), radius * radius
    x, y, z, nx, ny, nz = place[0], place[1], place[2], normal[0], normal[1], normal[2]
    for n in range(len(left)):
        wx, wy, wz = ax - x[n], ay - y[n], az - z[n]
        share = min(max(-(bx * wx + by * wy + bz * wz) * per_square, _NONE), _ONE)
        qx, qy, qz = wx + share * bx, wy + share * by, wz + share * bz
        distance = qx * qx + qy * qy + qz * qz + _TINY
        rise = (nx[n] * qx + ny[n] * qy + nz[n] * qz) / np.float32(math.sqrt(distance))
        left[n] *= _ONE - max(rise, _NONE) * min(own / distance, _ONE)
