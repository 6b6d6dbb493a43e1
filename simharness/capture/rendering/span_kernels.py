"""Compiled spans of pixels that moving meshes may change: private, on plain arrays, single-threaded.

A span is a row of the picture, its first and its end column. The spans of a picture cover the boxes around the moving
meshes; what is outside of them is as in the background, and is neither copied nor looked at.
"""

from __future__ import annotations

import numpy as np

from mvpose.kernels import njit


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
def lifted(spans: np.ndarray, inverse_depth: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
def put_back(
    spans: np.ndarray, depths: np.ndarray, labels: np.ndarray, inverse_depth: np.ndarray, triangle: np.ndarray
) -> None:
    """Write what :func:`lifted` has copied."""
    at = 0
    for n in range(len(spans)):
        y, first, end = spans[n, 0], spans[n, 1], spans[n, 2]
        size = end - first
        for x in range(size):
            inverse_depth[y, first + x], triangle[y, first + x] = depths[at + x], labels[at + x]
        at += size


@njit(cache=True, error_model="numpy")
def resolve(
    spans: np.ndarray,
    inverse_depth: np.ndarray,
    triangle: np.ndarray,
    labels: np.ndarray,
    depth: np.ndarray,
    seen: np.ndarray,
) -> None:
    """Write depth (h, w), +inf without a face, and the label of the visible face, ``labels[-1]`` for none, at spans."""
    last = np.uint32(len(labels) - 1)
    for n in range(len(spans)):
        y, first, end = spans[n, 0], spans[n, 1], spans[n, 2]
        depths, nearness = depth[y, first:end], inverse_depth[y, first:end]
        marks, shown = seen[y, first:end], triangle[y, first:end]
        for x in range(end - first):
            depths[x] = np.float32(1.0) / nearness[x]
        for x in range(end - first):
            marks[x] = labels[min(np.uint32(shown[x]), last)]  # as unsigned, -1 is the largest index


def whole(height: int, width: int) -> np.ndarray:
    """Return the spans of a whole picture."""
    return np.column_stack([np.arange(height), np.zeros(height), np.full(height, width)]).astype(np.int32)
