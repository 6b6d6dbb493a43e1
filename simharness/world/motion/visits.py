"""Visits: routes of people who come in through a door, stop here and there, and go out again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mvpose.arrays import Bools, Floats
from simharness.scenario.sections.people_section import TrafficSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.random_streams import stream
from simharness.world.motion.motion import Presence, Prop
from simharness.world.motion.paths import Itinerary, Route, turning_time, walking_time

DOOR = (0.06, 1.1, 2.15)
"""Depth, width and height of a door, metres."""

_OUTSIDE = 1.3  # metres behind the wall to where people come from and go to
_GONE = 0.55  # metres behind the wall at which nothing of a person is in the room any more
_INSIDE = 1.2  # metres in front of the wall to which people walk before they turn
_SLANT = 0.57  # cosine of the largest angle at which people walk through a door
_CORNER = 0.9  # metres from the middle of a door to a corner of the room
_APART = 1.5  # metres between the middles of two doors in one wall
_FROM_CAMERA = 0.8  # metres from the passage to a camera
_DOOR_TRIES = 400
_ENTRY = (0.05, 0.5)  # shares of the duration in which people come
_SOON = (0.02, 0.2)  # the same for those who are to leave, too
_GONE_BY = (0.55, 0.95)  # shares of the duration by which people are gone, if the way to the door takes no longer
_NEAR = 4  # places of which the one nearest to both doors is the first of a person who comes and goes
_ENTRIES = 12  # times and doors that are tried to come in
_ASIDE = 1.2  # metres along x and y that people make way
_STAY = (0.4, 2.5)  # seconds of standing at a place
_PLACES = 16  # places that are tried for each leg
_SHORTEST = 0.8  # metres of a way to another place
_AHEAD = 3.0  # seconds for which a place must stay free after arrival: time to turn and go
_PAUSE = 0.5  # seconds to wait where no way is free
_LAST = 4.0  # seconds after the end for which the route is planned

FreeWay = Callable[[Route, float, float], bool]
"""Condition on a route between two times in seconds."""


@dataclass(frozen=True)
class Door:
    """Door in a wall, or a place at the edge of a room without walls."""

    place: Floats
    """Middle of the threshold, (2,) metres."""
    inward: Floats
    """Direction into the room, (2,), a unit vector along an axis."""

    def faces(self, place: Floats) -> bool:
        """Return whether a straight way through the door leads to a place, at an angle that its width allows."""
        way = place - self.place
        return float(way @ self.inward) > max(_INSIDE, _SLANT * float(np.hypot(*way)))

    def straight(self, place: Floats) -> Floats:
        """Return the place in front of the door on the line from a place behind it, (2,); of its middle straight on."""
        back = place - self.place
        away = float(np.hypot(*back))
        return self.place + _INSIDE * (self.inward if away < 1e-9 else -back / away)

    def beyond(self, place: Floats) -> Floats:
        """Return the place behind the door on the line from a place in the room through its middle, (2,)."""
        way = self.place - place
        return self.place + _OUTSIDE * way / -float(way @ self.inward)

    @property
    def prop(self) -> Prop:
        """The door as an object on the wall."""
        return Prop.at_rest("door", DOOR, self.place + self.inward * DOOR[0] / 2, _bearing(self.inward))


@dataclass(frozen=True)
class Visitor:
    """Plan of one visitor, from which routes are drawn."""

    entering: bool
    """Whether the person comes in after the beginning."""
    leaving: bool
    """Whether the person leaves before the end."""
    away: float
    """Time after which a person who left comes back, seconds; 0: never."""
    speed: float
    """Walking speed, metres per second."""
    doors: tuple[Door, ...]
    """Doors of the room."""
    room: RoomSection
    """The room."""
    duration: float
    """Duration of the sequence, seconds."""

    def draw(self, rng: np.random.Generator, *, half: float, start: float, free: FreeWay) -> Route | None:
        """Draw a route whose stops are in the square with half side ``half`` in metres; None if no way is free.

        Args:
            rng: random generator.
            half: half side of the square, metres.
            start: first time of the plan, seconds.
            free: condition on every leg.
        """
        gone, turned = rng.uniform(*_GONE_BY) * self.duration, float(rng.uniform(-np.pi, np.pi))
        entries = rng.uniform(*(_SOON if self.leaving else _ENTRY), _ENTRIES) * self.duration
        which = rng.integers(len(self.doors), size=(_ENTRIES, 2))
        choice = rng.uniform(-half, half, (_ENTRIES, _NEAR, 2))
        for entry, used, places in zip(entries, which, choice, strict=True):
            ways = [sum(np.hypot(*(self.doors[k].place - place)) for k in used) for place in places]
            place = places[int(np.argmin(ways)) if self.leaving else 0]  # who is to leave has no time for a long way
            if self.entering:
                walker = self._enter(self.doors[used[0]], place, float(entry))
            else:
                walker = Itinerary(place, turned, self.speed, start)
            if free(self._route(walker), start, walker.time + _AHEAD):
                break
        else:
            return None
        exit_door = self.doors[used[1]] if self.leaving else None
        end = self.duration + _LAST
        while walker.time < end:
            if not self._stroll(walker, rng, exit_door, half=half, until=gone if exit_door else end, free=free):
                return None
            if exit_door is None:
                break
            used_door = self._go_out(walker, rng, exit_door, half=half, free=free)
            if used_door is None:
                return None
            if not self.away or walker.time >= end:
                break
            begun = walker.time
            walker.stand(self.away).walk_to(used_door.straight(walker.place))
            if not free(self._route(walker), begun, walker.time + _AHEAD):
                return None
            gone = walker.time + rng.uniform(0.2, 0.6) * self.duration
        return self._route(walker)

    def _stroll(
        self,
        walker: Itinerary,
        rng: np.random.Generator,
        door: Door | None,
        *,
        half: float,
        until: float,
        free: FreeWay,
    ) -> bool:
        """Walk from place to place, as long as there is time to go out by a door until ``until``.

        Returns:
            False where no way is free and the person cannot wait either.
        """
        while walker.time + self._way_out(walker.place, door) < until:
            places, stays = rng.uniform(-half, half, (_PLACES, 2)), rng.uniform(*_STAY, _PLACES)
            for place, stay in zip(places, stays, strict=True):
                way = float(np.hypot(*(place - walker.place)))
                arrival = walker.time + turning_time(np.pi) + walking_time(way, self.speed) + stay
                if way < _SHORTEST or (door is not None and arrival + self._way_out(place, door) > until):
                    continue
                if walker.attempt(partial(_go_and_stay, place=place, stay=stay), self._free(free)):
                    break
            else:
                if not self._make_way(walker, rng, half=half, free=free):
                    return False
        return True

    def _make_way(self, walker: Itinerary, rng: np.random.Generator, *, half: float, free: FreeWay) -> bool:
        """Wait, or go a few steps to where nobody comes; return False where neither is possible."""
        near = walker.place + rng.uniform(-_ASIDE, _ASIDE, (_PLACES, 2))
        return walker.attempt(lambda each: each.stand(_PAUSE), self._free(free)) or any(
            walker.attempt(partial(_go_and_stay, place=place, stay=0.0), self._free(free))
            for place in near.clip(-half, half)
        )

    def _enter(self, door: Door, place: Floats, time: float) -> Itinerary:
        """Return the itinerary of a person who comes in by a door and walks to a place, straight if possible."""
        first = place if door.faces(place) else door.straight(door.place)
        start = door.beyond(first)
        walker = Itinerary(start, _bearing(first - start), self.speed, time)
        return walker.walk_to(first).walk_to(place)

    def _way_out(self, place: Floats, door: Door | None) -> float:
        """Return the seconds from a place to the other side of a door, at most; 0 without a door."""
        if door is None:
            return 0.0
        way = float(np.hypot(*(door.place - place))) + _OUTSIDE
        return 1.5 * turning_time(np.pi) + walking_time(way, self.speed)

    def _go_out(
        self, walker: Itinerary, rng: np.random.Generator, door: Door, *, half: float, free: FreeWay
    ) -> Door | None:
        """Walk to a door and out, or to another one where the way is not free; wait where none is.

        Returns:
            The door; None where the person can neither leave nor wait.
        """
        doors = [door, *(other for other in self.doors if other is not door)]
        while walker.time < self.duration + _LAST:
            for each in doors:
                if walker.attempt(partial(_leave, door=each), self._free(free)):
                    return each
            if not self._make_way(walker, rng, half=half, free=free):
                return None
        return door

    def _free(self, free: FreeWay) -> Callable[[Itinerary, float, float], bool]:
        """Return the condition on an itinerary; it asks for time at the end in which to get out of the way."""
        return lambda way, start, end: free(self._route(way), start, end + _AHEAD)

    def _route(self, walker: Itinerary) -> Route:
        route = walker.route()
        return replace(route, presence=self._presence(route))

    def _presence(self, route: Route) -> Presence:
        """Return the times at which the person is in the room, from a fine sampling."""
        first, last = route.span
        time = np.arange(first - 0.1, last + 0.2, 0.02)
        inside = in_room(self.room, route.position(time))
        edges = np.flatnonzero(inside[1:] != inside[:-1]) + 1
        changes = time[edges] - 0.01
        bounds = np.concatenate([[-np.inf] if inside[0] else [], changes, [np.inf] if inside[-1] else []])
        return Presence(bounds.reshape(-1, 2))


def _go_and_stay(walker: Itinerary, *, place: Floats, stay: float) -> Itinerary:
    return walker.walk_to(place).stand(stay)


def _leave(walker: Itinerary, *, door: Door) -> Itinerary:
    if not door.faces(walker.place):
        walker.walk_to(door.straight(door.place))
    return walker.walk_to(door.beyond(walker.place))


def in_room(room: RoomSection, place: Floats) -> Bools:
    """Return which people with pelvises at places (..., 2) count as in the room, (...).

    Behind a wall a person is in the room as long as a foot or a hand may still be; a room without walls ends at once.
    """
    beyond = np.abs(place) - np.array(room.size[:2]) / 2
    return np.asarray((beyond <= (_GONE if room.walls else 0.0)).all(axis=-1))


def draw_doors(seed: int, traffic: TrafficSection, room: RoomSection, cameras: Floats) -> tuple[Door, ...]:
    """Draw the doors of a room, clear of corners, cameras and each other; one more door changes none of the others.

    Args:
        seed: seed of the scenario.
        traffic: number of doors.
        room: the room.
        cameras: positions of the cameras, (V, 3) metres.

    Raises:
        ValueError: there is no place for a door.
    """
    half = np.array(room.size[:2]) / 2
    doors: list[Door] = []
    for number in range(traffic.doors):
        rng = stream(seed, "people", "door", number)
        for _ in range(_DOOR_TRIES):
            axis, sense, share = int(rng.integers(2)), float(rng.choice([-1.0, 1.0])), rng.uniform(-1.0, 1.0)
            room_along = half[1 - axis] - _CORNER
            place = np.zeros(2)
            place[axis], place[1 - axis] = sense * half[axis], share * max(room_along, 0.0)
            inward = np.zeros(2)
            inward[axis] = -sense
            door = Door(place, inward)
            if room_along >= 0 and _clear(door, doors, cameras):
                doors.append(door)
                break
        else:
            raise ValueError(
                f"people.traffic.doors = {traffic.doors}: no place for door {number} in a wall of room.size = "
                f"{list(room.size)}, {_CORNER:g} m from corners, {_APART:g} m from other doors and {_FROM_CAMERA:g} m "
                "from the cameras' places: lower people.traffic.doors, enlarge room.size, or move cameras"
            )
    return tuple(doors)


def _clear(door: Door, others: Sequence[Door], cameras: Floats) -> bool:
    apart = [np.linalg.norm(door.place - other.place) for other in others]
    along = cameras[:, :2] - door.place
    across = np.abs(along @ [-door.inward[1], door.inward[0]])
    ahead = along @ door.inward
    blocked = (across < _FROM_CAMERA) & (ahead < _INSIDE + _FROM_CAMERA)
    return bool(min(apart, default=np.inf) >= _APART and not blocked.any())


def _bearing(direction: Floats) -> float:
    return float(np.arctan2(direction[1], direction[0]))
