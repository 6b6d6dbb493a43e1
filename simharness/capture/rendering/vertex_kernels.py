"""Compiled kernels of vertices: their pixels before triangles are drawn, and spans of pixels around meshes.

Vertices are projected once for all triangles that share them, and each gets a code of the pixels near it: of two
vertices with the same code no pixel centre lies between. Half of the triangles of a body are dropped by it.

A span is a row of the picture, its first and its end column. The spans of a picture cover the boxes around the moving
meshes, which follow from the codes; what is outside of them is as in the background, and is neither copied nor looked
at.
"""

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


@njit(cache=True, error_model="numpy")
def covering_spans(codes: np.ndarray, starts: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return the spans, (n, 3) int32, that cover all triangles of some meshes, in the order of the picture.

    Args:
        codes: codes of all vertices, see :func:`.vertex_kernels.project_vertices`.
        starts: first vertex of each mesh, and the end, (meshes + 1,).
        height: rows of the picture.
        width: columns of the picture.
    """
    boxes = np.zeros((len(starts) - 1, 4), np.int32)  # left, end, top, end
    behind, rows, one = np.uint32(0xFFFFFFFF), np.uint32(0xFFFF), np.uint32(1)
    for mesh in range(len(boxes)):
        left, right, top, bottom, ahead = behind, np.uint32(0), rows, np.uint32(0), behind
        for i in range(starts[mesh], starts[mesh + 1]):  # vectorised by the compiler
            column, row = codes[i] >> np.uint32(16), codes[i] & rows
            left, right = min(left, column), max(right, column)
            top, bottom, ahead = min(top, row), max(bottom, row), min(ahead, codes[i])
        if right < rows:
            boxes[mesh, 0], boxes[mesh, 1] = left >> one, (right + one) >> one
            boxes[mesh, 2], boxes[mesh, 3] = top >> one, (bottom + one) >> one
        elif ahead < behind:  # the near plane cuts the mesh
            boxes[mesh, 1], boxes[mesh, 3] = width, height
    spans, count = np.empty((len(boxes) * height, 3), np.int32), 0
    for y in range(height):
        end = 0
        while True:  # the next span, from the leftmost box that reaches beyond the last
            first, last = width, end
            for mesh in range(len(boxes)):
                if boxes[mesh, 2] <= y < boxes[mesh, 3] and boxes[mesh, 1] > end:
                    first = min(first, max(boxes[mesh, 0], end))
            if first == width:
                break
            last, grows = first, True
            while grows:
                grows = False
                for mesh in range(len(boxes)):
                    inside = boxes[mesh, 2] <= y < boxes[mesh, 3] and boxes[mesh, 0] <= last
                    if inside and boxes[mesh, 1] > last:
                        last, grows = boxes[mesh, 1], True
            spans[count, 0], spans[count, 1], spans[count, 2] = y, first, last
            count += 1
            end = last
    return spans[:count]


@njit(cache=True, error_model="numpy")
def copied_pixels(spans: np.ndarray, inverse_depth: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return copies of inverse depth and visible face at the pixels of spans, one after the other."""
    count = 0
    for n in range(len(spans)):
        count += spans[n, 2] - spans[n, 1]
    depths, labels, at = np.empty(count, inverse_depth.dtype), np.empty(count, triangle.dtype), 0
    for n in range(len(spans)):
        y, first, end = spans[n, 0], spans[n, 1], spans[n, 2]
        size = end - first
        for x in range(size):
            depths[at + x], labels[at + x] = inverse_depth[y, first + x], triangle[y, first + x]
        at += size
    return depths, labels


@njit(cache=True, error_model="numpy")
def restore_pixels(
    spans: np.ndarray, depths: np.ndarray, labels: np.ndarray, inverse_depth: np.ndarray, triangle: np.ndarray
) -> None:
    """Write what :func:`copied_pixels` has copied."""
    at = 0
    for n in range(len(spans)):
        y, first, end = spans[n, 0], spans[n, 1], spans[n, 2]
        size = end - first
        for x in range(size):
            inverse_depth[y, first + x], triangle[y, first + x] = depths[at + x], labels[at + x]
        at += size


@njit(cache=True, error_model="numpy")
def mark_visible(spans: np.ndarray, triangle: np.ndarray, labels: np.ndarray, seen: np.ndarray) -> None:
    """Write the label of the visible face, ``labels[-1]`` for none, at the pixels of spans of ``seen`` (h, w)."""
    last = np.uint32(len(labels) - 1)
    for n in range(len(spans)):
        y, first, end = spans[n, 0], spans[n, 1], spans[n, 2]
        marks, shown = seen[y, first:end], triangle[y, first:end]
        for x in range(end - first):
            marks[x] = labels[min(np.uint32(shown[x]), last)]  # as unsigned, -1 is the largest index


def picture_spans(height: int, width: int) -> np.ndarray:
    """Return the spans of a whole picture."""
    return np.column_stack([np.arange(height), np.zeros(height), np.full(height, width)]).astype(np.int32)
