"""Flat upright mirrors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats


@dataclass(frozen=True)
class Mirror:
    """Glass of an upright mirror."""

    center: tuple[float, float, float]
    """Centre of the glass, (3,), metres."""
    normal: tuple[float, float, float]
    """Horizontal unit vector towards the reflecting side, (3,)."""
    half: tuple[float, float]
    """Half the width and half the height, metres."""

    def in_front(self, points: ArrayLike) -> Floats:
        """Return the signed distance of points (..., 3) to the plane of the glass, (...) metres; positive in front."""
        return np.asarray((np.asarray(points, float) - self.center) @ np.array(self.normal))

    def reflect(self, points: ArrayLike) -> Floats:
        """Return the mirror images of points (..., 3)."""
        points = np.asarray(points, float)
        return points - 2 * self.in_front(points)[..., None] * np.array(self.normal)

    def on_glass(self, points: ArrayLike) -> Bools:
        """Return whether points (..., 3) in the plane of the glass lie on the glass, (...)."""
        local = np.asarray(points, float) - self.center
        across = np.cross([0.0, 0.0, 1.0], self.normal)
        with np.errstate(invalid="ignore"):
            return (np.abs(local @ across) <= self.half[0]) & (np.abs(local[..., 2]) <= self.half[1])

    def shows(self, viewpoint: ArrayLike, points: ArrayLike) -> Bools:
        """Return whether the mirror shows points (..., 3) to a viewpoint (3,), occlusion ignored, (...)."""
        viewpoint, points = np.asarray(viewpoint, float), np.asarray(points, float)
        viewer_distance, point_distance = self.in_front(viewpoint), self.in_front(points)
        images = self.reflect(points)
        with np.errstate(all="ignore"):
            share = viewer_distance / (viewer_distance + point_distance)
            hits = viewpoint + (images - viewpoint) * share[..., None]
        return (viewer_distance > 0) & (point_distance > 0) & self.on_glass(hits)

    def moved(self, place: ArrayLike, yaw: float) -> "Mirror":
        """Return the mirror rotated by ``yaw`` about the world z axis, then moved by ``place`` (2,) on the floor."""
        c, s = np.cos(yaw), np.sin(yaw)
        (x, y, z), (nx, ny, _), (dx, dy) = self.center, self.normal, np.asarray(place, float)
        return Mirror(
            (float(c * x - s * y + dx), float(s * x + c * y + dy), z),
            (float(c * nx - s * ny), float(s * nx + c * ny), 0.0),
            self.half,
        )

    def stretched(self, scale: ArrayLike) -> "Mirror":
        """Return a mirror that faces x, stretched along x, y and z by ``scale`` (3,)."""
        x, y, z = np.asarray(scale, float).tolist()
        (cx, cy, cz), (dx, dy) = self.center, self.half
        return Mirror((x * cx, y * cy, z * cz), self.normal, (y * dx, z * dy))
