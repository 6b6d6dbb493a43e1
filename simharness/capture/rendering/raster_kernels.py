"""Compiled kernel of the rasteriser: private, on plain arrays, single-threaded.

A triangle with vertices ``a, b, c`` in homogeneous pixel coordinates (``P @ (x, 1)``, the third is depth) is hit by the
ray ``d = (x, y, 1)`` of a pixel if all of ``[b x c, c x a, a x b] . d`` have the sign of the determinant
``a . (b x c)``, and their sum over the determinant is the inverse depth of the hit. This needs no clipping: vertices
behind the camera are allowed (Olano & Greer, "Triangle scan conversion using 2D homogeneous coordinates",
1997). Two triangles that share an edge compute it with opposite signs and the same rounding, so no pixel falls between
them.

All arithmetic is in float64, for large triangles (the floor of a room) and small ones (a fingertip) alike.
"""

import numpy as np

from mvpose.kernels import njit

LONGEST_SIDE = 0x7FFE
"""Most pixels of a side of a picture."""

_SMALL = 12  # pixels
_SLACK = 4e-3  # pixels: bounding boxes are a little larger; the edges decide


def pixels_of(vertices: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Return homogeneous pixel coordinates (n, 3) of vertices (n, 3) float32, by a projection matrix (3, 4)."""
    x, y, z = vertices.astype(float).T
    return np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in P], axis=1)


@njit(cache=True, error_model="numpy")
def rasterise(
    faces: np.ndarray, q: np.ndarray, near: float, inverse_depth: np.ndarray, triangle: np.ndarray, first: int
) -> None:
    """Write the nearest triangle at every pixel centre into ``inverse_depth`` and ``triangle``, in place.

    A call may add triangles to what an earlier call has written. At equal depth the earlier ones stay. Both sides of
    triangles are drawn. Of coincident ones those that face the camera are seen, and of these the small ones: what is
    attached to a large surface.

    Args:
        faces: vertex indices, (k, 3) uint32.
        q: homogeneous pixel coordinates of the vertices, (n, 3), see :func:`pixels_of`; the third are depths.
        near: depth below which nothing is drawn.
        inverse_depth: (h, w) float32, zeros before.
        triangle: index of the visible face, (h, w) int32; -1 before.
        first: number of triangles that an earlier call has drawn.
    """
    turn_of, none, edge = np.empty(len(faces) - first, np.int8), 4, np.empty((4, 3))
    seen = q[:, :2] / q[:, 2:]
    for t in range(first, len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, bx, by, cx, cy = seen[a, 0], seen[a, 1], seen[b, 0], seen[b, 1], seen[c, 0], seen[c, 1]
        if min(q[a, 2], q[b, 2], q[c, 2]) < near:
            turn_of[t - first] = 1
            continue
        columns = np.floor(max(ax, bx, cx) + _SLACK) - np.ceil(min(ax, bx, cx) - _SLACK)
        rows = np.floor(max(ay, by, cy) + _SLACK) - np.ceil(min(ay, by, cy) - _SLACK)
        averted = (bx - ax) * (cy - ay) > (by - ay) * (cx - ax)  # y is down: clockwise
        turn_of[t - first] = 2 * averted + (max(columns, rows) >= _SMALL) if min(columns, rows) >= 0 else none
    for turn in range(none):
        for t in range(first, len(faces)):
            if turn_of[t - first] == turn:
                _draw(t, faces[t], q, seen, near, edge, inverse_depth, triangle)


@njit(cache=True, borrows=True, error_model="numpy")
def _draw(
    t: int,
    face: np.ndarray,
    q: np.ndarray,
    seen: np.ndarray,
    near: float,
    edge: np.ndarray,
    inverse_depth: np.ndarray,
    triangle: np.ndarray,
) -> None:
    """Write triangle ``t`` at the pixels where it is the nearest; ``edge`` is memory, (4, 3)."""
    a, b, c = q[face[0]], q[face[1]], q[face[2]]
    height, width = triangle.shape
    least, most = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
    if most < near:
        return
    # Pixel box of the part beyond the near plane.
    left, right, top, bottom, whole = np.inf, -np.inf, np.inf, -np.inf, least >= near
    for k in range(3):
        i, j = face[k], face[(k + 1) % 3]
        if q[i, 2] >= near:
            x, y = seen[i, 0], seen[i, 1]
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        if not whole and (q[i, 2] >= near) != (q[j, 2] >= near):
            share = (near - q[i, 2]) / (q[j, 2] - q[i, 2])
            x, y = (q[i, 0] + share * (q[j, 0] - q[i, 0])) / near, (q[i, 1] + share * (q[j, 1] - q[i, 1])) / near
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    left, right = max(np.ceil(left - _SLACK), 0.0), min(np.floor(right + _SLACK), width - 1.0)
    top, bottom = max(np.ceil(top - _SLACK), 0.0), min(np.floor(bottom + _SLACK), height - 1.0)
    if left > right or top > bottom:
        return
    # Rounding must not move a thin triangle out of its range of depth.
    low, high = np.float32(1.0 / most), np.float32(1.0 / max(least, near))
    if _hidden(inverse_depth[int(top) : int(bottom) + 1, int(left) : int(right) + 1], high):
        return
    for k in range(3):
        one, two = q[face[(k + 1) % 3]], q[face[(k + 2) % 3]]
        edge[k, 0] = one[1] * two[2] - one[2] * two[1]
        edge[k, 1] = one[2] * two[0] - one[0] * two[2]
        edge[k, 2] = one[0] * two[1] - one[1] * two[0]
    determinant = a[0] * edge[0, 0] + a[1] * edge[0, 1] + a[2] * edge[0, 2]
    if determinant == 0.0:  # seen edge-on
        return
    scale = 1.0 / determinant
    px = (edge[0, 0] + edge[1, 0] + edge[2, 0]) * scale
    py = (edge[0, 1] + edge[1, 1] + edge[2, 1]) * scale
    pz = (edge[0, 2] + edge[1, 2] + edge[2, 2]) * scale
    sign, label = -1.0 if determinant < 0 else 1.0, np.int32(t)
    edge[3, 0], edge[3, 1], edge[3, 2] = -sign * px, -sign * py, sign * (1.0 / near - pz)  # the near plane
    e, f, g, h = sign * edge[0, 0], sign * edge[1, 0], sign * edge[2, 0], sign * edge[3, 0]
    for row in range(int(top), int(bottom) + 1):
        from_e, from_f = sign * (edge[0, 1] * row + edge[0, 2]), sign * (edge[1, 1] * row + edge[1, 2])
        from_g, from_h = sign * (edge[2, 1] * row + edge[2, 2]), sign * (edge[3, 1] * row + edge[3, 2])
        base, first = py * row + pz, np.int32(left)
        depths, triangles = inverse_depth[row, first : int(right) + 1], triangle[row, first : int(right) + 1]
        for i in range(len(depths)):  # without branches, so that the compiler vectorises it
            x, before, other = np.float64(first + np.int32(i)), depths[i], triangles[i]
            w = np.float32(px * x + base)
            w = low if w < low else (high if w > high else w)
            inside = (e * x + from_e >= 0) & (f * x + from_f >= 0) & (g * x + from_g >= 0)
            nearer = inside & (whole | (h * x + from_h >= 0)) & (w > before)
            depths[i], triangles[i] = w if nearer else before, label if nearer else other


@njit(cache=True, borrows=True, error_model="numpy")
def _hidden(inverse_depth: np.ndarray, nearest: np.float32) -> bool:
    """Return whether all pixels of a box show what is not farther than an inverse depth."""
    for row in range(inverse_depth.shape[0]):
        for x in range(inverse_depth.shape[1]):
            if nearest > inverse_depth[row, x]:
                return False
    return True
