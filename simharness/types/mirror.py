"""The glass of a flat, upright mirror."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats


@dataclass(frozen=True)
class Mirror:
    """The glass of an upright mirror.

    Attributes:
        center: metres, (3,).
        normal: horizontal unit vector to the side that reflects, (3,).
        half: half its width and half its height, metres.
    """

    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    half: tuple[float, float]

    def in_front(self, points: ArrayLike) -> Floats:
        """Signed distance of points (..., 3) from the glass's plane, (...) metres; positive where it reflects."""
        return np.asarray((np.asarray(points, float) - self.center) @ np.array(self.normal))

    def reflect(self, points: ArrayLike) -> Floats:
        """Where points (..., 3) appear to be."""
        points = np.asarray(points, float)
        return points - 2 * self.in_front(points)[..., None] * np.array(self.normal)

    def on_glass(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points (..., 3) in the glass's plane lie on the glass."""
        local = np.asarray(points, float) - self.center
        across = np.cross([0.0, 0.0, 1.0], self.normal)
        with np.errstate(invalid="ignore"):
            return (np.abs(local @ across) <= self.half[0]) & (np.abs(local[..., 2]) <= self.half[1])

    def shows(self, eye: ArrayLike, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points (..., 3) an eye (3,) sees in the glass, were nothing in the way."""
        eye, points = np.asarray(eye, float), np.asarray(points, float)
        mine, theirs = self.in_front(eye), self.in_front(points)
        behind = self.reflect(points)
        with np.errstate(all="ignore"):
            meets = eye + (behind - eye) * (mine / (mine + theirs))[..., None]
        return (mine > 0) & (theirs > 0) & self.on_glass(meets)

    def moved(self, place: ArrayLike, yaw: float) -> Mirror:
        """The same turned about the world's z axis and then carried to ``place`` (2,) on the floor."""
        c, s = np.cos(yaw), np.sin(yaw)
        (x, y, z), (nx, ny, _), (dx, dy) = self.center, self.normal, np.asarray(place, float)
        return Mirror(
            (float(c * x - s * y + dx), float(s * x + c * y + dy), z),
            (float(c * nx - s * ny), float(s * nx + c * ny), 0.0),
            self.half,
        )
