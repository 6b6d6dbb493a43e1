"""Compiled kernels of capsules that keep light from places: private, on plain arrays, single-threaded.

Bodies are capsules, one for each part. A lamp, as seen from a place, is a disc in the sky with an angular radius; a
capsule hides of it what overlaps the disc. Of the light from all around it hides about its form factor, the share of a
sphere at its nearest point (Quilez, "Sphere ambient occlusion" and "Capsule ambient occlusion", 2006 and 2013).
"""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit

_LARGEST = 0.6  # metres: a part with a larger radius is no body
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
