"""Compiled kernels of vertices before they are drawn: private, on plain arrays, single-threaded.

Vertices are projected once for all triangles that share them, and each gets a code of the pixels near it: of two
vertices with the same code no pixel centre lies between. Half of the triangles of a body are dropped by it.
"""

from __future__ import annotations

import numpy as np

from mvpose.kernels import njit

SLACK = 4e-3  # pixels: bounding boxes are in single precision; the edges decide

_BATCH = 256  # vertices processed together


@njit(cache=True, error_model="numpy")
def project_vertices(
    vertices: np.ndarray, P: np.ndarray, near: float, drawn: np.ndarray, width: int, height: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Project vertices (n, 3), the first of which are ``drawn`` already.

    Returns:
        Homogeneous pixel coordinates, (n, 3); pixels and inverse depths, (n, 3) float32, for the vertices that follow
        the first ones, the latter 0 behind the near plane, where the pixel is not used; and their codes, (n,) uint32.

    The upper half of a code is for the columns of pixels, the lower half for the rows. It is twice the number of the
    first column that is not left of the vertex, from 0 to ``width``, plus 1 if the vertex is on this column, within
    ``SLACK``. So the columns between vertices are those from ``min(codes) // 2`` to ``(max(codes) + 1) // 2 - 1``.
    All bits are set behind the near plane.
    """
    n, first = len(vertices), len(drawn)
    q, seen, codes = np.empty((n, 3)), np.empty((n, 3), np.float32), np.empty(n, np.uint32)
    for i in range(first):  # an assignment of arrays takes a second to compile: it brings the text of an error
        q[i, 0], q[i, 1], q[i, 2] = drawn[i, 0], drawn[i, 1], drawn[i, 2]
    # Local copies: otherwise P is read again for every vertex, because q might alias it.
    p00, p01, p02, p03 = P[0, 0], P[0, 1], P[0, 2], P[0, 3]
    p10, p11, p12, p13 = P[1, 0], P[1, 1], P[1, 2], P[1, 3]
    p20, p21, p22, p23 = P[2, 0], P[2, 1], P[2, 2], P[2, 3]
    slack, right, bottom = np.float32(SLACK), np.float32(width), np.float32(height)
    work, code = np.empty(6 * _BATCH), np.empty(_BATCH, np.int32)
    for start in range(first, n, _BATCH):
        count = min(n - start, _BATCH)
        for i in range(count):
            work[i], work[_BATCH + i] = vertices[start + i, 0], vertices[start + i, 1]
            work[2 * _BATCH + i] = vertices[start + i, 2]
        for i in range(count):  # vectorised by the compiler, as coordinates are apart
            x, y, z = work[i], work[_BATCH + i], work[2 * _BATCH + i]
            depth = p20 * x + p21 * y + p22 * z + p23
            x, y = p00 * x + p01 * y + p02 * z + p03, p10 * x + p11 * y + p12 * z + p13
            scale = 1.0 / depth
            column, row = np.float32(x * scale), np.float32(y * scale)
            work[i], work[_BATCH + i], work[2 * _BATCH + i] = x, y, depth
            work[3 * _BATCH + i], work[4 * _BATCH + i] = x * scale, y * scale
            work[5 * _BATCH + i] = scale if depth >= near else 0.0
            code_x, code_y = _code(column, slack, right), _code(row, slack, bottom)
            code[i] = (code_x << np.int32(16)) | code_y if depth >= near else np.int32(-1)
        for i in range(count):
            q[start + i, 0], q[start + i, 1], q[start + i, 2] = work[i], work[_BATCH + i], work[2 * _BATCH + i]
            seen[start + i, 0], seen[start + i, 1] = work[3 * _BATCH + i], work[4 * _BATCH + i]
            seen[start + i, 2] = work[5 * _BATCH + i]
            codes[start + i] = code[i]
    return q, seen, codes


@njit(cache=True, error_model="numpy", inline="always")
def _code(place: np.float32, slack: np.float32, size: np.float32) -> np.int32:
    """Return half of the code of a vertex; see :func:`project_vertices`."""
    zero = np.float32(0.0)
    first, last = np.ceil(place - slack), np.floor(place + slack)
    on_pixel = (first == last) & (first >= zero) & (first < size)
    first = first if first > zero else zero
    first = first if first < size else size
    return (np.int32(first) << np.int32(1)) | np.int32(on_pixel)


@njit(cache=True, error_model="numpy")
def drawable(start: int, end: int, faces: np.ndarray, codes: np.ndarray, kept: np.ndarray) -> int:
    """Write to ``kept`` the triangles from ``start`` to before ``end`` that may cover a pixel; return their number.

    They have pixel columns between their vertices, and pixel rows: codes that differ, or a vertex on a pixel.
    """
    count, none = np.uint32(0), np.uint32(0)
    columns, rows, on_pixel = np.uint32(0xFFFF0000), np.uint32(0xFFFF), np.uint32(0x10001)
    for t in range(start, end):
        a, b, c = codes[faces[t, 0]], codes[faces[t, 1]], codes[faces[t, 2]]
        spans = (a ^ b) | (a ^ c) | (a & on_pixel)
        kept[count] = t
        count += np.uint32((spans & columns) != none) & np.uint32((spans & rows) != none)
    return int(count)
