"""Compiled kernels of what moving bodies keep from the light: private, on plain arrays, single-threaded.

Bodies are capsules, one for each part. A lamp, as seen from a place, is a disc in the sky with an angular radius; a
capsule hides of it what overlaps the disc. Of the light from all around it hides about its form factor, the share of a
sphere at its nearest point (Quilez, "Sphere ambient occlusion" and "Capsule ambient occlusion", 2006 and 2013).
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit

_LARGEST = 0.6  # metres: a part with a larger radius is no body
_MARGIN = 0.7  # metres around a body within which it keeps light of the surroundings from the floor
_LONGEST = 2.0  # metres: longest shadow
_AROUND = 0.35  # metres around where a shadow lies without penumbra
_FAINT = 0.06  # share of the light: a lamp that brings less casts no shadow
_STRONGEST = 4  # lamps that cast shadows of one body
_LEAST_AROUND = 0.5  # share of the light that comes from the surroundings at least: other lamps are part of them
_EDGES = 8  # cells of a block
_SEEN = 0.985  # share of the light: what is less dark cannot be seen
_CHUNK = 512  # samples processed together
_NONE, _ONE, _TWO, _THREE, _TINY = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(3.0), np.float32(1e-6)


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
def _hide(
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
def _enclose(body: np.ndarray, place: np.ndarray, normal: np.ndarray, left: np.ndarray) -> None:
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


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def cast(
    left: np.ndarray,
    z: float,
    cell: float,
    corner: np.ndarray,
    bodies: np.ndarray,
    ranges: np.ndarray,
    areas: np.ndarray,
    sun: np.ndarray,
    origin: np.ndarray,
    step: np.ndarray,
    every: np.ndarray,
    shares: np.ndarray,
    around_only: bool,
) -> None:
    """Multiply a map at height z by the share of the light that bodies leave to surfaces that face up, in place.

    Args:
        left: map, (rows, columns) float32.
        z: height of the map, metres.
        cell: side of a cell, metres.
        corner: x and y of the corner of the map, (2,).
        bodies: capsules, see :func:`capsules`, (n, 7).
        ranges: first and end of the capsules of each body, (bodies, 2).
        areas: area lights with the luminance of their radiance: centre, right, up, luminance, focus, (m, 11).
        sun: unit direction to the sun and luminance of its irradiance, (4,).
        origin: origin of the probes, (3,).
        step: distances of the probes, (3,).
        every: luminance of the light of surfaces that face up at the probes, (nx, ny, nz, 1).
        shares: share of area lights and sun that still meshes leave, (nx, ny, nz, areas + 1).
        around_only: whether of the light that comes from the surroundings, else of that of area lights and sun.
    """
    rows, columns = left.shape
    place, way, up = (
        np.zeros((3, columns), np.float32),
        np.zeros((3, columns), np.float32),
        np.zeros((3, columns), np.float32),
    )
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
                        _enclose(bodies[k], place, up, open_[:count])
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
                        _hide(bodies[k], place, way, wide, far, open_[:count])
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


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def moving_light(
    vertices: np.ndarray,
    face_normals: np.ndarray,
    vertex_normals: np.ndarray,
    of_vertex: np.ndarray,
    of_face: np.ndarray,
    spans: np.ndarray,
    bodies: np.ndarray,
    ranges: np.ndarray,
    origin: np.ndarray,
    step: np.ndarray,
    every: np.ndarray,
    straight: np.ndarray,
) -> np.ndarray:
    """Return the irradiance (n, 3) at the light samples of moving meshes.

    The light of the room is taken along the axis of each mesh, upright through its middle; what the mesh itself and
    others nearby keep from it, at every sample.

    Args:
        vertices: vertices of the moving meshes, (v, 3).
        face_normals: unit normals of their faces, (k, 3).
        vertex_normals: unit normals of the vertices, (v, 3).
        of_vertex: vertex of each sample, (n,).
        of_face: face whose normal a sample has, or -1 for that of its vertex, (n,).
        spans: first and end of the samples of each mesh, (meshes, 2).
        bodies: capsules, (c, 7).
        ranges: first and end of the capsules of each mesh, (meshes, 2).
        origin: origin of the probes, (3,).
        step: distances of the probes, (3,).
        every: light of all sources at the probes by the six directions, (nx, ny, nz, 18).
        straight: luminance of what comes straight from area lights and sun, (nx, ny, nz, 6).
    """
    light = np.zeros((len(of_vertex), 3), np.float32)
    levels = 6
    column, direct = np.empty((levels, 18)), np.empty((levels, 6))
    ways = np.empty((levels, 4))
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
        rise = max(high[2] - low[2], 1e-3) / (levels - 1)
        for n in range(levels):
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
                n = min(int(at), levels - 2)
                at -= n
                lx, ly = (1.0 - at) * ways[n, 0] + at * ways[n + 1, 0], (1.0 - at) * ways[n, 1] + at * ways[n + 1, 1]
                lz = (1.0 - at) * ways[n, 2] + at * ways[n + 1, 2]
                length = 1.0 / math.sqrt(lx * lx + ly * ly + lz * lz + 1e-12)
                way[0, s], way[1, s], way[2, s] = length * lx, length * ly, length * lz
                wide[s] = (1.0 - at) * ways[n, 3] + at * ways[n + 1, 3]
                far[s], seen[s], around[s] = 3.0, 1.0, 1.0
            for c in range(count):
                _enclose(bodies[near[c]], place, normal, around[:size])
                _hide(bodies[near[c]], place, way, wide, far, seen[:size])
            for s in range(size):
                nx, ny, nz = normal[0, s], normal[1, s], normal[2, s]
                at = (np.float64(place[2, s]) - low[2]) / rise
                n = min(int(at), levels - 2)
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
                    whole += value * (0.2126 if c == 0 else (0.7152 if c == 1 else 0.0722))
                share = min(part / whole, 1.0)
                factor = np.float32(share * seen[s] + (1.0 - share) * around[s])
                for c in range(3):
                    light[start + s, c] *= factor
    return light


@njit(cache=True, error_model="numpy")
def touched_blocks(fine: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Return which blocks of a map are dark anywhere, (blocks + 1,) bool; the last, for none, is False.

    Args:
        fine: map of the floor, (rows, columns).
        coarse: maps at several heights, in cells twice as large, (heights, rows / 2, columns / 2).
    """
    rows, columns = fine.shape
    wide = columns // _EDGES
    touched = np.zeros(rows // _EDGES * wide + 1, np.bool_)
    for j in range(rows):
        for i in range(columns):
            if fine[j, i] < _SEEN:
                touched[j // _EDGES * wide + i // _EDGES] = True
    for layer in range(1, coarse.shape[0]):
        for j in range(rows // 2):
            for i in range(columns // 2):
                if coarse[layer, j, i] < _SEEN:
                    touched[2 * j // _EDGES * wide + 2 * i // _EDGES] = True
    return touched
