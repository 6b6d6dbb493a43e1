"""Compiled rays against still triangles, with a tree of bounding boxes.

A node of the tree has a box and either two children or up to ``_LEAF`` triangles. Triangles are met by the test of
Möller and Trumbore ("Fast, minimum storage ray/triangle intersection", 1997), from both sides.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit

_LEAF = 4
_BINS = 12
DEEPEST = 64


class BoxTree(NamedTuple):
    """Tree of k triangles."""

    boxes: NDArray[np.float32]
    """Lowest, then highest coordinates of the nodes, (m, 6)."""
    links: NDArray[np.int32]
    """The first of two children, that follow each other, and 0; or the first triangle and their number, (m, 2)."""
    triangles: NDArray[np.float32]
    """a corner and the edges to the other two, (k, 9)."""


@njit(cache=True, error_model="numpy")
def build_tree(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the fields of the :class:`BoxTree` of triangles (k, 3, 3), and the index of each among them, (k,).

    Nodes are split where boxes times triangles have the least surface, by bins (Wald, 2007).
    """
    count = len(corners)
    middles, order = np.empty((count, 3), np.float32), np.arange(count)
    for t in range(count):
        for k in range(3):
            middles[t, k] = (corners[t, 0, k] + corners[t, 1, k] + corners[t, 2, k]) / np.float32(3.0)
    boxes, links = np.zeros((2 * count + 1, 6), np.float32), np.zeros((2 * count + 1, 2), np.int32)
    stack = np.zeros((2 * count + 2, 3), np.int64)
    counts, spans = np.zeros(_BINS, np.int64), np.zeros((_BINS, 6))
    stack[0, 2] = count
    pending, made = 1, 1
    while pending:
        pending -= 1
        node, start, end = stack[pending]
        size = end - start
        for k in range(3):
            low, high = np.inf, -np.inf
            for n in range(start, end):
                for c in range(3):
                    value = corners[order[n], c, k]
                    low, high = min(low, value), max(high, value)
            boxes[node, k], boxes[node, 3 + k] = low - 1e-4, high + 1e-4
        best, axis, cut = np.inf, 0, 0.0
        for k in range(3 if size > _LEAF else 0):
            least, most = np.inf, -np.inf
            for n in range(start, end):
                least, most = min(least, middles[order[n], k]), max(most, middles[order[n], k])
            if most - least < 1e-6:
                continue
            counts[:] = 0
            spans[:, :3], spans[:, 3:] = np.inf, -np.inf
            for n in range(start, end):
                t = order[n]
                bin_ = min(int((middles[t, k] - least) / (most - least) * _BINS), _BINS - 1)
                counts[bin_] += 1
                for c in range(3):
                    for axis_ in range(3):
                        spans[bin_, axis_] = min(spans[bin_, axis_], corners[t, c, axis_])
                        spans[bin_, 3 + axis_] = max(spans[bin_, 3 + axis_], corners[t, c, axis_])
            for m in range(1, _BINS):
                cost = _cost(counts[:m], spans[:m]) + _cost(counts[m:], spans[m:])
                if cost < best:
                    best, axis, cut = cost, k, least + (most - least) * m / _BINS
        split = start
        if best < np.inf:
            for n in range(start, end):
                if middles[order[n], axis] < cut:
                    order[n], order[split] = order[split], order[n]
                    split += 1
        if size <= _LEAF or split in (start, end):
            if size <= 2 * _LEAF:
                links[node, 0], links[node, 1] = start, size
                continue
            split = (start + end) // 2
        links[node, 0] = made
        stack[pending, 0], stack[pending, 1], stack[pending, 2] = made, start, split
        stack[pending + 1, 0], stack[pending + 1, 1], stack[pending + 1, 2] = made + 1, split, end
        pending, made = pending + 2, made + 2
    triangles = np.empty((count, 9), np.float32)
    for n in range(count):
        for k in range(3):
            first = corners[order[n], 0, k]
            triangles[n, k] = first
            triangles[n, 3 + k], triangles[n, 6 + k] = corners[order[n], 1, k] - first, corners[order[n], 2, k] - first
    return boxes[:made], links[:made], triangles, order


@njit(cache=True, error_model="numpy")
def _cost(counts: np.ndarray, spans: np.ndarray) -> float:
    """Return the surface of the box around the boxes (n, 6) of bins times their number of triangles; 0 for none."""
    total = counts.sum()
    if total == 0:
        return 0.0
    x, y, z = _extent(spans, 0), _extent(spans, 1), _extent(spans, 2)
    return total * (x * y + y * z + z * x)


@njit(cache=True, error_model="numpy")
def _extent(spans: np.ndarray, axis: int) -> float:
    """Return the extent of boxes (n, 6) together along an axis."""
    low, high = spans[0, axis], spans[0, 3 + axis]
    for k in range(1, len(spans)):
        low, high = min(low, spans[k, axis]), max(high, spans[k, 3 + axis])
    return high - low


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def trace(
    tree: BoxTree,
    stack: np.ndarray,
    start: tuple[float, float, float],
    way: tuple[float, float, float],
    reach: float,
    any_hit: bool,
) -> tuple[int, np.float32, np.float32, np.float32]:
    """Return the first triangle on a ray in tree order, or -1; its distance; weights of its second and third corner.

    Args:
        tree: tree of the triangles.
        stack: memory, (``DEEPEST``,) int32.
        start: start of the ray.
        way: its direction; distances are in its length.
        reach: largest distance.
        any_hit: whether any triangle will do, not only the nearest.
    """
    boxes, links, triangles = tree
    sx, sy, sz = np.float32(start[0]), np.float32(start[1]), np.float32(start[2])
    wx, wy, wz = np.float32(way[0]), np.float32(way[1]), np.float32(way[2])
    tiny, one, zero = np.float32(1e-12), np.float32(1.0), np.float32(0.0)
    ix = one / (wx if abs(wx) > tiny else tiny)
    iy = one / (wy if abs(wy) > tiny else tiny)
    iz = one / (wz if abs(wz) > tiny else tiny)
    stack[0], pending = 0, 1
    found, nearest, found_u, found_v = -1, np.float32(reach), zero, zero
    while pending:
        pending -= 1
        node = stack[pending]
        x0, x1 = (boxes[node, 0] - sx) * ix, (boxes[node, 3] - sx) * ix
        y0, y1 = (boxes[node, 1] - sy) * iy, (boxes[node, 4] - sy) * iy
        z0, z1 = (boxes[node, 2] - sz) * iz, (boxes[node, 5] - sz) * iz
        enter = max(min(x0, x1), min(y0, y1), min(z0, z1), zero)
        leave = min(max(x0, x1), max(y0, y1), max(z0, z1), nearest)
        if enter > leave:
            continue
        first, count = links[node, 0], links[node, 1]
        if count == 0:
            if pending + 2 <= DEEPEST:
                # The child whose box lies ahead is better met first; its middle along the ray decides.
                one_way = (boxes[first, 0] + boxes[first, 3]) * wx + (boxes[first, 1] + boxes[first, 4]) * wy
                one_way += (boxes[first, 2] + boxes[first, 5]) * wz
                other = (boxes[first + 1, 0] + boxes[first + 1, 3]) * wx
                other += (boxes[first + 1, 1] + boxes[first + 1, 4]) * wy
                other += (boxes[first + 1, 2] + boxes[first + 1, 5]) * wz
                swap = 1 if one_way < other else 0
                stack[pending], stack[pending + 1] = first + swap, first + 1 - swap
                pending += 2
            continue
        for t in range(first, first + count):
            ax, ay, az = triangles[t, 3], triangles[t, 4], triangles[t, 5]
            bx, by, bz = triangles[t, 6], triangles[t, 7], triangles[t, 8]
            px, py, pz = wy * bz - wz * by, wz * bx - wx * bz, wx * by - wy * bx
            determinant = ax * px + ay * py + az * pz
            if abs(determinant) < tiny:
                continue
            scale = one / determinant
            fx, fy, fz = sx - triangles[t, 0], sy - triangles[t, 1], sz - triangles[t, 2]
            u = (fx * px + fy * py + fz * pz) * scale
            qx, qy, qz = fy * az - fz * ay, fz * ax - fx * az, fx * ay - fy * ax
            v = (wx * qx + wy * qy + wz * qz) * scale
            far = (bx * qx + by * qy + bz * qz) * scale
            if u >= zero and v >= zero and u + v <= one and zero < far < nearest:
                found, nearest, found_u, found_v = t, far, u, v
                if any_hit:
                    return found, nearest, found_u, found_v
    return found, nearest, found_u, found_v
