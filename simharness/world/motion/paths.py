"""Where people go: spots to stay on, smooth closed loops to walk or run round, recorded ways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from mvpose.arrays import Floats

SWAY = 0.05  # metres: how far a pelvis strays from its track, by swaying, shifting weight and reaching
_TIGHTEST = 0.8  # metres: least radius of a turn, where there is room
_FASTEST_TURN = 1.3  # radians a second: in a narrow space people walk more slowly
_HARDEST_TURN = 3.5  # m/s², towards the middle of the bend: a runner leans by 20 degrees
_KNOTS = 48


@dataclass(frozen=True)
class Spot:
    """Staying at ``place`` (2,), metres, facing ``bearing``, radians from the x axis."""

    place: Floats
    bearing: float

    @property
    def fastest(self) -> float:
        """Metres a second."""
        return 0.0

    def position(self, time: ArrayLike) -> Floats:
        """Where the pelvis is, (..., 2) metres."""
        return np.broadcast_to(self.place, (*np.shape(time), 2))


@dataclass(frozen=True)
class Loop:
    """Going round a closed smooth curve at constant speed.

    Attributes:
        curve: the curve as a periodic spline of arc length, metres to (2,) metres.
        speed: metres a second.
        start: arc length at time 0, metres.
    """

    curve: CubicSpline
    speed: float
    start: float

    @property
    def length(self) -> float:
        """Once round, metres."""
        return float(self.curve.x[-1])

    @property
    def fastest(self) -> float:
        """Metres a second."""
        return self.speed

    def position(self, time: ArrayLike) -> Floats:
        """Where the pelvis is, (..., 2) metres."""
        return self.curve(self._arc(time))

    def heading(self, time: ArrayLike) -> Floats:
        """Direction of travel, (...) radians from the x axis, in -pi..pi."""
        tangent = self.curve(self._arc(time), 1)
        return np.arctan2(tangent[..., 1], tangent[..., 0])

    def curvature(self, time: ArrayLike) -> Floats:
        """How sharply the way turns to the left, (...) radians a metre."""
        arc = self._arc(time)
        return _curvature(self.curve(arc, 1), self.curve(arc, 2))

    def _arc(self, time: ArrayLike) -> Floats:
        return np.mod(self.start + self.speed * np.asarray(time, float), self.length)


@dataclass(frozen=True)
class RecordedPath:
    """A recorded way, begun at a spot.

    Attributes:
        spot: where it begins at time 0, and the bearing that turns it.
        time: seconds, (N,), ascending.
        offset: where the pelvis is at these times from where it begins, before the turn, (N, 2) metres.
    """

    spot: Spot
    time: Floats
    offset: Floats

    @property
    def fastest(self) -> float:
        """Metres a second."""
        moved = np.linalg.norm(np.diff(self.offset, axis=0), axis=1)
        return float((moved / np.diff(self.time)).max(initial=0.0))

    def position(self, time: ArrayLike) -> Floats:
        """Where the pelvis is, (..., 2) metres."""
        time = np.asarray(time, float)
        way = np.stack([np.interp(time, self.time, self.offset[:, k]) for k in range(2)], axis=-1)
        return self.spot.place + way @ rotation_2d(self.spot.bearing).T


Track = Spot | Loop | RecordedPath


@dataclass(frozen=True)
class LoopLimits:
    """How fast someone goes round a loop, and how tightly it may turn.

    Attributes:
        speed: preferred, metres a second; ``slowest`` and ``fastest`` are what they also do to keep in time.
        tightest: least radius of a turn, metres.
    """

    speed: float
    slowest: float
    fastest: float
    tightest: float


def loop_limits(speed: float, *, slowest: float, fastest: float, half: float, running: bool) -> LoopLimits:
    """What a square of half side ``half``, metres, lets of the speeds that someone would go at, metres a second.

    A walker turns at 1.3 rad/s at most and else goes more slowly, however slowly; a runner is held on the bend by
    3.5 m/s² at most. Nobody is asked to run more slowly than that allows: see whether ``slowest`` is above ``speed``.
    """
    if running:
        tightest = min(max(_TIGHTEST, speed**2 / _HARDEST_TURN), 0.85 * half)
        limit = float(np.sqrt(_HARDEST_TURN * tightest))
        return LoopLimits(min(speed, limit), slowest, min(fastest, limit), tightest)
    tightest = min(_TIGHTEST, 0.7 * half)
    limit = _FASTEST_TURN * tightest
    return LoopLimits(min(speed, limit), min(slowest, 0.85 * limit), min(fastest, limit), tightest)


def rotation_2d(bearing: float) -> Floats:
    """The rotation of the floor, (2, 2), that turns x into ``bearing``, radians."""
    c, s = np.cos(bearing), np.sin(bearing)
    return np.array([[c, -s], [s, c]])


def make_loop(points: Floats, *, speed: float, start: float) -> Loop:
    """The smooth closed way through ``points`` (n, 2), metres, close together and in their order.

    The first point is repeated at the end by this function, not by the caller; ``start`` is a share of the length.
    """
    closed = np.concatenate([points, points[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    knots = np.linspace(0.0, arc[-1], _KNOTS + 1)
    places = np.stack([np.interp(knots, arc, closed[:, k]) for k in range(2)], axis=-1)
    return Loop(curve=CubicSpline(knots, places, bc_type="periodic"), speed=speed, start=start * arc[-1])


def draw_spot(rng: np.random.Generator, *, half: float, apart: bool = False) -> Spot:
    """A spot in the square of half side ``half``.

    Its bearing leads roughly towards the middle, as people in a group face, or anywhere for two who face each other
    (``apart``).
    """
    place = rng.uniform(-half, half, 2)
    inward = np.arctan2(-place[1], -place[0])
    off, anywhere = rng.normal(0.0, 0.6), rng.uniform(-np.pi, np.pi)
    return Spot(place=place, bearing=float(anywhere if apart else inward + off))


def draw_recorded(rng: np.random.Generator, *, half: float, time: Floats, offset: Floats) -> RecordedPath | None:
    """A recorded way turned and shifted by chance; None where the turned way does not fit into the square."""
    bearing = float(rng.uniform(-np.pi, np.pi))
    share = rng.uniform(size=2)
    way = offset @ rotation_2d(bearing).T
    low, high = -half - way.min(axis=0), half - way.max(axis=0)
    if (low > high).any():
        return None
    return RecordedPath(Spot(low + share * (high - low), bearing), time, offset)


def draw_loop(
    rng: np.random.Generator, *, half: float, speed: float, tightest: float = _TIGHTEST, widest: float | None = None
) -> Loop | None:
    """A wobbly ellipse in the square of half side ``half``; None where the draw leaves it or turns too tightly.

    Args:
        rng: draws it.
        half: metres.
        speed: metres a second.
        tightest: least radius of its turns, metres.
        widest: half of the longest that it is, metres; None: as long as fits.
    """
    start = float(rng.uniform())
    points = _ellipse(rng, half, tightest, half if widest is None else widest)
    if np.abs(points).max() > half or _sharpest(points) > 1.0 / tightest:
        return None
    loop = make_loop(points, speed=speed, start=start)
    bend = loop.curvature(np.linspace(0.0, loop.length / speed, 2 * _KNOTS))
    return loop if np.abs(bend).max() < 1.0 / tightest else None


def _ellipse(rng: np.random.Generator, half: float, tightest: float, widest: float) -> Floats:
    wide = rng.uniform(tightest, widest)
    slim = rng.uniform(np.sqrt(tightest * wide), wide)  # an ellipse turns most tightly at its ends, by slim² / wide
    center = rng.uniform(-1.0, 1.0, 2) * (half - 0.9 * slim)
    wobble = rng.uniform(0.0, 0.12) * (1.0 - tightest * wide / slim**2)
    tilt, phase = rng.uniform(0.0, 2 * np.pi, 2)
    around = rng.choice([-1.0, 1.0]) * np.linspace(0.0, 2 * np.pi, 8 * _KNOTS, endpoint=False)
    radial = 1.0 + wobble * np.cos(3 * around + phase)
    ellipse = np.stack([wide * radial * np.cos(around), slim * radial * np.sin(around)], axis=-1)
    return center + ellipse @ rotation_2d(tilt).T


def _sharpest(points: Floats) -> float:
    """About the greatest curvature of a closed curve given by close points (n, 2): cheap, before any spline."""
    ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    return float(np.abs(_curvature((ahead - behind) / 2, ahead - 2 * points + behind)).max())


def _curvature(tangent: Floats, bend: Floats) -> Floats:
    cross = tangent[..., 0] * bend[..., 1] - tangent[..., 1] * bend[..., 0]
    return cross / np.linalg.norm(tangent, axis=-1) ** 3
