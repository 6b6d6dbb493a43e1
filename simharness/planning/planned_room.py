"""Room for a plan: the checked geometry of the keys of a room file (:mod:`.room_keys`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Bools, Floats
from mvpose.files.message_text import listed
from simharness.planning.mounts import Mount, MountKind
from simharness.planning.polygons import (
    contains,
    counter_clockwise,
    crossing_edges,
    distance_to_edges,
    distance_to_segment,
    edges_of,
    is_convex,
    signed_area,
    without_repeats,
)
from simharness.planning.room_keys import LensKeys, ObstacleKeys, RoomKeys, WallPlaces
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.lenses import check_lens, intrinsics
from simharness.world.scene.objects.geoms import Box

_SMALLEST = 0.5  # m²: smallest area of a room or a volume
_DEFAULT_MARGIN = 0.5  # metres from the walls to a volume that the file does not give
_OUT_OF_REACH = 2.4  # metres: people do not touch higher cameras
_AT_DOOR = 0.2  # metres beside a door without cameras on the wall
_BEFORE_DOOR = 1.0  # metres before a door without tripods
_WALL = 0.1  # metres: thickness of walls that hide people in rooms that are not convex
_DEFAULT_FOV = 75.0  # degrees
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
        outline: corners of the floor, counter-clockwise, (n, 2), metres.
        height: height of the room, metres.
        volume: corners of the volume, counter-clockwise, (n, 2), metres.
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
    outline: Floats
    height: float
    volume: Floats
    mounts: tuple[Mount, ...]
    obstacles: tuple[Box, ...]
    doors: Floats
    lenses: tuple[LensChoice, ...]
    fixed: tuple[Camera, ...]
    detector: DetectorSection
    file: str = ""

    @property
    def volume_height(self) -> float:
        """Height that people reach, metres."""
        return self.keys.volume.height

    @cached_property
    def blocking(self) -> tuple[Box, ...]:
        """Boxes that hide people: the obstacles, and the walls of a room that is not convex."""
        if is_convex(self.outline):
            return self.obstacles
        walls = []
        for start, end in zip(*edges_of(self.outline), strict=True):
            along = end - start
            length = float(np.linalg.norm(along))
            middle = (start + end) / 2 + np.array([along[1], -along[0]]) / length * _WALL / 2
            yaw = float(np.arctan2(along[1], along[0]))
            center = (float(middle[0]), float(middle[1]), self.height / 2)
            walls.append(Box(center, (length / 2, _WALL / 2, self.height / 2), yaw))
        return (*self.obstacles, *walls)

    def may_hang(self, mount: Mount, places: ArrayLike) -> Bools:
        """Return whether a camera may be at places (..., 3) of a mount."""
        places = np.asarray(places, float)
        floor, keys = places[..., :2], self.keys.cameras
        walls = min(keys.from_walls, self._clearance(mount)) if mount.kind == "wall" else keys.from_walls
        free = contains(self.outline, floor) & (distance_to_edges(self.outline, floor) >= walls - _ROUNDING)
        free &= (places[..., 2] > 0.0) & (places[..., 2] <= self.height + _ROUNDING)
        if mount.outline is not None:
            inside = contains(mount.outline, floor) | (distance_to_edges(mount.outline, floor) <= _ROUNDING)
            free &= inside
        for box in self.obstacles:
            free &= box.distance(places) >= keys.from_walls
            if mount.kind == "tripod":
                free &= (box.distance_on_floor(places) > 0.0) | (box.center[2] - box.half[2] > places[..., 2])
        near = _BEFORE_DOOR if mount.kind == "tripod" else _AT_DOOR + self._clearance(mount)
        for start, end in self.doors if mount.kind != "ceiling" else ():
            free &= distance_to_segment(start, end, floor) >= near
        if mount.kind != "ceiling":  # a tripod stands in the volume's way, a camera at head height is touched
            touched = contains(self.volume, floor) | (
                distance_to_edges(self.volume, floor) < keys.from_people - _ROUNDING
            )
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


def make_room(keys: RoomKeys, *, name: str = "", file: str = "", folder: Path | None = None) -> Room:
    """Return the room of checked keys.

    Args:
        keys: keys of a room file.
        name: name of the room.
        file: file for messages.
        folder: folder in which a detector profile is looked for first.

    Raises:
        ValueError: an impossible room; the message names the key.
    """
    outline, height = _shape(keys)
    volume = _volume(keys, outline, height)
    obstacles = tuple(_box(each) for each in keys.obstacles)
    lenses = tuple(_lens(each, k) for k, each in enumerate(keys.lenses))
    turned = tuple(_turned(lens) for lens, key in zip(lenses, keys.lenses, strict=True) if key.turned)
    room = Room(
        name=name or keys.name or "room",
        keys=keys,
        outline=outline,
        height=height,
        volume=volume,
        mounts=_mounts(keys, outline, height),
        obstacles=obstacles,
        doors=_doors(keys, outline),
        lenses=lenses + turned,
        fixed=(),
        detector=read_profile(keys.detector, folder=folder),
        file=file,
    )
    return replace(room, fixed=tuple(_fixed(room, k) for k in range(len(keys.fixed))))


def _shape(keys: RoomKeys) -> tuple[Floats, float]:
    shape = keys.room
    if shape.size is not None and shape.outline:
        raise ValueError("room.size and room.outline are both given: keep one of them")
    if shape.size is None and not shape.outline:
        raise ValueError("room.size is missing: give room.size = [x, y, z], or room.outline and room.height")
    if shape.size is not None:
        x, y, height = shape.size
        return rectangle((x, y)), height
    outline = _outline(shape.outline, "room.outline")
    return outline, shape.height


def rectangle(size: tuple[float, float], center: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Return the corners (4, 2) of a rectangle, counter-clockwise from the lowest x and y."""
    half = np.array(size) / 2
    return np.array(center) + half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _outline(corners: tuple[tuple[float, float], ...], key: str) -> Floats:
    outline = without_repeats(np.array(corners, float))
    if len(outline) < 3:
        raise ValueError(
            f"{key} is not closed: {len(outline)} different corners enclose no floor; expected at least 3 corners in "
            "order along the walls"
        )
    if (pair := crossing_edges(outline)) is not None:
        one, two = (f"from {_at(outline[k])} to {_at(outline[(k + 1) % len(outline)])}" for k in pair)
        raise ValueError(
            f"{key} crosses itself: its side {one} meets the side {two}; give the corners in order along the walls"
        )
    if abs(signed_area(outline)) < _SMALLEST:
        raise ValueError(
            f"{key} encloses {abs(signed_area(outline)):.2g} m²; expected at least {_SMALLEST:g} m²: "
            "give corners in metres"
        )
    return counter_clockwise(outline)


def _volume(keys: RoomKeys, outline: Floats, height: float) -> Floats:
    given = keys.volume
    if given.size is not None and given.outline:
        raise ValueError("volume.size and volume.outline are both given: keep one of them")
    if given.height > height:
        raise ValueError(f"volume.height = {given.height:g} m is above the ceiling at {height:g} m: use a lower volume")
    if given.size is not None:
        volume = rectangle(given.size, given.center)
    elif given.outline:
        volume = _outline(given.outline, "volume.outline")
    else:
        low, high = outline.min(axis=0) + _DEFAULT_MARGIN, outline.max(axis=0) - _DEFAULT_MARGIN
        size, center = high - low, (low + high) / 2
        if not is_convex(outline) or len(outline) != 4 or (size <= 0).any():
            raise ValueError("volume is missing: give volume.size and volume.center, or volume.outline")
        volume = rectangle((float(size[0]), float(size[1])), (float(center[0]), float(center[1])))
    starts, ends = edges_of(volume)
    points = np.concatenate([starts + share * (ends - starts) for share in np.linspace(0.0, 1.0, 20, endpoint=False)])
    outside = ~contains(outline, points) & (distance_to_edges(outline, points) > _ROUNDING)
    if outside.any():
        raise ValueError(
            f"volume reaches beyond the walls of the room at {_at(points[outside][0])}: use a smaller volume.size, "
            "another volume.center, or another volume.outline"
        )
    return volume


def _mounts(keys: RoomKeys, outline: Floats, height: float) -> tuple[Mount, ...]:
    places = keys.places
    given = places.walls is not None or places.ceiling is not None or bool(places.tripods)
    mounts: list[Mount] = []
    if places.walls is not None or not given:
        mounts += _walls(places.walls or WallPlaces(heights=(min(1.0, height / 2), min(2.8, height))), outline, height)
    if places.ceiling is not None:
        area = _outline(places.ceiling.outline, "places.ceiling.outline") if places.ceiling.outline else outline
        level = height - places.ceiling.drop
        if level <= 0:
            raise ValueError(
                f"places.ceiling.drop = {places.ceiling.drop:g} m reaches the floor: use less than {height:g}"
            )
        mounts.append(_area("ceiling", "ceiling", area, (level, level)))
    for k, each in enumerate(places.tripods):
        area = _outline(each.outline, f"places.tripods[{k}].outline") if each.outline else outline
        mounts.append(
            _area("tripod", f"tripods {k}", area, _heights(each.heights, height, f"places.tripods[{k}].heights"))
        )
    return tuple(mounts)


def _walls(keys: WallPlaces, outline: Floats, height: float) -> list[Mount]:
    low, high = _heights(keys.heights, height, "places.walls.heights")
    wrong = [k for k in keys.walls if k >= len(outline)]
    if wrong:
        raise ValueError(f"places.walls.walls: the room has no wall {wrong[0]}; its walls are 0 to {len(outline) - 1}")
    mounts = []
    for k, (start, end) in enumerate(zip(*edges_of(outline), strict=True)):
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


def _heights(heights: tuple[float, float], height: float, key: str) -> tuple[float, float]:
    low, high = heights
    if low > high:
        raise ValueError(f"{key} = [{low:g}, {high:g}]: expected [lowest, highest]")
    if low > height:
        raise ValueError(f"{key} = [{low:g}, {high:g}] m: is above the ceiling at {height:g} m; use lower heights")
    return low, min(high, height)


def _area(kind: MountKind, name: str, area: Floats, heights: tuple[float, float]) -> Mount:
    low, high = area.min(axis=0), area.max(axis=0)
    return Mount(
        kind,
        name,
        np.append(low, heights[0]),
        np.array([high[0] - low[0], 0.0, 0.0]),
        np.array([0.0, high[1] - low[1], 0.0]),
        np.array([0.0, 0.0, heights[1] - heights[0]]),
        area,
    )


def _box(keys: ObstacleKeys) -> Box:
    x, y, z = keys.size
    return Box((*keys.center, keys.base + z / 2), (x / 2, y / 2, z / 2), float(np.radians(keys.yaw)))


def _lens(keys: LensKeys, index: int) -> LensChoice:
    key = f"lenses[{index}]"
    if keys.fov is not None and keys.focal is not None:
        raise ValueError(f"{key}.fov and {key}.focal are both given: keep one of them")
    if (keys.focal is None) != (keys.sensor is None):
        missing, given = ("focal", "sensor") if keys.focal is None else ("sensor", "focal")
        raise ValueError(f"{key}.{missing} is missing: {key}.{given} needs it; both are in millimetres")
    if keys.focal is not None and keys.sensor is not None:
        fov = float(np.degrees(2 * np.arctan(keys.sensor / (2 * keys.focal))))
    else:
        fov = keys.fov or _DEFAULT_FOV
    lens = LensChoice(keys.name, intrinsics(fov, keys.size), keys.size, np.array(keys.distortion), keys.cost)
    check_lens(lens.camera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), name=keys.name))
    return lens


def _turned(lens: LensChoice) -> LensChoice:
    """Return the lens of the camera turned by 90 degrees, whose pictures are turned back."""
    width, height = lens.size
    K = np.array([[lens.K[0, 0], 0.0, (height - 1) / 2], [0.0, lens.K[1, 1], (width - 1) / 2], [0.0, 0.0, 1.0]])
    k1, k2, p1, p2, k3 = lens.distortion
    return replace(lens, K=K, size=(height, width), distortion=np.array([k1, k2, -p2, p1, k3]), turned=True)


def _doors(keys: RoomKeys, outline: Floats) -> Floats:
    doors = np.array([[each.start, each.end] for each in keys.doors], float).reshape(-1, 2, 2)
    for k, ends in enumerate(doors):
        away = float(distance_to_edges(outline, ends).max())
        if away > 0.3:
            raise ValueError(
                f"doors[{k}] is {away:.2f} m away from the walls: a door is within a wall, give its two sides"
            )
    return doors


def _fixed(room: Room, index: int) -> Camera:
    given = room.keys.fixed[index]
    key, names = f"fixed[{index}]", [lens.name for lens in room.lenses]
    if given.lens and given.lens not in names:
        raise ValueError(f"{key}.lens = {given.lens!r}: no such lens; expected one of {listed(names)}")
    lens = names.index(given.lens) if given.lens else 0
    place = np.array(given.position)
    where = f"{key} at ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}) m"
    if not contains(room.outline, place[:2]) or not 0.0 < place[2] <= room.height:
        raise ValueError(f"{where} is inside a wall or outside the room: give a position within the room")
    for k, box in enumerate(room.obstacles):
        if box.distance(place) == 0.0:
            raise ValueError(f"{where} is inside obstacles[{k}] {room.keys.obstacles[k].name}: move one of them")
    name = given.name or f"fixed{index}"
    try:
        return room.lenses[lens].camera(place, given.aim, name=name)
    except ValueError as error:
        raise ValueError(f"{key}.aim: {error}") from None


def _at(point: Floats) -> str:
    return f"({point[0]:g}, {point[1]:g})"
