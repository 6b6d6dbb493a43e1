"""Room for a plan: where people are, where cameras may hang, and what hides people.

Rooms are read from files (:mod:`.room_file`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Bools, Floats
from mvpose.files.message_text import listed
from simharness.planning.mounts import Mount
from simharness.planning.room_keys import RoomKeys, WallPlaces
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.floor import Volume
from simharness.world.rigs.layouts import look_at
from simharness.world.scene.objects.geoms import Box

_OUT_OF_REACH = 2.4  # metres: people do not touch higher cameras
_AT_DOOR = 0.2  # metres beside a door without cameras on the wall
_BEFORE_DOOR = 1.0  # metres before a door without tripods
_WALL = 0.1  # metres: thickness of walls that hide people in rooms that are not convex
_ROUNDING = 1e-6  # metres


@dataclass(frozen=True)
class LensChoice:
    """Camera model with its lens, in one of its two orientations.

    Attributes:
        name: name in the file.
        K: intrinsics, (3, 3).
        size: width and height in pixels.
        distortion: k1 k2 p1 p2 k3, (5,).
        cost: cost in the unit of the budget.
        turned: whether the camera hangs turned by 90 degrees.
    """

    name: str
    K: Floats
    size: tuple[int, int]
    distortion: Floats
    cost: float
    turned: bool = False

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
    """Room with places for cameras.

    Attributes:
        name: name of the room.
        keys: all keys of its file.
        space: its floor and height.
        volume: where people are.
        mounts: where cameras may hang.
        obstacles: boxes in the room.
        doors: start and end of each door, (d, 2, 2), metres.
        lenses: lenses to choose from, turned ones after the others.
        fixed: cameras that hang already.
        detector: detector profile.
        file: file of the room.
    """

    name: str
    keys: RoomKeys
    space: Volume
    volume: Volume
    mounts: tuple[Mount, ...]
    obstacles: tuple[Box, ...]
    doors: Floats
    lenses: tuple[LensChoice, ...]
    fixed: tuple[Camera, ...]
    detector: DetectorSection
    file: str = ""

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

    def with_lenses(self, names: tuple[str, ...]) -> Room:
        """Return the room with some of its lenses; fixed cameras keep theirs.

        Raises:
            ValueError: no lens has such a name.
        """
        known = list(dict.fromkeys(lens.name for lens in self.lenses))
        for name in names:
            if name not in known:
                raise ValueError(f"{self.file}: --lens {name}: no such lens; expected one of {listed(known)}")
        return replace(self, lenses=tuple(lens for lens in self.lenses if lens.name in names))
