"""Floors: simple polygons at z = 0, and the upright volumes over them. The geometry is that of Shapely."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import shapely
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array

HEIGHT = 2.0
"""Height of a volume unless another is given, metres: that of a tall person."""

_MARGIN = 0.3  # metres around the hips of recorded people: half the width of a person
_LARGEST = 200.0  # metres, as for rigs: more is a mistake of units
_SMALLEST = 1e-6  # m²: polygons of less area are lines
_ROUNDING = 1e-6  # metres: closer points are the same


@dataclass(frozen=True)
class Floor:
    """Simple polygon on the floor.

    Raises:
        ValueError: fewer than three different corners, corners that are not finite or far away, sides that cross or
            touch, or no area.
    """

    outline: Floats
    """Corners, (n, 2), metres; counter-clockwise, in whichever order they are given. The last one is joined to the
    first."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", simple_outline(self.outline))

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The polygon for Shapely."""
        polygon = shapely.Polygon(self.outline)
        shapely.prepare(polygon)
        return polygon

    @cached_property
    def edge(self) -> shapely.LinearRing:
        """The outline for Shapely."""
        return shapely.LinearRing(self.outline)

    @property
    def area(self) -> float:
        """Area, m²."""
        return float(self.polygon.area)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest coordinates, (2,) each, metres."""
        return self.outline.min(axis=0), self.outline.max(axis=0)

    @property
    def size(self) -> Floats:
        """Extent along x and y, (2,), metres."""
        return np.ptp(self.outline, axis=0)

    @property
    def middle(self) -> Floats:
        """Middle of the bounding rectangle, (2,), metres."""
        low, high = self.bounds
        return (low + high) / 2

    @property
    def sides(self) -> Floats:
        """Start and end of each side, (n, 2, 2), metres; side k begins at corner k."""
        return np.stack([self.outline, np.roll(self.outline, -1, axis=0)], axis=1)

    @property
    def convex(self) -> bool:
        """Whether the polygon is convex."""
        return bool(self.polygon.convex_hull.area - self.area <= _ROUNDING)

    def contains(self, points: ArrayLike) -> Bools:
        """Return which points (..., 2) lie within the polygon or on its outline, (...)."""
        points = np.asarray(points, float)
        return np.asarray(shapely.intersects_xy(self.polygon, points[..., 0], points[..., 1]))

    def distance(self, points: ArrayLike) -> Floats:
        """Return the distance of points (..., 2) from the polygon, (...), metres; 0 within."""
        return np.asarray(shapely.distance(self.polygon, shapely.points(np.asarray(points, float))))

    def distance_to_sides(self, points: ArrayLike) -> Floats:
        """Return the distance of points (..., 2) from the nearest side, (...), metres."""
        return np.asarray(shapely.distance(self.edge, shapely.points(np.asarray(points, float))))

    def beyond(self, other: "Floor") -> Floats | None:
        """Return the point (2,) of another polygon that is farthest outside of this one, metres; None: all is inside.

        Points that are less than a micrometre outside count as inside.
        """
        outside = shapely.get_coordinates(other.polygon.difference(self.polygon.buffer(_ROUNDING)))
        return outside[self.distance(outside).argmax()] if len(outside) else None

    def places(self, spacing: float) -> Floats:
        """Return the centres of the square cells of a grid that lie within the outline, (P, 2), metres; at least one.

        The grid is centred on the bounding rectangle, so that a symmetric polygon has symmetric places.

        Raises:
            ValueError: a spacing that is not positive.
        """
        if not spacing > 0:
            raise ValueError(f"spacing of places must be positive, metres, got {spacing}")
        count = np.maximum(np.round(self.size / spacing), 1).astype(int)
        x, y = (at + spacing * (np.arange(n) - (n - 1) / 2) for at, n in zip(self.middle, count, strict=True))
        grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        inside = self.contains(grid)
        return grid[inside] if inside.any() else self.outline.mean(axis=0, keepdims=True)


@dataclass(frozen=True)
class Volume(Floor):
    """Upright prism: a room, or the part of a room that cameras have to see.

    Raises:
        ValueError: see :class:`Floor`, or a height that is not positive.
    """

    height: float = HEIGHT
    """Height over the floor, metres."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.height <= _LARGEST:
            raise ValueError(f"height of the volume must be positive, metres, got {self.height}")

    @classmethod
    def box(
        cls, size_x: float, size_y: float, *, height: float = HEIGHT, center: tuple[float, float] = (0.0, 0.0)
    ) -> Self:
        """Return a cuboid with sides along x and y, metres, around a centre."""
        x, y = size_x / 2, size_y / 2
        return cls(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) + center, height)

    @classmethod
    def around(cls, joints: ArrayLike, *, margin: float = _MARGIN) -> Self:
        """Return the volume in which recorded people walk: the convex hull of their hips, with a margin.

        Args:
            joints: COCO-17 joints of P people in T frames, (T, P, 17, 3), metres; NaN where a person is absent.
            margin: metres around the hips.

        Raises:
            ValueError: a wrong shape, or no person in any frame.
        """
        tracks = as_array(joints, ("T", "P", 17, 3), "joints of recorded people")
        hips = tracks[:, :, 11:13, :2].mean(axis=2).reshape(-1, 2)
        hips = hips[np.isfinite(hips).all(axis=1)]
        if not len(hips):
            raise ValueError("joints of recorded people: expected hips in at least one frame, got none")
        angle = np.arange(16) * np.pi / 8
        spread = hips[:, None] + margin * np.column_stack([np.cos(angle), np.sin(angle)])
        hull = shapely.MultiPoint(spread.reshape(-1, 2)).convex_hull
        return cls(shapely.get_coordinates(hull)[:-1], float(np.nanmax(tracks[..., 2])) + 0.1)


def simple_outline(corners: ArrayLike, *, what: str = "outline", smallest: float = _SMALLEST) -> Floats:
    """Return the corners of a simple polygon counter-clockwise and without repeats, (n, 2), metres.

    Args:
        corners: corners in order, (n, 2), metres, the first of them again at the end or not.
        what: name of the polygon in messages.
        smallest: smallest area, m².

    Raises:
        ValueError: see :class:`Floor`.
    """
    outline = as_array(corners, ("n", 2), what)
    if not np.isfinite(outline).all() or np.abs(outline).max(initial=0.0) > _LARGEST:
        raise ValueError(f"{what} must be finite and within {_LARGEST:g} m of the origin, got {outline.tolist()}")
    outline = outline[np.linalg.norm(outline - np.roll(outline, -1, axis=0), axis=1) > _ROUNDING]
    if len(outline) < 3:
        raise ValueError(
            f"{what} is not closed: {len(outline)} different corners enclose no floor; expected at least 3 corners "
            "(x, y) in order along the walls"
        )
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid and not _flat(outline):
        where = shapely.is_valid_reason(polygon).partition("[")[2].rstrip("]")
        x, y = (float(each) for each in where.split())
        raise ValueError(f"{what} crosses itself at ({x:g}, {y:g}); give the corners in order along the walls")
    if polygon.area < smallest:
        raise ValueError(
            f"{what} encloses {polygon.area:.2g} m²; expected at least {smallest:g} m²: give corners in metres"
        )
    return outline if polygon.exterior.is_ccw else np.roll(outline[::-1], 1, axis=0)


def _flat(outline: Floats) -> bool:
    """Return whether all corners (n, 2) are on one line."""
    return bool(np.linalg.matrix_rank(outline - outline[0], tol=_ROUNDING) < 2)
