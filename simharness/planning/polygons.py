"""Simple polygons on the floor: orientation, crossings, points within, distance from the edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats

_SAME = 1e-6  # metres: closer points are the same


def signed_area(outline: ArrayLike) -> float:
    """Return the area of a polygon (n, 2), m²; positive where its corners are counter-clockwise."""
    x, y = np.asarray(outline, float).T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def counter_clockwise(outline: ArrayLike) -> Floats:
    """Return the corners of a polygon in counter-clockwise order, the first one first."""
    outline = np.asarray(outline, float)
    return outline if signed_area(outline) > 0 else np.roll(outline[::-1], 1, axis=0)


def without_repeats(outline: ArrayLike) -> Floats:
    """Return a polygon without corners that repeat the one before, the last before the first included."""
    outline = np.asarray(outline, float).reshape(-1, 2)
    if len(outline) < 2:
        return outline
    kept = np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1) > _SAME
    return outline[kept] if kept.any() else outline[:1]


def edges_of(outline: ArrayLike) -> tuple[Floats, Floats]:
    """Return the start and the end of each edge of a polygon (n, 2), both (n, 2); edge k begins at corner k."""
    outline = np.asarray(outline, float)
    return outline, np.roll(outline, -1, axis=0)


def crossing_edges(outline: ArrayLike) -> tuple[int, int] | None:
    """Return two edges of a polygon that cross or touch away from a common corner; None for a simple polygon."""
    starts, ends = edges_of(outline)
    count = len(starts)
    for i in range(count):
        for j in range(i + 1, count):
            if j - i == 1 or (i == 0 and j == count - 1):
                shared, one, two = (ends[i], starts[i], ends[j]) if j - i == 1 else (starts[i], ends[i], starts[j])
                if _folds_back(shared, one, two):
                    return i, j
            elif _meet(starts[i], ends[i], starts[j], ends[j]):
                return i, j
    return None


def contains(outline: ArrayLike, points: ArrayLike) -> Bools:
    """Return whether points (..., 2) are within a polygon (n, 2): the even-odd rule (Shimrat, CACM 1962)."""
    points = np.asarray(points, float)
    starts, ends = edges_of(outline)
    inside = np.zeros(points.shape[:-1], bool)
    x, y = points[..., 0], points[..., 1]
    for (x0, y0), (x1, y1) in zip(starts, ends, strict=True):
        if y0 == y1:
            continue
        across = (y0 > y) != (y1 > y)
        inside ^= across & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside


def distance_to_edges(outline: ArrayLike, points: ArrayLike) -> Floats:
    """Return the distance of points (..., 2) to the nearest edge of a polygon (n, 2), (...), metres."""
    starts, ends = edges_of(outline)
    return np.min([distance_to_segment(a, b, points) for a, b in zip(starts, ends, strict=True)], axis=0)


def distance_to_segment(start: ArrayLike, end: ArrayLike, points: ArrayLike) -> Floats:
    """Return the distance of points (..., 2) to a segment between two points (2,), (...), metres."""
    start, end, points = (np.asarray(each, float) for each in (start, end, points))
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), _SAME**2), 0.0, 1.0)
    return np.linalg.norm(points - start - share[..., None] * along, axis=-1)


def is_convex(outline: ArrayLike) -> bool:
    """Return whether a counter-clockwise polygon turns left at each corner."""
    starts, ends = edges_of(outline)
    along = ends - starts
    after = np.roll(along, -1, axis=0)
    return bool((along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0] >= -_SAME).all())


def _folds_back(shared: Floats, one: Floats, two: Floats) -> bool:
    """Return whether two edges from a common corner lie on each other."""
    a, b = one - shared, two - shared
    return bool(abs(a[0] * b[1] - a[1] * b[0]) <= _SAME and a @ b > 0)


def _meet(a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    """Return whether two segments have a point in common."""
    turns = [_turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)]
    if turns[0] * turns[1] < 0 and turns[2] * turns[3] < 0:
        return True
    pairs = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(distance_to_segment(start, end, point) <= _SAME for start, end, point in pairs)


def _turn(a: Floats, b: Floats, c: Floats) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
