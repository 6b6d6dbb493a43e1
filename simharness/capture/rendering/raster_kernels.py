"""Compiled kernels of the rasteriser: private, on plain arrays, single-threaded.

A triangle with vertices ``a, b, c`` in homogeneous pixel coordinates (``P @ (x, 1)``, the third is depth) is hit by the
ray ``d = (x, y, 1)`` of a pixel if all of ``[b x c, c x a, a x b] . d`` have the sign of the determinant
``a . (b x c)``, and their sum over the determinant is the inverse depth of the hit. This needs no clipping: vertices
behind the camera are allowed (Olano & Greer, "Triangle scan conversion using 2D homogeneous coordinates",
1997). Two triangles that share an edge compute it with opposite signs and the same rounding, so no pixel falls between
them.

All arithmetic is in float64, for large triangles (the floor of a room) and small ones (a fingertip) alike. Most
triangles of a body are about as large as a pixel, and their cost is dominated by mispredicted branches, a dozen each.
So they pass through short branch-free loops that select, sort, set up, cover and fill; each loop passes a list to the
next. Half of the triangles of a body lie between the pixel centres: they are dropped by a code of their vertices.
"""

# ruff: noqa: PLR0915 (a kernel is one loop over plain arrays: calls would cost it its speed)

import numpy as np

from mvpose.kernels import njit
from simharness.capture.rendering.vertex_kernels import SLACK, drawable, project_vertices

# The kernels are typed by the arrays of the first call. Indices are unsigned or count from 0: an index that may be
# negative would be checked at every use, and prevents vectorisation of loops.

LONGEST_SIDE = 0x7FFE  # pixels: codes of vertices have 15 bits for a column or row

_TILE = 4  # pixels
_SMALL = 12  # pixels: larger triangles are drawn row by row
_ROWS_OF_WORK = 12  # quantities of a triangle, see _set_up
_CHUNK = 256  # triangles processed together: their lists stay in the first-level cache
_LOWEST = np.array([0, 1, 2, 5, 3, 9, 6, 11, 15, 4, 8, 10, 14, 7, 13, 12])  # lowest set bit by de Bruijn sequence
_DE_BRUIJN = 0x09AF


def rasterise(
    vertices: np.ndarray, faces: np.ndarray, P: np.ndarray, near: float, inverse_depth: np.ndarray, triangle: np.ndarray
) -> np.ndarray:
    """Write the nearest triangle at every pixel centre into ``inverse_depth`` and ``triangle``, in place.

    Args:
        vertices: positions in the world, (n, 3) float32.
        faces: vertex indices, (k, 3) uint32.
        P: projection matrix ``K [R | t]``, (3, 4), with a last row of unit length.
        near: depth below which nothing is drawn.
        inverse_depth: (h, w) float32, zeros before; sides of at most ``LONGEST_SIDE``.
        triangle: index of the visible face, (h, w) int32; -1 before.

    Returns:
        Homogeneous pixel coordinates of the vertices, (n, 3).
    """
    height, width = triangle.shape
    projected = project_vertices(vertices, P, near, np.zeros((0, 3)), width, height)
    draw_projected(faces, projected, near, inverse_depth, triangle, 0)
    return projected[0]


@njit(cache=True, error_model="numpy")
def draw_projected(
    faces: np.ndarray,
    projected: tuple[np.ndarray, np.ndarray, np.ndarray],
    near: float,
    inverse_depth: np.ndarray,
    triangle: np.ndarray,
    first: int,
) -> None:
    """Write the nearest triangle at every pixel centre, as :func:`rasterise`, with vertices that are projected already.

    A call may add triangles to what an earlier call has written: those that come first in ``faces``, with their own
    vertices, which come first in ``projected``. At equal depth the earlier ones stay.

    Both sides of triangles are drawn, but those seen from behind last: most of them, the far sides of bodies and half
    of all triangles, are then known to be hidden and skipped.

    Args:
        faces: vertex indices, (k, 3) uint32.
        projected: see :func:`.vertex_kernels.project_vertices`.
        near: depth below which nothing is drawn.
        inverse_depth: (h, w) float32; sides of at most ``LONGEST_SIDE``.
        triangle: index of the visible face, (h, w) int32.
        first: number of triangles that an earlier call has drawn; those that follow have none of their vertices.
    """
    q, seen, codes = projected
    tiles = (_SMALL // _TILE) ** 2
    hits, planes = np.empty((_CHUNK * tiles + 1, 4), np.int32), np.empty((_CHUNK * tiles + 1, 5))
    kept, work = np.empty(_CHUNK + 1, np.uint32), np.empty(_ROWS_OF_WORK * _CHUNK)
    lists, counts = np.empty((4, len(faces) - first + 1), np.uint32), np.zeros(4, np.int64)
    for start in range(first, len(faces), _CHUNK):
        drawn_small = counts[0]
        candidates = kept[: drawable(start, min(start + _CHUNK, len(faces)), faces, codes, kept)]
        _sort(candidates, faces, seen, lists, counts)
        count = _cover(lists[0, drawn_small : counts[0]], faces, q, seen, codes, work, hits, planes)
        _fill(hits, planes, count, inverse_depth, triangle)
    _draw(lists[1, : counts[1]], faces, q, seen, near, inverse_depth, triangle)
    if counts[2] + counts[3]:
        blocks = _blocks(inverse_depth)
        small = lists[2, : _drop_hidden(lists[2, : counts[2]], faces, codes, seen, inverse_depth, blocks)]
        for start in range(0, len(small), _CHUNK):
            count = _cover(small[start : start + _CHUNK], faces, q, seen, codes, work, hits, planes)
            _fill(hits, planes, count, inverse_depth, triangle)
        large = lists[3, : _drop_hidden(lists[3, : counts[3]], faces, codes, seen, inverse_depth, blocks)]
        _draw(large, faces, q, seen, near, inverse_depth, triangle)


@njit(cache=True, error_model="numpy")
def _sort(candidates: np.ndarray, faces: np.ndarray, seen: np.ndarray, lists: np.ndarray, counts: np.ndarray) -> None:
    """Append triangles to four lists, (4, k), of lengths ``counts``.

    Small triangles that face the camera; large ones, and all that the near plane cuts; then small and large ones seen
    from behind.
    """
    facing_small, facing_large, averted_small, averted_large = counts[0], counts[1], counts[2], counts[3]
    slack, most = np.float32(SLACK), np.float32(_SMALL)
    for index in range(len(candidates)):
        t = candidates[index]
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, bx, cx, ay, by, cy = seen[a, 0], seen[b, 0], seen[c, 0], seen[a, 1], seen[b, 1], seen[c, 1]
        ahead_a, ahead_b, ahead_c = seen[a, 2] > 0, seen[b, 2] > 0, seen[c, 2] > 0
        whole = ahead_a & ahead_b & ahead_c
        cut = (ahead_a | ahead_b | ahead_c) & ~whole
        low, high = (ax, bx) if ax < bx else (bx, ax)
        low, high = cx if cx < low else low, cx if cx > high else high
        small = np.floor(high + slack) - np.ceil(low - slack) < most
        low, high = (ay, by) if ay < by else (by, ay)
        low, high = cy if cy < low else low, cy if cy > high else high
        small = small & (np.floor(high + slack) - np.ceil(low - slack) < most) & whole
        averted = (bx - ax) * (cy - ay) > (by - ay) * (cx - ax)  # y is down: clockwise
        lists[0, np.uint64(facing_small)] = t
        lists[1, np.uint64(facing_large)] = t
        lists[2, np.uint64(averted_small)] = t
        lists[3, np.uint64(averted_large)] = t
        facing_small += small & ~averted
        facing_large += cut | (whole & ~small & ~averted)
        averted_small += small & averted
        averted_large += whole & ~small & averted
    counts[0], counts[1], counts[2], counts[3] = facing_small, facing_large, averted_small, averted_large


@njit(cache=True, error_model="numpy")
def _blocks(inverse_depth: np.ndarray) -> np.ndarray:
    """Return the smallest inverse depth in every block of 4 x 4 pixels, with one more row and column of zeros."""
    height, width = inverse_depth.shape
    rows, columns = (height + _TILE - 1) // _TILE, (width + _TILE - 1) // _TILE
    blocks = np.zeros((rows + 1, columns + 1), np.float32)
    for row in range(height // _TILE):  # blocks cut by the border stay 0: never hidden
        for column in range(width // _TILE):
            least = inverse_depth[_TILE * row, _TILE * column]
            for y in range(_TILE):
                for x in range(_TILE):
                    value = inverse_depth[_TILE * row + y, _TILE * column + x]
                    least = value if value < least else least
            blocks[row, column] = least
    return blocks


@njit(cache=True, error_model="numpy", inline="always")
def _box(a: np.uint32, b: np.uint32, c: np.uint32) -> tuple[np.int32, np.int32]:
    """Return the first and the last pixel column or row between vertices with these halves of codes."""
    low, high = (a, b) if a < b else (b, a)
    low, high = c if c < low else low, c if c > high else high
    return np.int32(low >> np.uint32(1)), np.int32((high + np.uint32(1)) >> np.uint32(1)) - np.int32(1)


@njit(cache=True, error_model="numpy")
def _drop_hidden(
    small: np.ndarray,
    faces: np.ndarray,
    codes: np.ndarray,
    seen: np.ndarray,
    inverse_depth: np.ndarray,
    blocks: np.ndarray,
) -> int:
    """Move the triangles that may be visible to the front of a list, and return their number."""
    kept, rows, shift = 0, np.uint32(0xFFFF), np.uint32(16)
    for index in range(len(small)):
        t = small[index]
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        left, right = _box(codes[a] >> shift, codes[b] >> shift, codes[c] >> shift)
        top, bottom = _box(codes[a] & rows, codes[b] & rows, codes[c] & rows)
        nearest = seen[a, 2] if seen[a, 2] > seen[b, 2] else seen[b, 2]
        nearest = seen[c, 2] if seen[c, 2] > nearest else nearest
        # The corners of the box are tested, first pixels, then blocks of pixels: enough if it spans at most two of them
        # in each direction, as most do.
        one = _least(inverse_depth, np.uint32(left), np.uint32(right), np.uint32(top), np.uint32(bottom))
        may_be_seen = (nearest >= one) | (right - left > 1) | (bottom - top > 1)
        left, right, top, bottom = left // _TILE, right // _TILE, top // _TILE, bottom // _TILE
        one = _least(blocks, np.uint32(left), np.uint32(right), np.uint32(top), np.uint32(bottom))
        wide = (right - left > 1) | (bottom - top > 1)
        may_be_seen = may_be_seen & ((nearest >= one) | wide)
        if wide and nearest < one:
            may_be_seen = _pierces(nearest, blocks[top : bottom + 1, left : right + 1])
        small[kept] = t
        kept += may_be_seen
    return kept


@njit(cache=True, error_model="numpy")
def _pierces(nearest: np.float32, blocks: np.ndarray) -> bool:
    """Return whether an inverse depth is not below that of every block."""
    for row in range(blocks.shape[0]):
        for column in range(blocks.shape[1]):
            if nearest >= blocks[row, column]:
                return True
    return False


@njit(cache=True, error_model="numpy", inline="always")
def _least(values: np.ndarray, left: np.uint32, right: np.uint32, top: np.uint32, bottom: np.uint32) -> np.float32:
    """Return the least value at the corners of a box."""
    one, two, three, four = values[top, left], values[top, right], values[bottom, left], values[bottom, right]
    one, three = two if two < one else one, four if four < three else three
    return three if three < one else one


@njit(cache=True, error_model="numpy")
def _cover(
    small: np.ndarray,
    faces: np.ndarray,
    q: np.ndarray,
    seen: np.ndarray,
    codes: np.ndarray,
    work: np.ndarray,
    hits: np.ndarray,
    planes: np.ndarray,
) -> int:
    """Find the pixels that small triangles cover, in tiles of 4 x 4.

    Args:
        small: indices of at most ``_CHUNK`` triangles.
        faces: vertex indices, (k, 3) uint32.
        q: homogeneous pixel coordinates of the vertices, (n, 3).
        seen: pixels and inverse depths of the vertices, (n, 3) float32.
        codes: codes of the vertices, (n,), see :func:`.vertex_kernels.project_vertices`.
        work: memory for intermediate values.
        hits: output; for every tile with covered pixels the triangle, the first column and row of the tile, and one bit
            for each of its pixels, (most, 4) int32.
        planes: output; plane of inverse depth over pixels, and its lowest and highest value, (most, 5).

    Returns:
        Number of tiles.
    """
    for index in range(len(small)):
        t = small[index]
        for k in range(3):
            at = faces[t, k]
            for j in range(3):
                work[(3 * k + j) * _CHUNK + index] = q[at, j]
    _set_up(work, len(small))
    count, rows_of, shift = 0, np.uint32(0xFFFF), np.uint32(16)
    for index in range(len(small)):
        t = small[index]
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        left, right = _box(codes[a] >> shift, codes[b] >> shift, codes[c] >> shift)
        top, bottom = _box(codes[a] & rows_of, codes[b] & rows_of, codes[c] & rows_of)
        low, high = (seen[a, 2], seen[b, 2]) if seen[a, 2] < seen[b, 2] else (seen[b, 2], seen[a, 2])
        low, high = seen[c, 2] if seen[c, 2] < low else low, seen[c, 2] if seen[c, 2] > high else high
        ex, ey, ez = work[index], work[_CHUNK + index], work[2 * _CHUNK + index]
        fx, fy, fz = work[3 * _CHUNK + index], work[4 * _CHUNK + index], work[5 * _CHUNK + index]
        gx, gy, gz = work[6 * _CHUNK + index], work[7 * _CHUNK + index], work[8 * _CHUNK + index]
        px, py, pz = work[9 * _CHUNK + index], work[10 * _CHUNK + index], work[11 * _CHUNK + index]
        for tile_top in range(top, bottom + 1, _TILE):
            for tile_left in range(left, right + 1, _TILE):
                inside, first, row = np.int32(0), np.int32(tile_left), np.int32(tile_top)
                for i in range(16):  # vectorised by the compiler
                    x, y = np.float64(first + np.int32(i & 3)), np.float64(row + np.int32(i >> 2))
                    e, f, g = ex * x + (ey * y + ez), fx * x + (fy * y + fz), gx * x + (gy * y + gz)
                    inside |= np.int32((e >= 0.0) & (f >= 0.0) & (g >= 0.0)) << np.int32(i)
                columns, rows = min(right - tile_left + 1, _TILE), min(bottom - tile_top + 1, _TILE)
                covered = inside & (0x1111 * ((1 << columns) - 1)) & ((1 << (_TILE * rows)) - 1)
                hits[count, 0], hits[count, 1], hits[count, 2], hits[count, 3] = t, tile_left, tile_top, covered
                planes[count, 0], planes[count, 1], planes[count, 2] = px, py, pz
                planes[count, 3], planes[count, 4] = low, high
                count += covered != 0
    return count


@njit(cache=True, error_model="numpy")
def _set_up(work: np.ndarray, count: int) -> None:
    """Replace the corners of triangles by their edges, with positive insides, and planes of inverse depth.

    Every quantity is a row of ``_CHUNK`` numbers: nine of corners, or nine of edges and three of planes. The edges of a
    triangle that is seen edge-on are NaN.
    """
    for i in range(count):  # vectorised by the compiler, as the rows are apart by a constant
        ax, ay, az = work[i], work[_CHUNK + i], work[2 * _CHUNK + i]
        bx, by, bz = work[3 * _CHUNK + i], work[4 * _CHUNK + i], work[5 * _CHUNK + i]
        cx, cy, cz = work[6 * _CHUNK + i], work[7 * _CHUNK + i], work[8 * _CHUNK + i]
        ex, ey, ez = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        fx, fy, fz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        gx, gy, gz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        determinant = ax * ex + ay * ey + az * ez
        scale = 1.0 / determinant
        sign = 1.0 if determinant > 0 else (-1.0 if determinant < 0 else np.nan)
        work[9 * _CHUNK + i], work[10 * _CHUNK + i] = (ex + fx + gx) * scale, (ey + fy + gy) * scale
        work[11 * _CHUNK + i] = (ez + fz + gz) * scale
        work[i], work[_CHUNK + i], work[2 * _CHUNK + i] = sign * ex, sign * ey, sign * ez
        work[3 * _CHUNK + i], work[4 * _CHUNK + i], work[5 * _CHUNK + i] = sign * fx, sign * fy, sign * fz
        work[6 * _CHUNK + i], work[7 * _CHUNK + i], work[8 * _CHUNK + i] = sign * gx, sign * gy, sign * gz


@njit(cache=True, error_model="numpy")
def _fill(hits: np.ndarray, planes: np.ndarray, count: int, inverse_depth: np.ndarray, triangle: np.ndarray) -> None:
    """Write small triangles at the pixels where they are the nearest; arguments as written by :func:`_cover`."""
    for index in range(count):
        t, left, top, inside = hits[index, 0], hits[index, 1], hits[index, 2], np.int64(hits[index, 3])
        # Rounding must not move a thin triangle out of its range of depth.
        low, high = np.float32(planes[index, 3]), np.float32(planes[index, 4])
        while inside:
            i = _LOWEST[(((inside & -inside) * _DE_BRUIJN) >> 12) & 15]
            inside &= inside - 1
            x, y = left + (i & 3), top + (i >> 2)
            w = np.float32(planes[index, 0] * x + (planes[index, 1] * y + planes[index, 2]))
            w = low if w < low else (high if w > high else w)
            if w > inverse_depth[y, x]:
                inverse_depth[y, x] = w
                triangle[y, x] = t


@njit(cache=True, error_model="numpy")
def _draw(
    large: np.ndarray,
    faces: np.ndarray,
    q: np.ndarray,
    seen: np.ndarray,
    near: float,
    inverse_depth: np.ndarray,
    triangle: np.ndarray,
) -> None:
    """Write triangles of any size at the pixels where they are the nearest, row by row."""
    height, width = triangle.shape
    edge, run = np.empty((4, 3)), np.empty(4)
    for index in range(len(large)):
        t = large[index]
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        least, most = min(q[a, 2], q[b, 2], q[c, 2]), max(q[a, 2], q[b, 2], q[c, 2])
        whole = least >= near
        # Pixel box of the part beyond the near plane.
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        for k in range(3):
            i, j = (b, c) if k == 0 else ((c, a) if k == 1 else (a, b))
            if q[i, 2] >= near:
                x, y = q[i, 0] / q[i, 2], q[i, 1] / q[i, 2]
                left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
            if (q[i, 2] >= near) != (q[j, 2] >= near):
                share = (near - q[i, 2]) / (q[j, 2] - q[i, 2])
                x, y = (q[i, 0] + share * (q[j, 0] - q[i, 0])) / near, (q[i, 1] + share * (q[j, 1] - q[i, 1])) / near
                left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        left, right = max(np.ceil(left - SLACK), 0.0), min(np.floor(right + SLACK), width - 1.0)
        top, bottom = max(np.ceil(top - SLACK), 0.0), min(np.floor(bottom + SLACK), height - 1.0)
        if left > right or top > bottom:
            continue
        for k in range(3):
            i, j = (b, c) if k == 0 else ((c, a) if k == 1 else (a, b))
            edge[k, 0] = q[i, 1] * q[j, 2] - q[i, 2] * q[j, 1]
            edge[k, 1] = q[i, 2] * q[j, 0] - q[i, 0] * q[j, 2]
            edge[k, 2] = q[i, 0] * q[j, 1] - q[i, 1] * q[j, 0]
        determinant = q[a, 0] * edge[0, 0] + q[a, 1] * edge[0, 1] + q[a, 2] * edge[0, 2]
        if determinant == 0.0:  # seen edge-on
            continue
        scale = 1.0 / determinant
        px = (edge[0, 0] + edge[1, 0] + edge[2, 0]) * scale
        py = (edge[0, 1] + edge[1, 1] + edge[2, 1]) * scale
        pz = (edge[0, 2] + edge[1, 2] + edge[2, 2]) * scale
        if determinant < 0:
            for k in range(3):
                edge[k, 0], edge[k, 1], edge[k, 2] = -edge[k, 0], -edge[k, 1], -edge[k, 2]
        edge[3, 0], edge[3, 1], edge[3, 2] = -px, -py, 1.0 / near - pz  # the near plane as a fourth edge
        for n in range(4):
            run[n] = -1.0 / edge[n, 0]
        label = np.int32(t)
        # Rounding must not move a thin triangle out of its range of depth.
        low, high = np.float32(1.0 / most), np.float32(1.0 / (least if whole else near))
        for row in range(int(top), int(bottom) + 1):
            start, end = left, right
            for n in range(3 if whole else 4):
                rise, offset = edge[n, 0], edge[n, 1] * row + edge[n, 2]
                if rise > 0:
                    edge_x = np.ceil(offset * run[n])
                    # The sign of the edge at a pixel decides, as in a tile, independent of rounding here.
                    if rise * edge_x + offset < 0:
                        edge_x += 1.0
                    elif rise * (edge_x - 1.0) + offset >= 0:
                        edge_x -= 1.0
                    start = edge_x if edge_x > start else start
                elif rise < 0:
                    edge_x = np.floor(offset * run[n])
                    if rise * edge_x + offset < 0:
                        edge_x -= 1.0
                    elif rise * (edge_x + 1.0) + offset >= 0:
                        edge_x += 1.0
                    end = edge_x if edge_x < end else end
                elif offset < 0:
                    end = -1.0
            if start > end:
                continue
            first = int(start)
            depths, triangles = inverse_depth[row, first : int(end) + 1], triangle[row, first : int(end) + 1]
            offset = px * first + (py * row + pz)
            for x in range(len(depths)):  # branch-free, so that the compiler vectorises it
                w, before, other = np.float32(px * np.int32(x) + offset), depths[x], triangles[x]
                w = low if w < low else (high if w > high else w)
                depths[x] = w if w > before else before
                triangles[x] = label if w > before else other
