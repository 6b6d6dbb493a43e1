"""Frame of simulated scenes: the smallest rectangle around a volume becomes a rectangle around the origin."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mvpose import Rig
from mvpose.arrays import Floats


@dataclass(frozen=True)
class SceneFrame:
    """Position of a volume's rectangle in the world of the rig.

    Attributes:
        center: middle of the rectangle, (2,), metres.
        bearing: direction of its first side from the world's x axis, radians.
        half: half its sides, (2,), metres.
    """

    center: Floats
    bearing: float
    half: Floats

    @classmethod
    def around(cls, outline: Floats) -> SceneFrame:
        """Return the frame of the rectangle of least area around a polygon (n, 2), metres.

        One side of that rectangle lies on a side of the convex hull (Freeman and Shapira, Communications of the ACM
        1975); of equal ones the first is taken, so that an upright rectangle keeps its axes.
        """
        from scipy.spatial import ConvexHull

        hull = outline[ConvexHull(outline).vertices]
        sides = np.roll(hull, -1, axis=0) - hull
        # In the first quadrant, smallest first: a rectangle's sides are equivalent, and 0 keeps the axes.
        bearings = np.unique(np.round(np.arctan2(sides[:, 1], sides[:, 0]) % (np.pi / 2), 9))
        frames = [cls._at(hull, float(bearing)) for bearing in bearings]
        return min(frames, key=lambda frame: round(float(frame.half.prod()), 9))

    @classmethod
    def _at(cls, points: Floats, bearing: float) -> SceneFrame:
        local = points @ _turn(bearing)
        low, high = local.min(axis=0), local.max(axis=0)
        return cls(_turn(bearing) @ ((low + high) / 2), bearing, (high - low) / 2)

    @property
    def axes(self) -> Floats:
        """Axes of the rectangle in the world as columns, (2, 2)."""
        return _turn(self.bearing)

    def to_world(self, places: Floats) -> Floats:
        """Return places (..., 2) of the scene in the world, metres."""
        return places @ self.axes.T + self.center

    def to_scene(self, places: Floats) -> Floats:
        """Return places (..., 2) of the world in the scene, metres."""
        return (places - self.center) @ self.axes

    def rig(self, rig: Rig) -> Rig:
        """Return a rig of the world in the scene."""
        turn, shift = np.eye(3), np.array([*self.center, 0.0])
        turn[:2, :2] = self.axes
        return Rig([replace(each, R=each.R @ turn, t=each.R @ shift + each.t) for each in rig])


def _turn(bearing: float) -> Floats:
    c, s = np.cos(bearing), np.sin(bearing)
    return np.array([[c, -s], [s, c]])
