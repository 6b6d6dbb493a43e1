"""Errors of motion: velocity and jerk of joints over time.

Jerk is the third derivative of position, the field's measure of shaking ("jitter" of Yi et al., TransPose, SIGGRAPH
2021, and of Shin et al., WHAM, CVPR 2024). Its score is the ratio of the estimate's RMS to the truth's over the same
joints and frames: 1 is as smooth as the people are, 10 is ten times as shaky, and less than 1 means that real motion is
smoothed away. A number in m/s³ shows neither, because the jerk of people depends on what they do.

Both need no identities: the estimates that are paired with a true person one after the other are one track. So they
compare methods with identities and without, and a switch, which other scores count, leaves them as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.scoring.score_registry import ScoreInfo, ScoreInput, finite_mean, score


def velocity(positions: ArrayLike, time: ArrayLike) -> Floats:
    """Return the velocities between frames, (T - 1, ..., 3), m/s; NaN where one of two positions is missing.

    Args:
        positions: positions over time, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.
    """
    return _slopes(np.asarray(positions, float), np.asarray(time, float), 1)


def jerk(positions: ArrayLike, time: ArrayLike) -> Floats:
    """Return the third derivative of positions, (T - 3, ..., 3), m/s³; NaN where one of four positions is missing.

    It is six times the third divided difference: exact for cubic motion, at any times.

    Args:
        positions: positions over time, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.
    """
    positions, time = np.asarray(positions, float), np.asarray(time, float)
    for order in (1, 2, 3):
        positions = order * _slopes(positions, time, order)
    return positions


def velocity_error(truth: ArrayLike, estimate: ArrayLike, time: ArrayLike) -> float | None:
    """Return the mean length of the difference of velocities, m/s; None without two frames in a row.

    Args:
        truth: true positions, (T, ..., 3), metres; NaN where undefined.
        estimate: estimated positions, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.
    """
    return finite_mean(np.linalg.norm(velocity(estimate, time) - velocity(truth, time), axis=-1))


def rms_jerk(truth: ArrayLike, estimate: ArrayLike, time: ArrayLike) -> tuple[float, float] | None:
    """Return the RMS of the jerk of the estimate and of the truth, m/s³, where both are known in four frames in a row.

    Args:
        truth: true positions, (T, ..., 3), metres; NaN where undefined.
        estimate: estimated positions, (T, ..., 3), metres; NaN where missing.
        time: times of the frames, (T,), seconds, increasing.

    Returns:
        Both, or None without four such frames.
    """
    squares = [(jerk(each, time) ** 2).sum(axis=-1) for each in (estimate, truth)]
    both = np.isfinite(squares).all(axis=0)
    if not both.any():
        return None
    found, true = (float(np.sqrt(each[both].mean())) for each in squares)
    return found, true


_STILL = 1e-3  # m/s³, a thousandth of a slow walk's: positions of nobody who moves differ by rounding alone


def jerk_ratio(truth: ArrayLike, estimate: ArrayLike, time: ArrayLike) -> float | None:
    """Return the RMS jerk of the estimate over that of the truth; None without four frames, or if nobody moves.

    The arguments are those of :func:`rms_jerk`.
    """
    rms = rms_jerk(truth, estimate, time)
    return rms[0] / rms[1] if rms and rms[1] > _STILL else None


_VELOCITY = "mean error of the velocity of joints of people found, from frame to frame"


@score(ScoreInfo("velocity_mm_s", "Velocity error", "mm/s", _VELOCITY, "lower", 0))
def velocity_column(given: ScoreInput) -> float | None:
    """Return the mean error of velocities, mm/s."""
    error = velocity_error(given.truth, given.paired, given.recording.time)
    return None if error is None else 1000.0 * error


_JERK = "RMS jerk of joints of people found over that of the truth; 1 is as smooth as people are"


@score(ScoreInfo("jerk_ratio", "Jerk", "", _JERK, "lower", 2, target=1.0))
def jerk_column(given: ScoreInput) -> float | None:
    """Return the ratio of the jerk of the estimates to that of the truth."""
    return jerk_ratio(given.truth, given.paired, given.recording.time)


def _slopes(values: Floats, time: Floats, apart: int) -> Floats:
    """Return the differences of values over the time between frames that are ``apart``, (n - 1, ...)."""
    steps = time[apart:] - time[:-apart]
    return np.diff(values, axis=0) / steps.reshape(-1, *[1] * (values.ndim - 1))
