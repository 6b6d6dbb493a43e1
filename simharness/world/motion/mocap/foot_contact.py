"""Foot contact of recorded motion: detection of stances, and removal of foot skate.

The recorded path of a foot is kept, apart from a correction. During a stance the correction holds the foot: one
footprint, one bearing, and a sole that rolls over its edges without slipping. Between stances the correction is blended
from one stance to the next. Heights are given as the clearance between sole and floor, 0 in a stance, so that a foot is
never below the floor; uneven ground under the recorded feet becomes flat.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats
from simharness.world.motion.poses.timing import smoothstep

_STILL = 0.45  # m/s: slower points of the sole may be in stance; swinging feet exceed 1 m/s at once
_STAND, _GAP = 0.1, 0.07  # seconds: shortest stance, and shortest gap between stances
_SWINGING = 1.0  # m/s: a faster foot carries no weight, so the other one does
_RAISED = 0.10  # metres above the lowest foot within a second: above it a still foot may be held in the air
_NOISE = np.radians(4.0)  # largest pitch of a stance foot that is taken as flat
_LEVEL = np.radians(25.0)  # feet with larger pitch or tilt in stance are kept as recorded
_STEEP = np.radians(45.0)  # pitch above which a foot does not stand on its sole
_FADE = 0.15  # seconds in which the velocity of a correction decays
_CLEARANCE = 0.015  # metres: least clearance in the middle of a swing


@dataclass(frozen=True)
class Sole:
    """Sole of one foot: corners of its convex hull relative to the ankle of the flat foot, (n, 3) metres."""

    points: Floats

    def height(self, turn: Floats) -> Floats:
        """Return the height of the ankle above the lowest point for orientations (T, 3, 3), (T,) metres."""
        return -(turn[:, 2, :] @ self.points.T).min(axis=1)

    def rolled(self, turn: Floats) -> Floats:
        """Return the path of the ankle relative to its first position, (T, 2) metres, while the sole rolls.

        From frame to frame, through orientations (T, 3, 3), the lowest point stays in place.
        """
        points = turn @ self.points.T
        lowest = points[:, 2].argmin(axis=1)
        now, rows = points[:, :2], np.arange(len(turn) - 1)
        steps = [now[rows, :, touching] - now[rows + 1, :, touching] for touching in (lowest[:-1], lowest[1:])]
        return np.concatenate([np.zeros((1, 2)), np.cumsum(np.mean(steps, axis=0), axis=0)])


@dataclass(frozen=True)
class FootPath:
    """Path of one foot on the flat floor at height 0."""

    turn: Floats
    """Orientation relative to the neutral foot, (T, 3, 3)."""
    clearance: Floats
    """Height of the sole above the floor, (T,) metres, 0 in stances."""
    ground: Floats
    """Estimated height of the recorded ground under the foot, (T,) metres."""
    recorded: Floats
    """Recorded position of the ankle, (T, 2) metres."""
    stances: list[tuple[int, int]]
    """First frame of every stance, and the frame after its last."""
    anchors: Floats
    """Position of the ankle in every stance without the rolling of the sole, (S, 2) metres."""
    sole: Sole
    """Sole of the foot."""
    rate: float
    """Frames per second."""

    def ankle(self, turn: Floats) -> Floats:
        """Return the path of the ankle, (T, 3) metres, for orientations (T, 3, 3) of a foot that does not slip."""
        held = self.recorded.copy()
        for (start, stop), anchor in zip(self.stances, self.anchors, strict=True):
            held[start:stop] = anchor + self.sole.rolled(turn[start:stop])
        ground = self.recorded + _faded(held - self.recorded, self.stances, self.rate)
        return np.column_stack([ground, self.sole.height(turn) + self.clearance])


def make_sole(points: Floats) -> Sole:
    """Return the sole for skin vertices under a foot (n, 3), see ``Kinematics.soles``."""
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        corners = points
    return Sole(corners)


def detect_stances(ankle: Floats, turn: Floats, soles: tuple[Sole, Sole], *, rate: float) -> Bools:
    """Return the frames in which each foot is in stance, (2, T).

    A foot is in stance while its heel or toes are still, if it is about as low as the lowest foot at that time or if
    the other foot swings; otherwise it may be held in the air.

    Args:
        ankle: positions of both ankles, (2, T, 3) metres; heights may have a constant offset.
        turn: orientations of both feet, (2, T, 3, 3).
        soles: soles of both feet.
        rate: frames per second.
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
    """Return the stances (T,) with short gaps closed and then short stances removed."""
    on = on.copy()
    for wanted, least in ((False, _GAP), (True, _STAND)):
        for start, stop in runs(on == wanted):
            if stop - start < least * rate:
                on[start:stop] = not wanted
    return on


def runs(on: Bools) -> list[tuple[int, int]]:
    """Return, for every run of True in (T,), its first index and the index after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def plant_foot(ankle: Floats, turn: Floats, standing: Bools, sole: Sole, *, rate: float) -> FootPath:
    """Return the path of one recorded foot, held in place during its stances.

    Args:
        ankle: recorded path of the ankle, (T, 3) metres; heights may have a constant offset.
        turn: recorded orientation relative to a flat foot that points forward, (T, 3, 3).
        standing: frames in stance, (T,).
        sole: sole of the foot.
        rate: frames per second.
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
    held_at = []  # where the rolling foot is nearest to its recorded positions while it is flat
    for start, stop in stances:
        place, flat = ankle[start:stop, :2] - sole.rolled(turn[start:stop]), _flatness(_angles(turn[start:stop])[1])
        held_at.append(np.average(place, axis=0, weights=flat))
    lifted, anchors = _lifted(clearance - ground, stances), np.reshape(held_at, (-1, 2))
    return FootPath(turn, lifted, ground, ankle[:, :2], stances, anchors, sole, rate)


def _levelled(turn: Floats, standing: Bools) -> Floats:
    """Return orientations rotated in the foot frame so that the foot is flat in its median stance."""
    if not standing.any():
        return turn
    _, pitch, tilt = _angles(turn)
    flat = standing & (np.abs(pitch) < _LEVEL) & (np.abs(tilt) < _LEVEL)
    if not flat.any():
        return turn
    off = Rotation.from_euler("YX", [-np.median(pitch[flat]), np.median(tilt[flat])]).as_matrix()
    return turn @ off.T


def _angles(turn: Floats) -> tuple[Floats, Floats, Floats]:
    """Return bearing, pitch (toes up positive) and tilt of a foot, each (T,) and continuous."""
    toes, side = turn[:, :, 0], turn[:, 2, 1]
    level = np.hypot(toes[:, 0], toes[:, 1])
    bearing = np.unwrap(np.arctan2(toes[:, 1], toes[:, 0]))
    tilt = np.arctan2(side, turn[:, 2, 2])
    return bearing, np.arctan2(toes[:, 2], level), np.unwrap(tilt)


def _settled(angles: Floats) -> Floats:
    """Return bearing, pitch and tilt (n, 3) of one stance: constant bearing, flat within the noise, no tilt.

    A foot on the tips of its toes, as in kneeling, stays as recorded.
    """
    bearing, pitch, _ = angles.T
    if np.median(np.abs(pitch)) > _STEEP:
        return angles
    beyond = np.maximum(np.abs(pitch) - _NOISE, 0.0)
    flat = (
        np.sign(pitch) * beyond**2 / (beyond + 0.5 * _NOISE)
    )  # close to the recorded pitch where it is large, and smooth
    bearing = np.full(len(pitch), np.average(bearing, weights=_flatness(pitch)))
    return np.column_stack([bearing, flat, np.zeros(len(pitch))])


def _flatness(pitch: Floats) -> Floats:
    return np.exp(-((pitch / np.radians(10.0)) ** 2)) + 1e-6


def _faded(correction: Floats, stances: list[tuple[int, int]], rate: float) -> Floats:
    """Return corrections (T, n), given in stances, interpolated smoothly between them."""
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
        span = land - leave + 1  # frames from the end of a stance to the start of the next
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
    """Return a curve that starts at 0 with velocity 1 and is back at 0 after ``fade`` steps."""
    return np.where(steps < fade, steps * (1 - np.minimum(steps / fade, 1.0)) ** 2, 0.0)


def _ground(clearance: Floats, stances: list[tuple[int, int]]) -> Floats:
    """Return the height of the ground under a foot, (T,): constant in stances, linear between them."""
    if not stances:
        return np.full(len(clearance), clearance.min())
    levels = [float(np.median(clearance[start:stop])) for start, stop in stances]
    times = np.concatenate([[start, stop - 1] for start, stop in stances])
    return np.interp(np.arange(len(clearance)), times, np.repeat(levels, 2))


def _lifted(clearance: Floats, stances: list[tuple[int, int]]) -> Floats:
    """Return the clearance (T,), 0 in stances and positive otherwise, with smooth take-off and landing."""
    frames = len(clearance)
    result = np.zeros(frames)
    floating = np.ones(frames, bool)
    for start, stop in stances:
        floating[start:stop] = False
    for start, stop in runs(floating):
        along = (np.arange(start, stop) - start + 1) / (stop - start + 1)
        # The power lets a moving foot leave the floor at once.
        up = smoothstep(along / 0.2) ** 0.7 if start > 0 else np.ones(len(along))
        down = smoothstep((1 - along) / 0.2) ** 0.7 if stop < frames else np.ones(len(along))
        least = _CLEARANCE * up * down
        above = clearance[start:stop] - least
        result[start:stop] = least + up * down * (above + np.sqrt(above**2 + 0.005**2)) / 2  # a smooth maximum
    return result
