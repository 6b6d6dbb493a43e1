"""Routes: tracks of straight legs with stops and turns on the spot, along which people walk, wait and turn back."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.motion.motion import ALWAYS, Presence
from simharness.world.motion.poses.timing import ease

_RAMP = 0.8  # seconds: people reach their speed, and stop, within about two steps
_TURN = 1.4  # radians per second: rate of a turn on the spot; at usual cadences a step turns a foot by up to 45 degrees
_TURN_RAMP = 0.4  # seconds in which a turn reaches its rate
_SAME = 1e-6  # radians: a smaller turn is none


@dataclass(frozen=True)
class Route:
    """Position and heading of a person over time: sums of smooth changes of velocity and of bearing."""

    place: Floats
    """Position before the first change, (2,) metres."""
    bearing: float
    """Heading before the first turn, radians from the x axis."""
    speed: float
    """Usual walking speed of the person on the route, metres per second."""
    ramps: Floats
    """Changes of velocity, (n, 4): start in seconds, duration in seconds, change along x and y in metres per second."""
    turns: Floats
    """Turns, (m, 3): start in seconds, duration in seconds, angle in radians."""
    presence: Presence = ALWAYS
    """Times at which the person is in the scene."""

    @cached_property
    def fastest(self) -> float:
        """Highest speed in metres per second."""
        if not len(self.ramps):
            return 0.0
        return float(np.linalg.norm(np.cumsum(self.ramps[:, 2:], axis=0), axis=1).max())

    @property
    def span(self) -> tuple[float, float]:
        """Times of the first and the last change, seconds; 0 and 0 without any."""
        starts = np.concatenate([self.ramps[:, 0], self.turns[:, 0]])
        ends = np.concatenate([self.ramps[:, :2].sum(axis=1), self.turns[:, :2].sum(axis=1)])
        return (float(starts.min()), float(ends.max())) if len(starts) else (0.0, 0.0)

    def position(self, time: ArrayLike) -> Floats:
        """Return the position of the pelvis at times (...) in seconds, (..., 2) metres."""
        start, duration, *_ = self.ramps.T
        return np.asarray(
            self.place + _covered(np.asarray(time, float)[..., None] - start, duration) @ self.ramps[:, 2:]
        )

    def velocity(self, time: ArrayLike) -> Floats:
        """Return the velocity at times (...), (..., 2) metres per second."""
        start, duration, *_ = self.ramps.T
        return np.asarray(ease((np.asarray(time, float)[..., None] - start) / duration) @ self.ramps[:, 2:])

    def heading(self, time: ArrayLike) -> Floats:
        """Return the direction that the person faces, (...) radians from the x axis, without jumps."""
        start, duration, angle = self.turns.T
        since = np.asarray(time, float)[..., None] - start
        ramp = np.minimum(_TURN_RAMP, duration / 2)
        turned = _covered(since, ramp) - _covered(since - duration + ramp, ramp)
        return np.asarray(self.bearing + turned @ (angle / (duration - ramp)))


def _covered(since: Floats, duration: Floats) -> Floats:
    """Return the integral over time of a smooth change from 0 to 1 that takes ``duration``, ``since`` its start."""
    x = since / duration
    eased = np.clip(x, 0.0, 1.0)
    return duration * np.where(x < 1.0, eased**4 * (2.5 - 3.0 * eased + eased * eased), x - 0.5)


@dataclass
class Itinerary:
    """Builder of a :class:`Route`: its methods append what the person does next."""

    place: Floats
    """Present position, (2,) metres."""
    bearing: float
    """Present heading, radians."""
    speed: float
    """Usual walking speed, metres per second."""
    time: float = 0.0
    """Present time, seconds."""
    _start: tuple[Floats, float] = field(init=False)
    _ramps: list[tuple[float, float, float, float]] = field(init=False, default_factory=list)
    _turns: list[tuple[float, float, float]] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.place = np.asarray(self.place, float)
        self._start = (self.place, self.bearing)

    def stand(self, seconds: float) -> "Itinerary":
        """Wait."""
        self.time += max(seconds, 0.0)
        return self

    def turn(self, bearing: float, *, sense: float = 0.0) -> "Itinerary":
        """Turn on the spot to a bearing, the shorter way; for half a turn that of ``sense`` (1 left, -1 right)."""
        angle = float(np.angle(np.exp(1j * (bearing - self.bearing))))
        if sense and np.pi - abs(angle) < 1e-3:
            angle = float(np.sign(sense)) * np.pi
        if abs(angle) > _SAME:
            duration = turning_time(angle)
            self._turns.append((self.time, duration, angle))
            self.time += duration
            self.bearing += angle
        return self

    def walk(self, length: float, *, slow: tuple[float, float, float] | None = None) -> "Itinerary":
        """Walk straight ahead and stop.

        Args:
            length: length of the leg, metres.
            slow: start and end of a stretch in metres from the start of the leg, and the seconds in which it is passed;
                the person slows down on the stretch as far as necessary. It begins and ends a ramp away from the ends
                of the leg or further.
        """
        ramp, speed = _RAMP, self.speed
        if length < speed * ramp:
            speed = length / ramp
        ahead = np.array([np.cos(self.bearing), np.sin(self.bearing)])
        changes = [(0.0, ramp, speed)]
        begun = 0.5 * speed * ramp  # metres after the first ramp
        clock, left = ramp, length - 2 * begun
        if slow is not None:
            first, last, seconds = slow
            clock += (first - begun) / speed
            changes_inside, passed = _slowed(last - first, speed, seconds)
            changes += [(clock + at, duration, change) for at, duration, change in changes_inside]
            clock += passed
            left = length - last - begun
        clock += left / speed
        changes.append((clock, ramp, -speed))
        for at, duration, change in changes:
            self._ramps.append((self.time + at, duration, *(change * ahead).tolist()))
        self.time += clock + ramp
        self.place = self.place + length * ahead
        return self

    def walk_to(self, place: ArrayLike) -> "Itinerary":
        """Turn to a place and walk there."""
        way = np.asarray(place, float) - self.place
        length = float(np.hypot(*way))
        if length < 1e-6:
            return self
        return self.turn(float(np.arctan2(way[1], way[0]))).walk(length)

    def attempt(
        self, step: "Callable[[Itinerary], Itinerary]", allowed: "Callable[[Itinerary, float, float], bool]"
    ) -> bool:
        """Append a step if it is allowed, given the itinerary with it and the step's start and end in seconds."""
        before = self.place, self.bearing, self.time, len(self._ramps), len(self._turns)
        step(self)
        if allowed(self, before[2], self.time):
            return True
        self.place, self.bearing, self.time = before[:3]
        del self._ramps[before[3] :], self._turns[before[4] :]
        return False

    def route(self) -> Route:
        """Return the route so far; before its start and after its end the person stands."""
        place, bearing = self._start
        ramps, turns = np.reshape(self._ramps, (-1, 4)), np.reshape(self._turns, (-1, 3))
        return Route(place, bearing, self.speed, ramps.astype(float), turns.astype(float), ALWAYS)


def _slowed(length: float, speed: float, seconds: float) -> tuple[list[tuple[float, float, float]], float]:
    """Return the changes of speed (start, duration, change) on a stretch, and the time in which it is passed.

    From ``speed`` down to a speed at which the stretch of ``length`` takes ``seconds``, and up again at its end.
    """
    ramp = min(_RAMP, seconds / 2, 0.9 * length / speed)
    slow = (length - speed * ramp) / (seconds - ramp) if seconds > ramp else speed
    if slow >= speed:
        return [], length / speed
    return [(0.0, ramp, slow - speed), (seconds - ramp, ramp, speed - slow)], seconds


def walking_time(length: float, speed: float) -> float:
    """Return the seconds that :meth:`Itinerary.walk` takes for a leg of ``length`` metres."""
    return 2 * _RAMP if length < speed * _RAMP else length / speed + _RAMP


def turning_time(angle: float) -> float:
    """Return the seconds that :meth:`Itinerary.turn` takes for an angle in radians."""
    return abs(angle) / _TURN + _TURN_RAMP
