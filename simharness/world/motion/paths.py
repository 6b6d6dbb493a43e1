"""Tracks of people on the floor: spots, smooth closed loops to walk or run round, recorded paths, and routes.

Routes are straight legs with stops and turns on the spot, along which people walk, wait and turn back.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from mvpose.arrays import Floats
from simharness.world.motion.motion import ALWAYS, Presence
from simharness.world.motion.poses.timing import ease

SWAY = 0.05  # metres: largest distance of a pelvis from its track, due to sway, weight shifts and reaching
_TIGHTEST = 0.8  # metres: smallest turning radius where there is room
_FASTEST_TURN = 1.3  # radians per second: in a narrow space people walk more slowly
_HARDEST_TURN = 3.5  # m/s², towards the centre of the bend: a runner leans by 20 degrees
_KNOTS = 48


@dataclass(frozen=True)
class Spot:
    """Fixed position ``place`` (2,) in metres with the facing direction ``bearing`` in radians from the x axis."""

    place: Floats
    bearing: float

    @property
    def fastest(self) -> float:
        """Highest speed in metres per second."""
        return 0.0

    def position(self, time: ArrayLike) -> Floats:
        """Return the position of the pelvis at times (...) in seconds, (..., 2) metres."""
        return np.broadcast_to(self.place, (*np.shape(time), 2))


@dataclass(frozen=True)
class Loop:
    """Closed smooth curve, followed at constant speed."""

    curve: CubicSpline
    """Periodic spline from arc length in metres to position (2,) in metres."""
    speed: float
    """Speed in metres per second."""
    start: float
    """Arc length at time 0 in metres."""

    @property
    def length(self) -> float:
        """Length of one round in metres."""
        return float(self.curve.x[-1])

    @property
    def fastest(self) -> float:
        """Highest speed in metres per second."""
        return self.speed

    def position(self, time: ArrayLike) -> Floats:
        """Return the position of the pelvis at times (...) in seconds, (..., 2) metres."""
        return self.curve(self._arc(time))

    def heading(self, time: ArrayLike) -> Floats:
        """Return the direction of travel, (...) radians from the x axis, in -pi..pi."""
        tangent = self.curve(self._arc(time), 1)
        return np.arctan2(tangent[..., 1], tangent[..., 0])

    def curvature(self, time: ArrayLike) -> Floats:
        """Return the signed curvature, (...) radians per metre; left turns are positive."""
        arc = self._arc(time)
        return _curvature(self.curve(arc, 1), self.curve(arc, 2))

    def _arc(self, time: ArrayLike) -> Floats:
        return np.mod(self.start + self.speed * np.asarray(time, float), self.length)


@dataclass(frozen=True)
class RecordedPath:
    """Recorded path that starts at a spot."""

    spot: Spot
    """Start position at time 0, and the bearing by which the path is rotated."""
    time: Floats
    """Times in seconds, (N,), ascending."""
    offset: Floats
    """Position of the pelvis at these times relative to the start, before the rotation, (N, 2) metres."""

    @property
    def fastest(self) -> float:
        """Highest speed in metres per second."""
        moved = np.linalg.norm(np.diff(self.offset, axis=0), axis=1)
        return float((moved / np.diff(self.time)).max(initial=0.0))

    def position(self, time: ArrayLike) -> Floats:
        """Return the position of the pelvis at times (...) in seconds, (..., 2) metres."""
        time = np.asarray(time, float)
        path = np.stack([np.interp(time, self.time, self.offset[:, k]) for k in range(2)], axis=-1)
        return self.spot.place + path @ rotation_2d(self.spot.bearing).T


@dataclass(frozen=True)
class LoopLimits:
    """Speeds of a person on a loop, and its smallest turning radius."""

    speed: float
    """Preferred speed in metres per second."""
    slowest: float
    """Lowest speed that the person accepts to stay synchronous with others, metres per second."""
    fastest: float
    """Highest such speed, metres per second."""
    tightest: float
    """Smallest turning radius in metres."""

    @property
    def suffices(self) -> bool:
        """Whether there is room for a speed that the person accepts."""
        return self.speed >= self.slowest


def loop_limits(speed: float, *, slowest: float, fastest: float, half: float, running: bool) -> LoopLimits:
    """Return the speeds that a square with half side ``half`` (metres) allows of the given ones (metres per second).

    A walker turns at 1.3 rad/s at most and slows down as far as that requires. A runner has a centripetal acceleration
    of 3.5 m/s² at most; ``slowest`` is not lowered for it, so that the result has ``slowest > speed`` if the square is
    too small to run in.
    """
    if running:
        tightest = min(max(_TIGHTEST, speed**2 / _HARDEST_TURN), 0.85 * half)
        limit = float(np.sqrt(_HARDEST_TURN * tightest))
        return LoopLimits(min(speed, limit), slowest, min(fastest, limit), tightest)
    tightest = min(_TIGHTEST, 0.7 * half)
    limit = _FASTEST_TURN * tightest
    return LoopLimits(min(speed, limit), min(slowest, 0.85 * limit), min(fastest, limit), tightest)


def rotation_2d(bearing: float) -> Floats:
    """Return the rotation of the floor plane, (2, 2), that maps the x axis to ``bearing`` in radians."""
    c, s = np.cos(bearing), np.sin(bearing)
    return np.array([[c, -s], [s, c]])


def make_loop(points: Floats, *, speed: float, start: float) -> Loop:
    """Return the smooth loop through dense, ordered ``points`` (n, 2) in metres.

    This function repeats the first point at the end; callers must not. ``start`` is a fraction of the length.
    """
    closed = np.concatenate([points, points[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    knots = np.linspace(0.0, arc[-1], _KNOTS + 1)
    places = np.stack([np.interp(knots, arc, closed[:, k]) for k in range(2)], axis=-1)
    return Loop(curve=CubicSpline(knots, places, bc_type="periodic"), speed=speed, start=start * arc[-1])


def draw_spot(rng: np.random.Generator, *, half: float, apart: bool = False) -> Spot:
    """Draw a spot in the square with half side ``half`` in metres.

    The bearing points roughly to the centre, as people in a group face; with ``apart``, for two people who face each
    other, it is uniform.
    """
    place = rng.uniform(-half, half, 2)
    inward = np.arctan2(-place[1], -place[0])
    off, anywhere = rng.normal(0.0, 0.6), rng.uniform(-np.pi, np.pi)
    return Spot(place=place, bearing=float(anywhere if apart else inward + off))


def draw_recorded(rng: np.random.Generator, *, half: float, time: Floats, offset: Floats) -> RecordedPath | None:
    """Draw rotation and shift of a recorded path; None if the rotated path does not fit into the square."""
    bearing = float(rng.uniform(-np.pi, np.pi))
    share = rng.uniform(size=2)
    path = offset @ rotation_2d(bearing).T
    low, high = -half - path.min(axis=0), half - path.max(axis=0)
    if (low > high).any():
        return None
    return RecordedPath(Spot(low + share * (high - low), bearing), time, offset)


def draw_loop(
    rng: np.random.Generator, *, half: float, speed: float, tightest: float = _TIGHTEST, widest: float | None = None
) -> Loop | None:
    """Draw a deformed ellipse in the square with half side ``half``; None if it leaves the square or turns too tightly.

    Args:
        rng: random generator.
        half: half side of the square in metres.
        speed: speed in metres per second.
        tightest: smallest turning radius in metres.
        widest: upper limit of the longer half axis in metres; None: as long as fits.
    """
    start = float(rng.uniform())
    points = _ellipse(rng, half, tightest, half if widest is None else widest)
    ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    sharpest = np.abs(_curvature((ahead - behind) / 2, ahead - 2 * points + behind)).max()  # without fitting a spline
    if np.abs(points).max() > half or sharpest > 1.0 / tightest:
        return None
    loop = make_loop(points, speed=speed, start=start)
    bend = loop.curvature(np.linspace(0.0, loop.length / speed, 2 * _KNOTS))
    return loop if np.abs(bend).max() < 1.0 / tightest else None


def _ellipse(rng: np.random.Generator, half: float, tightest: float, widest: float) -> Floats:
    wide = rng.uniform(tightest, widest)
    slim = rng.uniform(np.sqrt(tightest * wide), wide)  # an ellipse has its smallest radius at its ends: slim² / wide
    center = rng.uniform(-1.0, 1.0, 2) * (half - 0.9 * slim)
    wobble = rng.uniform(0.0, 0.12) * (1.0 - tightest * wide / slim**2)
    tilt, phase = rng.uniform(0.0, 2 * np.pi, 2)
    around = rng.choice([-1.0, 1.0]) * np.linspace(0.0, 2 * np.pi, 8 * _KNOTS, endpoint=False)
    radial = 1.0 + wobble * np.cos(3 * around + phase)
    ellipse = np.stack([wide * radial * np.cos(around), slim * radial * np.sin(around)], axis=-1)
    return center + ellipse @ rotation_2d(tilt).T


def _curvature(tangent: Floats, bend: Floats) -> Floats:
    cross = tangent[..., 0] * bend[..., 1] - tangent[..., 1] * bend[..., 0]
    return cross / np.linalg.norm(tangent, axis=-1) ** 3


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


Track = Spot | Loop | RecordedPath | Route
