"""Walls of a room as frames: positions along, up and into the room, turned into positions in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.scenario.sections.room_section import RoomSection
from simharness.world.scene.objects.geoms import Box


@dataclass(frozen=True)
class Wall:
    """Wall as seen from inside the room.

    Attributes:
        name: "wall +x" and so on, by the direction in which it lies.
        left: foot of its left corner, (2,), metres.
        along: unit vector from its left to its right corner, (2,).
        length, height: metres.
    """

    name: str
    left: tuple[float, float]
    along: tuple[float, float]
    length: float
    height: float

    @property
    def inward(self) -> Floats:
        """Unit vector into the room, (2,)."""
        return np.array([self.along[1], -self.along[0]])

    @property
    def yaw(self) -> float:
        """Yaw of an object whose front looks into the room, radians."""
        return float(np.arctan2(self.inward[1], self.inward[0]))

    def at(self, places: ArrayLike) -> Floats:
        """Return points (..., 3) in the world, given along, into the room and up, metres."""
        places = np.asarray(places, float)
        floor = self.left + places[..., :1] * np.array(self.along) + places[..., 1:2] * self.inward
        return np.concatenate([floor, places[..., 2:]], axis=-1)

    def box(self, span: tuple[float, float], heights: tuple[float, float], depth: float) -> Box:
        """Return the box in front of a part of the wall, ``depth`` metres into the room."""
        middle = self.at(((span[0] + span[1]) / 2, depth / 2, (heights[0] + heights[1]) / 2))
        half = ((span[1] - span[0]) / 2, depth / 2, (heights[1] - heights[0]) / 2)
        return Box((float(middle[0]), float(middle[1]), float(middle[2])), half, float(np.arctan2(*self.along[::-1])))


def walls_of(room: RoomSection) -> tuple[Wall, ...]:
    """Return the four walls of a room."""
    x, y, z = room.size[0] / 2, room.size[1] / 2, room.size[2]
    corners = {"+x": ((x, y), (0.0, -1.0), 2 * y), "-x": ((-x, -y), (0.0, 1.0), 2 * y)}
    corners |= {"+y": ((-x, y), (1.0, 0.0), 2 * x), "-y": ((x, -y), (-1.0, 0.0), 2 * x)}
    return tuple(Wall(f"wall {side}", left, along, length, z) for side, (left, along, length) in corners.items())
