"""Walls of a room as frames, and the windows and doors in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.kinds import room_kinds
from simharness.world.scene.rooms.room_lighting import room_lighting

_WINDOW = (1.1, 1.5)  # metres: least and largest width
_APART = 0.45  # metres between windows
_CORNER = 0.6  # metres from a window or a door to the corners of the room
_LINTEL = 0.35  # metres of wall over a window
_DOOR = (0.95, 2.05)  # metres: width and height
_ON_WALL = 0.12  # metres: what is nearer to the wall hangs on it
_FREE = 0.9  # metres of free floor in front of a door


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


def room_walls(room: RoomSection) -> tuple[Wall, ...]:
    """Return the four walls of a room."""
    x, y, z = room.size[0] / 2, room.size[1] / 2, room.size[2]
    corners = {"+x": ((x, y), (0.0, -1.0), 2 * y), "-x": ((-x, -y), (0.0, 1.0), 2 * y)}
    corners |= {"+y": ((-x, y), (1.0, 0.0), 2 * x), "-y": ((x, -y), (-1.0, 0.0), 2 * x)}
    return tuple(Wall(f"wall {side}", left, along, length, z) for side, (left, along, length) in corners.items())


@dataclass(frozen=True)
class Opening:
    """Window or door in a wall."""

    kind: Literal["window", "door"]
    """"window" or "door"."""
    wall: Wall
    """Its wall."""
    span: tuple[float, float]
    """Left and right edge along the wall, metres."""
    heights: tuple[float, float]
    """Lower and upper edge, metres."""

    def keeps_free(self, hull: Box) -> bool:
        """Return whether an object with this hull leaves the opening free: below a window, or away from a door."""
        if self.kind == "window" and hull.corners[:, 2].max() <= self.heights[0] + 0.25:
            return True
        depth = _FREE if self.kind == "door" else 0.6
        return self.wall.box(self.span, self.heights, depth).gap_on_floor(hull) > 0.0


def draw_openings(room: RoomSection, seed: int, solids: Sequence[Solid] = ()) -> tuple[Opening, ...]:
    """Draw the windows and the door of a room; those that a solid on the wall would cover are left out.

    The first wall with windows is that from which the light comes.

    Args:
        room: room with a drawn kind; without walls it has no openings.
        seed: seed of the scenario.
        solids: solids that may hang on the walls.
    """
    if not room.walls:
        return ()
    kind, walls = room_kinds()[room.kind], room_walls(room)
    rng = stream(seed, "room", "openings")
    towards = room_lighting(room, seed).direction[:2]
    sunny = int(np.argmax([-wall.inward @ towards * min(room.size[:2]) / wall.length for wall in walls]))
    order = [sunny, *(k for k in rng.permutation(len(walls)) if k != sunny)]
    count = int(rng.integers(kind.windows[0], kind.windows[1] + 1))
    width, shares = rng.uniform(*_WINDOW), rng.uniform(size=2)
    openings: list[Opening] = []
    for k in order[:count]:
        openings += _windows(walls[k], kind.sill, width)
    door = walls[order[-1]]
    if kind.doors and door.height >= _DOOR[1] + 0.05 and door.length >= _DOOR[0] + 2 * _CORNER:
        left = _CORNER + shares[0] * (door.length - 2 * _CORNER - _DOOR[0])
        openings.append(Opening("door", door, (left, left + _DOOR[0]), (0.0, _DOOR[1])))
    return tuple(opening for opening in openings if not any(_covers(solid, opening) for solid in solids))


def _windows(wall: Wall, sill: float, width: float) -> list[Opening]:
    """Return a row of equal windows in the middle of a wall; none if the wall is too low or too short."""
    top = min(wall.height - _LINTEL, 2.45)
    room = wall.length - 2 * _CORNER
    count = min(int((room + _APART) // (width + _APART)), 6)
    if top - sill < 0.6 or count < 1:
        return []
    pitch = width + _APART + max(0.0, (room - count * (width + _APART) + _APART) / (count + 1)) * 0.5
    first = wall.length / 2 - (count - 1) / 2 * pitch - width / 2
    return [Opening("window", wall, (first + k * pitch, first + k * pitch + width), (sill, top)) for k in range(count)]


def _covers(solid: Solid, opening: Opening) -> bool:
    """Return whether a solid that hangs on the wall covers a part of an opening."""
    if solid.kind == "room" or solid.trajectory is not None:
        return False
    rim = 0.1
    (left, right), (low, high) = opening.span, opening.heights
    front = opening.wall.box((left - rim, right + rim), (low, high), _ON_WALL)
    z = solid.hull.corners[:, 2]
    return bool(front.gap_on_floor(solid.hull) == 0.0 and z.max() > low and z.min() < high)
