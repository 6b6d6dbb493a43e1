"""Mounts: walls, ceilings and areas for tripods, on which a camera moves by two or three parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.planning.room_keys import CeilingPlaces, Outline, PlacesKeys, TripodPlaces, WallPlaces
from simharness.types.floor import Floor, Volume, simple_outline

LEAST_AREA = 0.5
"""Smallest area of a room, of a volume or for cameras, m²."""

MountKind = Literal["wall", "ceiling", "tripod"]


@dataclass(frozen=True)
class Mount:
    """Part of a room where cameras may hang: a parallelepiped, of which parts may be taken.

    A place is ``origin + a * along + b * across + c * up`` with a, b and c from 0 to 1. A wall has no ``across`` and a
    ceiling no ``up``: these are zero there.

    Attributes:
        kind: kind of the mount.
        name: name in messages and tables, "wall 2".
        origin: the place with all parameters 0, (3,), metres.
        along, across, up: edges, (3,), metres.
        area: area that places must be within; None: any.
    """

    kind: MountKind
    name: str
    origin: Floats
    along: Floats
    across: Floats
    up: Floats
    area: Floor | None = None

    @property
    def frame(self) -> Floats:
        """The edges as columns, (3, 3)."""
        return np.column_stack([self.along, self.across, self.up])

    @property
    def lengths(self) -> Floats:
        """Lengths of the edges, (3,), metres."""
        return np.linalg.norm(self.frame, axis=0)

    def at(self, parameters: ArrayLike) -> Floats:
        """Return the places (..., 3) of parameters (..., 3), which are clipped to 0 to 1."""
        return self.origin + np.clip(np.asarray(parameters, float), 0.0, 1.0) @ self.frame.T

    def nearest(self, place: ArrayLike) -> Floats:
        """Return the parameters (3,) of the point of the mount nearest to a place (3,)."""
        lengths = self.lengths
        unit = self.frame / np.where(lengths > 0, lengths, 1.0)
        shares = (np.asarray(place, float) - self.origin) @ unit / np.where(lengths > 0, lengths, 1.0)
        return np.clip(np.where(lengths > 0, shares, 0.0), 0.0, 1.0)

    def grid(self, spacing: float, *, levels: float) -> Floats:
        """Return places (n, 3) at most ``spacing`` metres apart, and at most ``levels`` metres in height."""
        steps = (spacing, spacing, levels)
        counts = [
            max(1, int(np.ceil(length / step - 1e-9)) + 1) if length else 1
            for length, step in zip(self.lengths, steps, strict=True)
        ]
        axes = [np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5]) for count in counts]
        return self.at(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))


def make_mounts(keys: PlacesKeys, space: Volume) -> tuple[Mount, ...]:
    """Return the mounts of a room; without any key, its walls.

    Raises:
        ValueError: a wall that the room does not have, or heights or areas outside of it; the message names the key.
    """
    height = space.height
    given = keys.walls is not None or keys.ceiling is not None or bool(keys.tripods)
    mounts: list[Mount] = []
    if keys.walls is not None or not given:
        mounts += _walls(keys.walls or WallPlaces(heights=(min(1.0, height / 2), min(2.8, height))), space)
    if keys.ceiling is not None:
        mounts.append(_ceiling(keys.ceiling, space))
    mounts += [_tripods(each, k, space) for k, each in enumerate(keys.tripods)]
    return tuple(mounts)


def _walls(keys: WallPlaces, space: Volume) -> list[Mount]:
    low, high = _heights(keys.heights, space, "places.walls.heights")
    wrong = [k for k in keys.walls if k >= len(space.outline)]
    if wrong:
        raise ValueError(
            f"places.walls.walls: the room has no wall {wrong[0]}; its walls are 0 to {len(space.outline) - 1}"
        )
    mounts = []
    for k, (start, end) in enumerate(space.sides):
        along = end - start
        length = float(np.linalg.norm(along))
        if (keys.walls and k not in keys.walls) or length <= 2 * keys.clearance:
            continue
        unit = along / length
        inward = np.array([-unit[1], unit[0]])
        origin = np.append(start + keys.clearance * (inward + unit), low)
        edge = np.append((length - 2 * keys.clearance) * unit, 0.0)
        mounts.append(Mount("wall", f"wall {k}", origin, edge, np.zeros(3), np.array([0.0, 0.0, high - low])))
    return mounts


def _ceiling(keys: CeilingPlaces, space: Volume) -> Mount:
    level = space.height - keys.drop
    if level <= 0:
        raise ValueError(f"places.ceiling.drop = {keys.drop:g} m reaches the floor: use less than {space.height:g}")
    return _area("ceiling", "ceiling", _part(keys.outline, space, "places.ceiling.outline"), (level, level))


def _tripods(keys: TripodPlaces, number: int, space: Volume) -> Mount:
    key = f"places.tripods[{number}]"
    heights = _heights(keys.heights, space, f"{key}.heights")
    return _area("tripod", f"tripods {number}", _part(keys.outline, space, f"{key}.outline"), heights)


def _part(outline: Outline, space: Volume, key: str) -> Floor:
    """Return the part of the floor with an outline; the whole floor without one."""
    return Floor(simple_outline(outline, what=key, smallest=LEAST_AREA)) if outline else space


def _heights(heights: tuple[float, float], space: Volume, key: str) -> tuple[float, float]:
    low, high = heights
    if low > high:
        raise ValueError(f"{key} = [{low:g}, {high:g}]: expected [lowest, highest]")
    if low > space.height:
        raise ValueError(
            f"{key} = [{low:g}, {high:g}] m: is above the ceiling at {space.height:g} m; use lower heights"
        )
    return low, min(high, space.height)


def _area(kind: MountKind, name: str, area: Floor, heights: tuple[float, float]) -> Mount:
    (x, y), (low, high) = area.size, heights
    origin = np.append(area.bounds[0], low)
    return Mount(kind, name, origin, np.array([x, 0, 0]), np.array([0, y, 0]), np.array([0, 0, high - low]), area)
