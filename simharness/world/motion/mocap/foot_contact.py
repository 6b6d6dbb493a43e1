"""Recorded feet on our floor: when a foot stands, where it then stays, and how it gets from one stand to the next.

The recorded way of a foot is kept but for a correction. While the foot stands, the correction holds it: one print, one
bearing, the sole rolling over its edges without slipping. In between the correction
fades from the one stand's to the next's. Heights are told as the clearance between sole and floor, 0 in a stand, so
that a foot never sinks; ground that rises and falls under the recorded feet is so made flat.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats
from simharness.world.motion.poses.timing import smoothstep

_STILL = 0.45  # m/s: a point of the sole that is slower may stand; swinging feet pass 1 m/s at once
_STAND, _GAP = 0.1, 0.07  # seconds: no stand is shorter, none is interrupted by less
_SWINGING = 1.0  # m/s: a foot that is faster carries nobody, so the other does
_RAISED = 0.10  # metres over the lowest foot within a second: such a foot may be held up, however still
_NOISE = np.radians(4.0)  # pitch within which a standing foot lies flat
_LEVEL = np.radians(25.0)  # recorded feet whose stands are further from flat are believed
_STEEP = np.radians(45.0)  # pitch from which a foot does not stand on its sole
_FADE = 0.15  # seconds in which a correction's own velocity dies away
_CLEARANCE = 0.015  # metres, the least in the middle of a swing


@dataclass(frozen=True)
class Sole:
    """The underside of one foot: the corners of its hull relative to the ankle while it lies flat, (n, 3) metres."""

    points: Floats

    def height(self, turn: Floats) -> Floats:
        """Height of the ankle over the lowest point for orientations (T, 3, 3), (T,) metres."""
        return -(turn[:, 2, :] @ self.points.T).min(axis=1)

    def rolled(self, turn: Floats) -> Floats:
        """How far the ankle goes, (T, 2) metres from where it is first, while the sole rolls through orientations.

        From frame to frame the lowest point stays where it is.
        """
        points = turn @ self.points.T
        lowest = points[:, 2].argmin(axis=1)
        now, rows = points[:, :2], np.arange(len(turn) - 1)
        steps = [now[rows, :, touching] - now[rows + 1, :, touching] for touching in (lowest[:-1], lowest[1:])]
        return np.concatenate([np.zeros((1, 2)), np.cumsum(np.mean(steps, axis=0), axis=0)])


@dataclass(frozen=True)
class FootPath:
    """The way of one foot on our floor, which is at 0.

    Attributes:
        turn: orientation against the neutral foot that the recording asks for, (T, 3, 3).
        clearance: between the sole and the floor, (T,) metres, 0 where it stands.
        ground: height that the recording's floor seems to have under the foot, (T,) metres.
        recorded: where the ankle is in the recording, (T, 2) metres.
        stances: first and last-but-one frame of every stand.
        anchors: of every stand, where the ankle is over the floor but for the sole's rolling, (S, 2) metres.
        sole: of the foot.
        rate: frames a second.
    """

    turn: Floats
    clearance: Floats
    ground: Floats
    recorded: Floats
    stances: list[tuple[int, int]]
    anchors: Floats
    sole: Sole
    rate: float

    def ankle(self, turn: Floats) -> Floats:
        """The way of the ankle, (T, 3) metres, of a foot that is turned so, (T, 3, 3), and does not slip."""
        held = self.recorded.copy()
        for (start, stop), anchor in zip(self.stances, self.anchors, strict=True):
            held[start:stop] = anchor + self.sole.rolled(turn[start:stop])
        ground = self.recorded + _faded(held - self.recorded, self.stances, self.rate)
        return np.column_stack([ground, self.sole.height(turn) + self.clearance])


def make_sole(points: Floats) -> Sole:
    """A sole from skin under a foot (n, 3), as ``Kinematics.soles`` gives it."""
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        corners = points
    return Sole(corners)


def detect_stances(ankle: Floats, turn: Floats, soles: tuple[Sole, Sole], *, rate: float) -> Bools:
    """When each foot stands, (2, T).

    A foot stands while its heel or its toes are still, if it is down with the lowest one around that time or if the
    other one swings meanwhile; else it may be held up in the air.

    Args:
        ankle: of both feet, (2, T, 3) metres; heights may be off by a constant.
        turn: (2, T, 3, 3).
        soles: of both feet.
        rate: frames a second.
    """
    frames = ankle.shape[1]
    speed, lowest = np.zeros((2, frames, 2)), np.empty((2, frames))
    for k, sole in enumerate(soles):
        forward = sole.points[:, 0]
        ends = sole.points[[forward.argmin(), forward.argmax()]]
        points = ankle[k][:, None] + ends @ turn[k].swapaxes(1, 2)
        if frames > 1:
            speed[k] = np.linalg.norm(np.gradient(points, axis=0) * rate, axis=-1)
        lowest[k] = ankle[k][:, 2] - sole.height(turn[k])
    speed = gaussian_filter1d(speed, 0.015 * rate, axis=1, mode="nearest")
    down = lowest < minimum_filter1d(lowest.min(axis=0), 2 * round(rate) + 1, mode="nearest") + _RAISED
    swinging = speed.min(axis=2) > _SWINGING
    result = np.zeros((2, frames), bool)
    for k in range(2):
        for start, stop in runs(_tidied(speed[k].min(axis=1) < _STILL, rate)):
            result[k, start:stop] = down[k, start:stop].mean() > 0.5 or swinging[1 - k, start:stop].any()
    return result


def _tidied(on: Bools, rate: float) -> Bools:
    """Without gaps and then without stands that are too short."""
    on = on.copy()
    for wanted, least in ((False, _GAP), (True, _STAND)):
        for start, stop in runs(on == wanted):
            if stop - start < least * rate:
                on[start:stop] = not wanted
    return on


def runs(on: Bools) -> list[tuple[int, int]]:
    """First and last-but-one index of every run of True in (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def plant_foot(ankle: Floats, turn: Floats, standing: Bools, sole: Sole, *, rate: float) -> FootPath:
    """Hold one recorded foot where it stands.

    Args:
        ankle: its recorded way, (T, 3) metres; heights may be off by a constant.
        turn: its recorded orientation against a foot that lies flat and points forward, (T, 3, 3).
        standing: (T,).
        sole: of the foot.
        rate: frames a second.
    """
    turn = _levelled(turn, standing)
    clearance = ankle[:, 2] - sole.height(turn)
    stances = runs(standing)
    ground = _ground(clearance, stances)

    recorded = np.stack(_angles(turn), axis=-1)
    held = recorded.copy()
    for start, stop in stances:
        held[start:stop] = _settled(recorded[start:stop])
    turn = Rotation.from_euler("ZYX", (recorded + _faded(held - recorded, stances, rate)) * [1, -1, 1]).as_matrix()
    anchors = [_anchor(ankle[start:stop, :2], turn[start:stop], sole) for start, stop in stances]
    return FootPath(
        turn=turn,
        clearance=_lifted(clearance - ground, stances),
        ground=ground,
        recorded=ankle[:, :2],
        stances=stances,
        anchors=np.reshape(anchors, (-1, 2)),
        sole=sole,
        rate=rate,
    )


def _levelled(turn: Floats, standing: Bools) -> Floats:
    """Turned about the foot's own axes so that it lies flat in the middle of its stands."""
    if not standing.any():
        return turn
    _, pitch, tilt = _angles(turn)
    flat = standing & (np.abs(pitch) < _LEVEL) & (np.abs(tilt) < _LEVEL)
    if not flat.any():
        return turn
    off = Rotation.from_euler("YX", [-np.median(pitch[flat]), np.median(tilt[flat])]).as_matrix()
    return turn @ off.T


def _angles(turn: Floats) -> tuple[Floats, Floats, Floats]:
    """Bearing, pitch (toes up positive) and tilt of a foot, each (T,) and continuous."""
    toes, side = turn[:, :, 0], turn[:, 2, 1]
    level = np.hypot(toes[:, 0], toes[:, 1])
    bearing = np.unwrap(np.arctan2(toes[:, 1], toes[:, 0]))
    tilt = np.arctan2(side, turn[:, 2, 2])
    return bearing, np.arctan2(toes[:, 2], level), np.unwrap(tilt)


def _settled(angles: Floats) -> Floats:
    """Bearing, pitch and tilt (n, 3) of one stand: one bearing, flat within the noise, not tilted.

    A foot on the tips of its toes, as in kneeling, stays as recorded.
    """
    bearing, pitch, _ = angles.T
    if np.median(np.abs(pitch)) > _STEEP:
        return angles
    beyond = np.maximum(np.abs(pitch) - _NOISE, 0.0)
    flat = np.sign(pitch) * beyond**2 / (beyond + 0.5 * _NOISE)  # nearly as recorded where far from flat, and smooth
    bearing = np.full(len(pitch), np.average(bearing, weights=_flatness(pitch)))
    return np.column_stack([bearing, flat, np.zeros(len(pitch))])


def _anchor(place: Floats, turn: Floats, sole: Sole) -> Floats:
    """Where to stand, (2,), so that the rolling foot is nearest to its recorded places (n, 2) while it lies flat."""
    return np.average(place - sole.rolled(turn), axis=0, weights=_flatness(_angles(turn)[1]))


def _flatness(pitch: Floats) -> Floats:
    return np.exp(-((pitch / np.radians(10.0)) ** 2)) + 1e-6


def _faded(correction: Floats, stances: list[tuple[int, int]], rate: float) -> Floats:
    """Corrections (T, n) known in stands, carried smoothly through what lies between."""
    frames = len(correction)
    result = correction.copy()
    if not stances:
        return np.zeros_like(correction)
    edges = [(0, 0), *stances, (frames, frames)]
    for (_, leave), (land, _) in pairwise(edges):
        if land <= leave:
            continue
        first = leave > 0
        last = land < frames
        span = land - leave + 1  # steps from the last frame of a stand to the first of the next
        along = np.arange(1, span)
        share = smoothstep(along / span)[:, None]
        before = correction[leave - 1] if first else correction[land]
        after = correction[land] if last else before
        between = before + share * (after - before)
        fade = min(_FADE * rate, span / 2)
        if first and leave > 1:
            between = between + (correction[leave - 1] - correction[leave - 2]) * _dying(along, fade)[:, None]
        if last and land + 1 < frames:
            between = between - (correction[land + 1] - correction[land]) * _dying(span - along, fade)[:, None]
        result[leave:land] = between
    return result


def _dying(steps: NDArray[np.int64], fade: float) -> Floats:
    """A way that begins with velocity 1 and ends after ``fade`` steps where it began."""
    return np.where(steps < fade, steps * (1 - np.minimum(steps / fade, 1.0)) ** 2, 0.0)


def _ground(clearance: Floats, stances: list[tuple[int, int]]) -> Floats:
    """Height of the ground under a foot, (T,): that of its stands, and straight from one to the next."""
    if not stances:
        return np.full(len(clearance), clearance.min())
    levels = [float(np.median(clearance[start:stop])) for start, stop in stances]
    times = np.concatenate([[start, stop - 1] for start, stop in stances])
    return np.interp(np.arange(len(clearance)), times, np.repeat(levels, 2))


def _lifted(clearance: Floats, stances: list[tuple[int, int]]) -> Floats:
    """Clearance (T,) that is 0 in stands and never less, and rises and lands smoothly."""
    frames = len(clearance)
    result = np.zeros(frames)
    floating = np.ones(frames, bool)
    for start, stop in stances:
        floating[start:stop] = False
    for start, stop in runs(floating):
        along = (np.arange(start, stop) - start + 1) / (stop - start + 1)
        # The power makes a foot that moves leave the floor at once.
        up = smoothstep(along / 0.2) ** 0.7 if start > 0 else np.ones(len(along))
        down = smoothstep((1 - along) / 0.2) ** 0.7 if stop < frames else np.ones(len(along))
        least = _CLEARANCE * up * down
        above = clearance[start:stop] - least
        result[start:stop] = least + up * down * (above + np.sqrt(above**2 + 0.005**2)) / 2  # a smooth maximum
    return result
