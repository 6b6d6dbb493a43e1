"""Where things can stand: out of everyone's way, clear of the cameras and of each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from mvpose.arrays import Floats
from mvpose.camera import Rig
from simharness.scenario.sections.room import Room
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import Kind, ObjectModel, Solid
from simharness.world.scene.placement.sight_lines import PictureFill

BODY_HALF_WIDTH = 0.42  # metres: what a trunk with its arms needs to pass by
LIMB = 0.15  # metres around every joint: an outstretched arm does not go through a shelf
LENS = 0.5  # metres kept free around each camera
GAP = 0.08  # metres between things, and to the walls
TRIES = 2000
MOST_OF_A_PICTURE = 0.6  # share of any one picture that all things together may fill
_CELL = 0.02  # metres: people's places are thinned to one in each cell of the floor
_BESIDE = (0.6, 1.4)  # metres from a person to a thing close by
_ROUNDING = 1e-6  # metres
_HULL_RATE = 4.0  # Hz at which the way of a moving thing is kept free


Where = Callable[[np.random.Generator, "FreeSpace"], tuple[Floats, float]]
"""Draws a place (2,) and a turn for a thing."""


@dataclass(frozen=True)
class FreeSpace:
    """What things must stay clear of.

    Attributes:
        room: the room; without walls, things stay within its size all the same.
        area: half the side of the square that people stay in, metres.
        time: seconds, (N,), all the time for which people are planned.
        pelvises: where pelvises are then, (N, P, 3) metres.
        joints: where joints are then, (N, P, J, 3) metres.
        rig: the cameras.
        taken: what stands there already.
        around: radius about the origin that people keep free, metres.
    """

    room: Room
    area: float
    time: Floats
    pelvises: Floats
    joints: Floats
    rig: Rig
    taken: tuple[Solid, ...] = ()
    around: float = 0.0

    @cached_property
    def half(self) -> Floats:
        """Half the room's sides, (2,) metres."""
        return np.array(self.room.size[:2]) / 2

    @cached_property
    def stations(self) -> Floats:
        """Where pelvises ever are on the floor, (n, 2) metres, thinned."""
        return _thinned(self.pelvises)

    @cached_property
    def _people(self) -> tuple[tuple[cKDTree, float], ...]:
        """Trees of places on the floor, and how far hulls keep from them."""
        slack = _CELL / np.sqrt(2)
        pairs = ((self.stations, BODY_HALF_WIDTH + slack), (_thinned(self.joints), LIMB + slack))
        return tuple((cKDTree(places), margin) for places, margin in pairs if len(places))

    def fits(self, hull: Box, *, at_wall: bool = False) -> bool:
        """Whether a thing with this hull keeps within the walls and off the lenses; ``at_wall`` it may touch a wall."""
        limits = self.half - (0.0 if at_wall else GAP) + _ROUNDING
        corners = hull.corners
        return bool(
            (np.abs(corners[:, :2]) <= limits).all()
            and corners[:, 2].max() <= self.room.size[2] + _ROUNDING
            and hull.distance(self.rig.centers).min(initial=np.inf) >= LENS
        )

    def obstructed(self, hull: Box) -> bool:
        """Whether a thing with this hull is ever in anyone's way."""
        return any(_comes_near(hull, tree, margin) for tree, margin in self._people)


def _comes_near(hull: Box, tree: cKDTree, margin: float) -> bool:
    reach = float(np.hypot(*hull.half[:2])) + margin
    near = tree.data[tree.query_ball_point(hull.center[:2], reach)]
    return bool((hull.distance_on_floor(np.pad(near, ((0, 0), (0, 1)))) < margin).any())


def _thinned(points: Floats) -> Floats:
    """Places (n, 2) on the floor of points (..., 3), one in each cell: no other there is farther than its diagonal."""
    places = points[..., :2].reshape(-1, 2)
    _, first = np.unique(np.floor(places / _CELL).astype(int), axis=0, return_index=True)
    return places[first]


class Site:
    """A room that is being furnished.

    Attributes:
        space: what is kept free.
        solids: what stands there, in the order in which it came.
    """

    def __init__(self, space: FreeSpace) -> None:
        self.space = space
        self.solids: list[Solid] = []
        self._boxes: list[Box] = []
        self._pictures = PictureFill(space.rig)
        for solid in space.taken:
            self.add(solid)

    def copy(self) -> Site:
        """The same as it is now, to try things out on."""
        other = Site(replace(self.space, taken=()))
        other.space, other.solids, other._boxes = self.space, list(self.solids), list(self._boxes)
        other._pictures.filled[:] = self._pictures.filled
        return other

    def add(self, solid: Solid) -> None:
        """Put a thing where it says it is."""
        self.solids.append(solid)
        self._boxes += standing(solid)
        if solid.trajectory is None:  # one that moves is never for long in a picture's way
            self._pictures.add(solid)

    def clear(self, hull: Box, *, at_wall: bool = False) -> bool:
        """Whether a thing with this hull fits into the room beside what stands there; people apart."""
        return self.space.fits(hull, at_wall=at_wall) and all(hull.gap_on_floor(box) >= GAP for box in self._boxes)

    def find(
        self,
        rng: np.random.Generator,
        thing: ObjectModel,
        where: Where,
        *,
        kind: Kind,
        name: str,
        tries: int = TRIES,
        at_wall: bool = False,
    ) -> Solid | None:
        """Draw places until the thing can stand in one; None where none of so many will do.

        It can where it is :meth:`clear`, in nobody's way, and leaves enough of every picture.
        """
        for _ in range(tries):
            place, yaw = where(rng, self.space)
            hull = thing.hull(place, yaw)
            if self.clear(hull, at_wall=at_wall) and not self.space.obstructed(hull):
                solid = thing.at(place, yaw, kind=kind, name=name)
                if self._pictures.bear(solid, MOST_OF_A_PICTURE):
                    return solid
        return None


def standing(solid: Solid) -> list[Box]:
    """Where nothing else can stand: the hull of a thing, of a moving one all along its way."""
    if solid.trajectory is None:
        return [solid.hull]
    time = solid.trajectory.time
    moments = np.arange(time[0], time[-1] + 1 / _HULL_RATE, 1 / _HULL_RATE)
    cells = np.round(solid.trajectory.at(moments) * [10, 10, 10, 20, 20, 20, 20]).astype(int)
    _, first = np.unique(cells, axis=0, return_index=True)
    return [solid.hull_at(moment) for moment in moments[first]]


def middle(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """At the origin, or as near as may be: within the disc that people keep free."""
    share, bearing, yaw = rng.uniform(), *rng.uniform(0.0, 2 * np.pi, 2)
    return 0.5 * space.around * share * np.array([np.cos(bearing), np.sin(bearing)]), float(yaw)


def about(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """Close to where someone stands or walks, on any side, at any angle: it hides legs from the cameras beyond."""
    share, distance = rng.uniform(), rng.uniform(*_BESIDE)
    bearing, yaw = rng.uniform(0.0, 2 * np.pi, 2)
    if len(space.stations):
        someone = space.stations[int(share * len(space.stations))]
        place = someone + distance * np.array([np.cos(bearing), np.sin(bearing)])
    else:
        place = ring(rng, share * np.minimum(space.area, space.half))
    return place, float(yaw)


def beside(rng: np.random.Generator, space: FreeSpace) -> tuple[Floats, float]:
    """From within the people's area out to the wall, rather near than far, its back outwards."""
    edge = np.minimum(0.6 * space.area, space.half)
    place = ring(rng, edge + rng.uniform() ** 2 * np.maximum(space.half - 0.25 - edge, 0.0))
    return place, inwards(place / space.half)


def inwards(outward: Floats) -> float:
    """The turn, a multiple of a right angle, that faces away from the wall in direction ``outward`` (2,)."""
    side = int(np.abs(outward).argmax())
    return float((np.pi if outward[0] > 0 else 0.0) if side == 0 else (-np.pi / 2 if outward[1] > 0 else np.pi / 2))


def ring(rng: np.random.Generator, reach: Floats) -> Floats:
    """A point on the outline of the rectangle of half sides ``reach`` (2,)."""
    side, sense, along = rng.integers(2), rng.choice([-1.0, 1.0]), rng.uniform(-1.0, 1.0)
    unit = np.array([sense, along]) if side == 0 else np.array([along, sense])
    return unit * reach
