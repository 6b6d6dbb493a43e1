"""Volume in which people will stand and walk: a polygon on the floor with a height."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array

HEIGHT = 2.0
"""Height of a volume unless another is given, metres: that of a tall person."""

_MARGIN = 0.3  # metres around the hips of recorded people: half the width of a person
_LARGEST = 200.0  # metres, as for rigs: more is a mistake of units


@dataclass(frozen=True)
class Volume:
    """Volume that cameras have to see.

    Attributes:
        outline: corners of the floor in order, (n, 2), metres; the last corner is joined to the first.
        height: height over the floor z = 0, metres.
        tracks: joints of recorded people who walk in it, COCO-17, (T, P, 17, 3), metres, NaN where a person is absent;
            None: people may stand anywhere in it.

    Raises:
        ValueError: fewer than three corners, values that are not finite, no area, or a height that is not positive.
    """

    outline: Floats
    height: float = HEIGHT
    tracks: Floats | None = None

    def __post_init__(self) -> None:
        outline = as_array(self.outline, ("n", 2), "outline of the volume")
        if len(outline) < 3:
            raise ValueError(f"outline of the volume must have at least 3 corners (x, y), got {len(outline)}")
        if not np.isfinite(outline).all() or np.abs(outline).max() > _LARGEST:
            raise ValueError(
                f"outline of the volume must be finite and within {_LARGEST:g} m of the origin, got {outline.tolist()}"
            )
        object.__setattr__(self, "outline", outline)
        if self.area < 1e-6:
            raise ValueError(f"outline of the volume must enclose an area, got {outline.tolist()}")
        if not 0.0 < self.height <= _LARGEST:
            raise ValueError(f"height of the volume must be positive, metres, got {self.height}")
        if self.tracks is not None:
            object.__setattr__(self, "tracks", as_array(self.tracks, ("T", "P", 17, 3), "tracks of the volume"))

    @classmethod
    def box(
        cls, size_x: float, size_y: float, *, height: float = HEIGHT, center: tuple[float, float] = (0.0, 0.0)
    ) -> Self:
        """Return a rectangle with sides along x and y, metres, around a centre."""
        x, y = size_x / 2, size_y / 2
        return cls(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) + center, height)

    @classmethod
    def around(cls, joints: ArrayLike, *, margin: float = _MARGIN) -> Self:
        """Return the volume in which recorded people walk: the convex hull of their hips, with a margin.

        Scenes are then drawn from the recorded frames (:mod:`simharness.planning.standing_people`).

        Args:
            joints: COCO-17 joints of P people in T frames, (T, P, 17, 3), metres; NaN where a person is absent.
            margin: metres around the hips.

        Raises:
            ValueError: a wrong shape, or no person in any frame.
        """
        from scipy.spatial import ConvexHull

        tracks = as_array(joints, ("T", "P", 17, 3), "joints of recorded people")
        hips = tracks[:, :, 11:13, :2].mean(axis=2).reshape(-1, 2)
        hips = hips[np.isfinite(hips).all(axis=1)]
        if not len(hips):
            raise ValueError("joints of recorded people: expected hips in at least one frame, got none")
        angle = np.arange(16) * np.pi / 8
        corner = margin * np.column_stack([np.cos(angle), np.sin(angle)])
        spread = (hips[:, None] + corner).reshape(-1, 2)
        heights = tracks[..., 2]
        return cls(spread[ConvexHull(spread).vertices], float(np.nanmax(heights)) + 0.1, tracks)

    @property
    def area(self) -> float:
        """Area of the floor, square metres."""
        x, y = self.outline.T
        return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)

    def contains(self, points: ArrayLike) -> Bools:
        """Return which points (..., 2) on the floor lie within the outline (even-odd rule)."""
        points = np.asarray(points, float)
        x, y = points[..., 0], points[..., 1]
        inside = np.zeros(x.shape, bool)
        for (x0, y0), (x1, y1) in zip(self.outline, np.roll(self.outline, -1, axis=0), strict=True):
            if y0 != y1:
                inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
        return inside

    def places(self, spacing: float) -> Floats:
        """Return the centres of the square cells of a grid that lie within the outline, (P, 2), metres; at least one.

        The grid is centred on the bounding box, so that a symmetric volume has symmetric places.

        Raises:
            ValueError: a spacing that is not positive.
        """
        if not spacing > 0:
            raise ValueError(f"spacing of places must be positive, metres, got {spacing}")
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        count = np.maximum(np.round((high - low) / spacing), 1).astype(int)
        x, y = (
            middle + spacing * (np.arange(n) - (n - 1) / 2) for middle, n in zip((low + high) / 2, count, strict=True)
        )
        grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        inside = self.contains(grid)
        return grid[inside] if inside.any() else self.outline.mean(axis=0, keepdims=True)
