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
    x, y, z = vertices.astype(float).T[..., None]
    return np.asarray(P[:, 0] * x + P[:, 1] * y + P[:, 2] * z + P[:, 3])


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
    turn_of, none = np.empty(len(faces) - first, np.int8), 4
    for t in range(first, len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        left, right, top, bottom = _box(q[a], q[b], q[c], near)
        inside = left <= right and top <= bottom and right >= 0 and bottom >= 0
        x, y = q[b, 1] * q[c, 2] - q[b, 2] * q[c, 1], q[b, 2] * q[c, 0] - q[b, 0] * q[c, 2]
        z = q[b, 0] * q[c, 1] - q[b, 1] * q[c, 0]
        averted = q[a, 0] * x + q[a, 1] * y + q[a, 2] * z > 0
        large = min(q[a, 2], q[b, 2], q[c, 2]) < near or max(right - left, bottom - top) >= _SMALL
        turn_of[t - first] = 2 * averted + large if inside else none
    for turn in range(none):
        for t in range(first, len(faces)):
            if turn_of[t - first] == turn:
                _draw(t, q[faces[t, 0]], q[faces[t, 1]], q[faces[t, 2]], near, inverse_depth, triangle)


@njit(cache=True, borrows=True, error_model="numpy")
def _box(a: np.ndarray, b: np.ndarray, c: np.ndarray, near: float) -> tuple[float, float, float, float]:
    """Return the first and the last column, and row, of the part of a triangle beyond the near plane."""
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for one, two in ((b, c), (c, a), (a, b)):
        if one[2] >= near:
            x, y = one[0] / one[2], one[1] / one[2]
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        if (one[2] >= near) != (two[2] >= near):
            share = (near - one[2]) / (two[2] - one[2])
            x, y = (one[0] + share * (two[0] - one[0])) / near, (one[1] + share * (two[1] - one[1])) / near
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    return np.ceil(left - _SLACK), np.floor(right + _SLACK), np.ceil(top - _SLACK), np.floor(bottom + _SLACK)


@njit(cache=True, error_model="numpy")
def _draw(
    t: int,
    a: np.ndarray,
    b: np.ndarray,
    c: np.ndarray,
    near: float,
    inverse_depth: np.ndarray,
    triangle: np.ndarray,
) -> None:
    """Write triangle ``t`` with corners (3,) at the pixels where it is the nearest, row by row."""
    height, width = triangle.shape
    left, right, top, bottom = _box(a, b, c, near)
    left, right, top, bottom = max(left, 0.0), min(right, width - 1.0), max(top, 0.0), min(bottom, height - 1.0)
    least, most = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
    whole, edge = least >= near, np.empty((4, 3))
    for k, (one, two) in enumerate(((b, c), (c, a), (a, b))):
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
    if determinant < 0:
        for k in range(3):
            edge[k, 0], edge[k, 1], edge[k, 2] = -edge[k, 0], -edge[k, 1], -edge[k, 2]
    edge[3, 0], edge[3, 1], edge[3, 2] = -px, -py, 1.0 / near - pz  # the near plane as a fourth edge
    # Rounding must not move a thin triangle out of its range of depth.
    low, high = np.float32(1.0 / most), np.float32(1.0 / (least if whole else near))
    for row in range(int(top), int(bottom) + 1):
        start, end = left, right
        for n in range(3 if whole else 4):
            rise, offset = edge[n, 0], edge[n, 1] * row + edge[n, 2]
            if rise != 0.0:
                edge_x = np.ceil(-offset / rise) if rise > 0 else np.floor(-offset / rise)
                # The sign of the edge at a pixel decides, independent of rounding here.
                inward = 1.0 if rise > 0 else -1.0
                if rise * edge_x + offset < 0:
                    edge_x += inward
                elif rise * (edge_x - inward) + offset >= 0:
                    edge_x -= inward
                start, end = (max(start, edge_x), end) if rise > 0 else (start, min(end, edge_x))
            elif offset < 0:
                end = -1.0
        base = py * row + pz
        for x in range(int(start), int(end) + 1 if start <= end else 0):
            w = min(max(np.float32(px * x + base), low), high)
            if w > inverse_depth[row, x]:
                inverse_depth[row, x], triangle[row, x] = w, t
