"""Where people go: spots to stand on, smooth closed loops to walk, and a plan that keeps people apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from simharness.random import stream

Floats = NDArray[np.float64]

SWAY = 0.05  # metres: how far a pelvis strays from its track, by swaying, shifting weight and reaching
_TIGHTEST = 0.8  # metres: least radius of a turn, where there is room
_FASTEST_TURN = 1.3  # radians a second: in a narrow space people walk more slowly
_NARROWEST = 0.45  # metres: half side of the least square to walk round in
_KNOTS = 48
_IN_FILE = (0.3, 0.2)  # chance of trying to walk behind someone rather than one's own way, and more for each plan
_TRIES = 300  # draws for each person before the plan starts over
_PLANS = 6  # plans before giving up
_CHECKS = 30.0  # Hz: spacing is checked at this rate, whatever the rate of the frames


@dataclass(frozen=True)
class Spot:
    """Standing still at ``place`` (2,), metres, facing ``bearing``, radians from the x axis."""

    place: Floats
    bearing: float

    def position(self, time: ArrayLike) -> Floats:
        """Where the pelvis is, (..., 2) metres."""
        return np.broadcast_to(self.place, (*np.shape(time), 2))


@dataclass(frozen=True)
class Loop:
    """Walking round a closed smooth curve at constant speed.

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
        tangent, bend = self.curve(arc, 1), self.curve(arc, 2)
        cross = tangent[..., 0] * bend[..., 1] - tangent[..., 1] * bend[..., 0]
        return cross / np.linalg.norm(tangent, axis=-1) ** 3

    def _arc(self, time: ArrayLike) -> Floats:
        return np.mod(self.start + self.speed * np.asarray(time, float), self.length)


Track = Spot | Loop


def make_loop(points: Floats, *, speed: float, start: float) -> Loop:
    """The smooth closed way through ``points`` (n, 2), metres, close together and in their order.

    The first point is repeated at the end by this function, not by the caller; ``start`` is a share of the length.
    """
    closed = np.concatenate([points, points[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    knots = np.linspace(0.0, arc[-1], _KNOTS + 1)
    places = np.stack([np.interp(knots, arc, closed[:, k]) for k in range(2)], axis=-1)
    return Loop(curve=CubicSpline(knots, places, bc_type="periodic"), speed=speed, start=start * arc[-1])


def draw_spot(rng: np.random.Generator, *, half: float) -> Spot:
    """A spot in the square of half side ``half``, facing roughly towards the middle, as people in a group do."""
    place = rng.uniform(-half, half, 2)
    inward = np.arctan2(-place[1], -place[0])
    return Spot(place=place, bearing=float(inward + rng.normal(0.0, 0.6)))


def draw_loop(rng: np.random.Generator, *, half: float, speed: float) -> Loop | None:
    """A wobbly ellipse in the square of half side ``half``; None where the draw leaves it or turns too tightly."""
    tightest = min(_TIGHTEST, 0.7 * half)
    speed = min(speed, _FASTEST_TURN * tightest)
    wide = rng.uniform(tightest, half)
    slim = rng.uniform(np.sqrt(tightest * wide), wide)  # an ellipse turns most tightly at its ends, by slim² / wide
    center = rng.uniform(-1.0, 1.0, 2) * (half - 0.9 * slim)
    wobble = rng.uniform(0.0, 0.12) * (1.0 - tightest * wide / slim**2)
    tilt, wobble_phase, start = rng.uniform(0.0, 2 * np.pi, 3)
    sense = rng.choice([-1.0, 1.0])
    around = sense * np.linspace(0.0, 2 * np.pi, 8 * _KNOTS, endpoint=False)
    radial = 1.0 + wobble * np.cos(3 * around + wobble_phase)
    ellipse = np.stack([wide * radial * np.cos(around), slim * radial * np.sin(around)], axis=-1)
    turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    points = center + ellipse @ turn.T
    if np.abs(points).max() > half:
        return None
    loop = make_loop(points, speed=speed, start=float(start / (2 * np.pi)))
    bends = loop.curvature(np.linspace(0.0, loop.length / speed, 2 * _KNOTS))
    return loop if np.abs(bends).max() < 1.0 / tightest else None


def plan_tracks(
    seed: int, speeds: Sequence[float | None], *, area: float, spacing: float, duration: float
) -> tuple[Track, ...]:
    """Give everyone a track that stays in the area and ``spacing`` away from everyone else at all times.

    People are placed one after another, each by draws of their own, so that one more person leaves the earlier
    ones where they are. Only when someone finds no place does the whole plan start over with other draws.

    Args:
        seed: the scenario's seed.
        speeds: for each person the walking speed in metres a second, or None to stand.
        area: half the side of the square about the origin that pelvises stay in, metres.
        spacing: least distance between two pelvises, metres.
        duration: seconds that the plan must hold for.

    Raises:
        ValueError: no such plan was found, or the area is too small to walk in.
    """
    half = area - SWAY
    if any(speed is not None for speed in speeds) and half < _NARROWEST:
        raise ValueError(
            f"people.area = {area:g} m is too small to walk in: a loop needs {_NARROWEST + SWAY:.2f} m or more; "
            "enlarge people.area or take activities without walk"
        )
    if speeds and half <= 0:
        raise ValueError(f"people.area = {area:g} m is too small to stand in: take {2 * SWAY:.2f} m or more")
    time = np.linspace(0.0, duration, max(2, round(duration * _CHECKS) + 1))
    furthest = 0
    for plan in range(_PLANS):
        tracks: list[Track] = []
        taken = np.empty((0, len(time), 2))
        for person, speed in enumerate(speeds):
            rng = stream(seed, "people", person, "track", plan)
            in_file = min(0.95, _IN_FILE[0] + plan * _IN_FILE[1])
            found = _find_track(rng, tracks, taken, time, speed, half=half, spacing=spacing, in_file=in_file)
            if found is None:
                furthest = max(furthest, person)
                break
            tracks.append(found)
            taken = np.concatenate([taken, found.position(time)[None]])
        else:
            return tuple(tracks)
    raise ValueError(
        f"people.count = {len(speeds)} people do not fit: only {furthest} found a place in people.area = {area:g} m "
        f"(half the side of their square) with people.spacing = {spacing:g} m between any two for {duration:g} s; "
        "lower people.count or people.spacing, or enlarge people.area"
    )


def _find_track(
    rng: np.random.Generator,
    tracks: Sequence[Track],
    taken: Floats,
    time: Floats,
    speed: float | None,
    *,
    half: float,
    spacing: float,
    in_file: float,
) -> Track | None:
    """Draw tracks until one keeps its distance from where the others are at the same times, (n, T, 2)."""
    loops = [track for track in tracks if isinstance(track, Loop)]
    for _ in range(_TRIES):
        track: Track | None
        if speed is None:
            track = draw_spot(rng, half=half)
        elif loops and rng.uniform() < in_file:
            ahead = loops[rng.integers(len(loops))]
            track = replace(ahead, start=float(rng.uniform(0.0, ahead.length)))
        else:
            track = draw_loop(rng, half=half, speed=speed)
        if track is None:
            continue
        apart = np.linalg.norm(taken - track.position(time), axis=-1)
        if apart.min(initial=np.inf) >= spacing + 2 * SWAY:
            return track
    return None
