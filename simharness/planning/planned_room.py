"""Room for a plan: where people are, what hides them, and the mounts on which cameras may hang."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Bools, Floats
from mvpose.files.message_text import listed
from simharness.planning.room_keys import CeilingPlaces, Outline, PlacesKeys, RoomKeys, TripodPlaces, WallPlaces
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.floor import Floor, Volume, simple_outline
from simharness.world.rigs.layouts import look_at
from simharness.world.scene.objects.geoms import Box

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


_OUT_OF_REACH = 2.4  # metres: people do not touch higher cameras
_AT_DOOR = 0.2  # metres beside a door without cameras on the wall
_BEFORE_DOOR = 1.0  # metres before a door without tripods
_WALL = 0.1  # metres: thickness of walls that hide people in rooms that are not convex
_ROUNDING = 1e-6  # metres


@dataclass(frozen=True)
class LensChoice:
    """Camera model with its lens, in one of its two orientations."""

    name: str
    """Name in the file."""
    K: Floats
    """Intrinsics, (3, 3)."""
    size: tuple[int, int]
    """Width and height in pixels."""
    distortion: Floats
    """K1 k2 p1 p2 k3, (5,)."""
    cost: float
    """Cost in the unit of the budget."""
    turned: bool = False
    """Whether the camera hangs turned by 90 degrees."""

    @property
    def fov(self) -> tuple[float, float]:
        """Horizontal and vertical field of view before distortion, degrees."""
        width, height = (float(np.degrees(2 * np.arctan(n / (2 * self.K[0, 0])))) for n in self.size)
        return width, height

    def camera(self, place: ArrayLike, aim: ArrayLike, *, name: str = "") -> Camera:
        """Return the upright camera with this lens at a place (3,) that looks at a point (3,)."""
        return look_at(place, aim, K=self.K, size=self.size, distortion=self.distortion, name=name)


@dataclass(frozen=True)
class Room:
    """Room with places for cameras."""

    name: str
    """Name of the room."""
    keys: RoomKeys
    """All keys of its file."""
    space: Volume
    """Its floor and height."""
    volume: Volume
    """Where people are."""
    mounts: tuple[Mount, ...]
    """Where cameras may hang."""
    obstacles: tuple[Box, ...]
    """Boxes in the room."""
    doors: Floats
    """Start and end of each door, (d, 2, 2), metres."""
    lenses: tuple[LensChoice, ...]
    """Lenses to choose from, turned ones after the others."""
    fixed: tuple[Camera, ...]
    """Cameras that hang already."""
    detector: DetectorSection
    """Detector profile."""
    file: str = ""
    """File of the room."""

    @cached_property
    def blocking(self) -> tuple[Box, ...]:
        """Boxes that hide people: the obstacles, and the walls of a room that is not convex."""
        if self.space.convex:
            return self.obstacles
        walls, height = [], self.space.height
        for start, end in self.space.sides:
            along = end - start
            length = float(np.linalg.norm(along))
            middle = (start + end) / 2 + np.array([along[1], -along[0]]) / length * _WALL / 2
            yaw = float(np.arctan2(along[1], along[0]))
            center = (float(middle[0]), float(middle[1]), height / 2)
            walls.append(Box(center, (length / 2, _WALL / 2, height / 2), yaw))
        return (*self.obstacles, *walls)

    def may_hang(self, mount: Mount, places: ArrayLike) -> Bools:
        """Return whether a camera may be at places (..., 3) of a mount."""
        places = np.asarray(places, float)
        floor, keys = places[..., :2], self.keys.cameras
        walls = min(keys.from_walls, self._clearance(mount)) if mount.kind == "wall" else keys.from_walls
        free = self.space.contains(floor) & (self.space.distance_to_sides(floor) >= walls - _ROUNDING)
        free &= (places[..., 2] > 0.0) & (places[..., 2] <= self.space.height + _ROUNDING)
        if mount.area is not None:
            free &= mount.area.distance(floor) <= _ROUNDING
        for box in self.obstacles:
            free &= box.distance(places) >= keys.from_walls
            if mount.kind == "tripod":
                free &= (box.distance_on_floor(places) > 0.0) | (box.center[2] - box.half[2] > places[..., 2])
        near = _BEFORE_DOOR if mount.kind == "tripod" else _AT_DOOR + self._clearance(mount)
        for door in shapely.linestrings(self.doors) if mount.kind != "ceiling" else ():
            free &= shapely.distance(door, shapely.points(floor)) >= near
        if mount.kind != "ceiling":  # a tripod stands in the volume's way, a camera at head height is touched
            touched = self.volume.contains(floor) | (self.volume.distance(floor) < keys.from_people - _ROUNDING)
            free &= ~(touched & ((places[..., 2] < _OUT_OF_REACH) | (mount.kind == "tripod")))
        return free

    def _clearance(self, mount: Mount) -> float:
        """Return the distance of the cameras of a mount from its wall, metres; 0 for other mounts."""
        return (self.keys.places.walls or WallPlaces()).clearance if mount.kind == "wall" else 0.0

    def with_lenses(self, names: tuple[str, ...]) -> "Room":
        """Return the room with some of its lenses; fixed cameras keep theirs.

        Raises:
            ValueError: no lens has such a name.
        """
        known = list(dict.fromkeys(lens.name for lens in self.lenses))
        for name in names:
            if name not in known:
                raise ValueError(f"{self.file}: --lens {name}: no such lens; expected one of {listed(known)}")
        return replace(self, lenses=tuple(lens for lens in self.lenses if lens.name in names))
