"""Free space for objects: clear of the paths of people, of cameras and of other objects.

Cameras have to be clear of floor, walls and objects as well.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.scenario.sections.scenario import Scenario
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import Kind, ObjectModel, Solid
from simharness.world.scene.placement.sight_lines import PictureFill

_ROUNDING = 1e-6  # metres: tolerance at limits, because processors round differently
BODY_HALF_WIDTH = 0.42  # metres: clearance that a trunk with arms needs to pass
LIMB = 0.15  # metres: clearance around every joint, so that an outstretched arm does not pass through a shelf
LENS = 0.5  # metres: clearance around each camera
GAP = 0.08  # metres: gap between objects, and to the walls
TRIES = 2000
MAX_PICTURE_FILL = 0.6  # share of any picture that all objects together may fill
_CELL = 0.02  # metres: positions of people are thinned to one per cell of the floor
_NEAR_PEOPLE = (0.6, 1.4)  # metres from a person to an object placed near people
_HULL_RATE = 4.0  # Hz: sampling rate of the path of a moving object


PlaceSampler = Callable[[np.random.Generator, "FreeSpace"], tuple[Floats, float]]
"""Function that draws a place (2,) and a yaw for an object."""


@dataclass(frozen=True)
class FreeSpace:
    """Space that objects can use: room, paths of people, cameras and present solids."""

    room: RoomSection
    """The room; objects stay within its size even without walls."""
    area: float
    """Half the side of the square in which people stay, metres."""
    time: Floats
    """Times for which people are planned, (N,), seconds."""
    pelvises: Floats
    """Positions of the pelvises, (N, P, 3), metres."""
    joints: Floats
    """Positions of the joints, (N, P, J, 3), metres."""
    rig: Rig
    """True cameras."""
    taken: tuple[Solid, ...] = ()
    """Solids that are already present."""
    around: float = 0.0
    """Radius around the origin that people keep free, metres."""

    @cached_property
    def half(self) -> Floats:
        """Half sides of the room, (2,), metres."""
        return np.array(self.room.size[:2]) / 2

    @cached_property
    def stations(self) -> Floats:
        """Thinned positions of pelvises on the floor over all times, (n, 2), metres."""
        return _thinned(self.pelvises)

    @cached_property
    def _people(self) -> tuple[tuple[cKDTree, float], ...]:
        """Search trees of floor positions of pelvises and joints, each with the clearance of objects from them."""
        slack = _CELL / np.sqrt(2)
        pairs = ((self.stations, BODY_HALF_WIDTH + slack), (_thinned(self.joints), LIMB + slack))
        return tuple((cKDTree(places), margin) for places, margin in pairs if len(places))

    def fits(self, hull: Box, *, at_wall: bool = False) -> bool:
        """Return whether a hull is inside the walls and clear of the cameras; with ``at_wall`` it may touch a wall."""
        limits = self.half - (0.0 if at_wall else GAP) + _ROUNDING
        corners = hull.corners
        return bool(
            (np.abs(corners[:, :2]) <= limits).all()
            and corners[:, 2].max() <= self.room.size[2] + _ROUNDING
            and hull.distance(self.rig.centers).min(initial=np.inf) >= LENS
        )

    def obstructed(self, hull: Box) -> bool:
        """Return whether an object with this hull obstructs a person at any time."""
        for tree, margin in self._people:
            reach = float(np.hypot(*hull.half[:2])) + margin
            near = tree.data[tree.query_ball_point(hull.center[:2], reach)]
            if (hull.distance_on_floor(np.pad(near, ((0, 0), (0, 1)))) < margin).any():
                return True
        return False


def _thinned(points: Floats) -> Floats:
    """Return floor positions (n, 2) of points (..., 3), one per cell; all points are within a cell diagonal of one."""
    places = points[..., :2].reshape(-1, 2)
    if not len(places):
        return places
    row, column = np.floor(places / _CELL).astype(np.int64).T
    width = column.max() - column.min() + 1
    _, first = np.unique(row * width + (column - column.min()), return_index=True)  # faster than of pairs
    return places[first]


class Site:
    """Room to which solids are added one by one.

    Attributes:
        space: free space of the room.
        solids: present solids, in the order in which they were added.
    """

    def __init__(self, space: FreeSpace) -> None:
        self.space = space
        self.solids: list[Solid] = []
        self._boxes: list[Box] = []
        self._pictures = PictureFill(space.rig)
        for solid in space.taken:
            self.add(solid)

    def copy(self) -> "Site":
        """Return a copy for trial placements."""
        other = Site(replace(self.space, taken=()))
        other.space, other.solids, other._boxes = self.space, list(self.solids), list(self._boxes)
        other._pictures.filled[:] = self._pictures.filled
        return other

    def add(self, solid: Solid) -> None:
        """Add a solid at its position."""
        self.solids.append(solid)
        self._boxes += occupied(solid)
        if solid.trajectory is None:  # a moving one fills a picture only for a short time
            self._pictures.add(solid)

    def clear(self, hull: Box, *, at_wall: bool = False) -> bool:
        """Return whether a hull fits into the room without touching present solids; people are not considered."""
        return self.space.fits(hull, at_wall=at_wall) and all(hull.gap_on_floor(box) >= GAP for box in self._boxes)

    def leaves_pictures_free(self, solid: Solid) -> bool:
        """Return whether one more solid leaves enough of every picture free."""
        return self._pictures.allows(solid, MAX_PICTURE_FILL)

    def find(
        self,
        rng: np.random.Generator,
        model: ObjectModel,
        sample_place: PlaceSampler,
        *,
        kind: Kind,
        name: str,
        tries: int = TRIES,
        at_wall: bool = False,
    ) -> Solid | None:
        """Draw places until the object can stand at one; return None if there is none after ``tries`` draws.

        A place is valid if it is :meth:`clear`, obstructs no person, and leaves enough of every picture free.
        """
        for _ in range(tries):
            place, yaw = sample_place(rng, self.space)
            hull = model.hull(place, yaw)
            if self.clear(hull, at_wall=at_wall) and not self.space.obstructed(hull):
                solid = model.at(place, yaw, kind=kind, name=name)
                if self.leaves_pictures_free(solid):
                    return solid
        return None


def occupied(solid: Solid) -> list[Box]:
    """Return the boxes that a solid occupies: its hull, or its hulls along the path of a moving one."""
    if solid.trajectory is None:
        return [solid.hull]
    start, end = solid.trajectory.time[[0, -1]]
    times = np.arange(start, end + 1 / _HULL_RATE, 1 / _HULL_RATE)
    cells = np.round(solid.trajectory.at(times) * [10, 10, 10, 20, 20, 20, 20]).astype(int)
    _, first = np.unique(cells, axis=0, return_index=True)
    return [solid.hull_at(time) for time in times[first]]


def near_origin(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """Draw a place near the origin, within the disc that people keep free, and any yaw."""
    share, bearing, yaw = rng.uniform(), *rng.uniform(0.0, 2 * np.pi, 2)
    return 0.5 * space.around * share * np.array([np.cos(bearing), np.sin(bearing)]), float(yaw)


def near_people(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """Draw a place near a path of a person, on any side, and any yaw: there an object occludes legs."""
    share, distance = rng.uniform(), rng.uniform(*_NEAR_PEOPLE)
    bearing, yaw = rng.uniform(0.0, 2 * np.pi, 2)
    if len(space.stations):
        person = space.stations[int(share * len(space.stations))]
        place = person + distance * np.array([np.cos(bearing), np.sin(bearing)])
    else:
        place = on_rectangle(rng, share * np.minimum(space.area, space.half))
    return place, float(yaw)


def towards_walls(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """Draw a place between the area of the people and the walls, more often near the people, with inward yaw."""
    edge = np.minimum(0.6 * space.area, space.half)
    place = on_rectangle(rng, edge + rng.uniform() ** 2 * np.maximum(space.half - 0.25 - edge, 0.0))
    return place, inward_yaw(place / space.half)


def inward_yaw(outward: Floats) -> float:
    """Return the yaw, a multiple of a right angle, that faces away from the wall in direction ``outward`` (2,)."""
    side = int(np.abs(outward).argmax())
    return float((np.pi if outward[0] > 0 else 0.0) if side == 0 else (-np.pi / 2 if outward[1] > 0 else np.pi / 2))


def on_rectangle(rng: np.random.Generator, half: Floats) -> Floats:
    """Draw a point on the outline of the rectangle with half sides ``half`` (2,)."""
    side, sense, along = rng.integers(2), rng.choice([-1.0, 1.0]), rng.uniform(-1.0, 1.0)
    unit = np.array([sense, along]) if side == 0 else np.array([along, sense])
    return unit * half


WALL_MARGIN = 0.1
"""Least distance between a camera and a wall, metres."""


def check_rig(scenario: Scenario, solids: Sequence[Solid], rig: Rig) -> None:
    """Check that every camera has clearance.

    Args:
        scenario: scenario with the room.
        solids: solids in the scene.
        rig: true cameras.

    Raises:
        ValueError: a camera under the floor or inside an object, or, if there are walls, behind a wall, less than 0.1 m
            from one, or above them. The message names the camera, its position, the obstacle, and the keys to change.
    """
    for camera in rig:
        place = camera.center
        where = f"camera {camera.name!r} at ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}) m"
        if place[2] <= 0.0:
            raise ValueError(f"{where} is not above the floor: use cameras.height above 0")
        if scenario.room.walls:
            _check_walls(scenario, rig, place, where)
        for solid in solids:
            if solid.kind != "room" and solid.trajectory is None and solid.hull.distance(place) == 0.0:
                raise ValueError(
                    f"{where} is inside {solid.name}, which stands at ({solid.hull.center[0]:.2f}, "
                    f"{solid.hull.center[1]:.2f}) and is {solid.hull.corners[:, 2].max():.2f} m high: change "
                    "cameras.height, cameras.radius or cameras.start, or the clutter"
                )


def _check_walls(scenario: Scenario, rig: Rig, place: NDArray[np.float64], where: str) -> None:
    x, y, z = scenario.room.size
    if place[2] > z + _ROUNDING:
        raise ValueError(
            f"{where} is above the walls, which are {z:g} m high: use cameras.height of at most {z:g}, a higher "
            "room.size, or room.walls = false"
        )
    limits = np.array([x / 2, y / 2]) - WALL_MARGIN
    beyond = np.abs(place[:2]) - limits
    if (beyond > _ROUNDING).any():
        axis = int(beyond.argmax())
        name = f"wall {'+' if place[axis] > 0 else '-'}{'xy'[axis]}"
        far = abs(place[axis]) - scenario.room.size[axis] / 2
        how = f"{far:.2f} m beyond" if far > 0 else f"{-far:.2f} m from"
        needed = np.ceil(20 * (np.abs(rig.centers[:, :2]).max(axis=0) + WALL_MARGIN)) / 10
        ring = scenario.cameras.layout in ("ring", "arc")
        smaller = f"cameras.radius at most {_largest_radius(rig, limits):.2f}, or " if ring else ""
        raise ValueError(
            f"{where} is {how} {name} of the room, {x:g} by {y:g} m; expected at least {WALL_MARGIN:g} m inside: use "
            f"{smaller}a larger room.size, {needed[0]:.1f} by {needed[1]:.1f} m or more, or room.walls = false"
        )


def _largest_radius(rig: Rig, limits: NDArray[np.float64]) -> float:
    """Return the largest ring radius, rounded down to a centimetre, with all cameras within limits (2,)."""
    centers = rig.centers[:, :2]
    radius = np.linalg.norm(centers, axis=1, keepdims=True)
    reach = np.abs(centers) / np.maximum(radius, 1e-9)
    return float(np.floor(100 * ((limits / np.maximum(reach, 1e-9)).min() + _ROUNDING)) / 100)
