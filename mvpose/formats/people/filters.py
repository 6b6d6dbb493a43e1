"""Filters of joints over time by name, as laboratories use them, beside the smoothing of the trackers.

Each stretch of frames in which a joint is there is filtered for itself; gaps stay gaps, and stretches that are too
short stay as they are. Covariances stay those of the estimates before.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import find_objects, label
from scipy.signal import butter, filtfilt

from mvpose.arrays import Floats
from mvpose.recording import People

CUTOFF = 6.0
"""Usual cutoff of joints in gait, Hz: D. Winter, Biomechanics and Motor Control of Human Movement, 4th edition."""

_FEWEST = 5  # frames of a stretch that a smoothing spline takes
_PER_DECADE = 8  # weights of smoothing splines that are tried: their bandwidth changes by 7 %
_PADDED = 9  # frames by which filtfilt reflects the ends of a stretch
_TWICE = (np.sqrt(2.0) - 1.0) ** 0.25  # share of the cutoff that two passes of a filter of second order have


def butterworth(values: Floats, times: Floats, cutoff: float) -> Floats:
    """Return values (T, 3) after a Butterworth filter of fourth order without lag: one of second order, both ways.

    Raises:
        ValueError: a cutoff above half of the frame rate.
    """
    rate = (len(times) - 1) / (times[-1] - times[0])
    if not 0.0 < cutoff / _TWICE < rate / 2.0:
        raise ValueError(
            f"--filter: a cutoff of {cutoff:g} Hz: expected between 0 and {_TWICE * rate / 2.0:.3g} Hz at {rate:g} Hz"
        )
    if len(values) <= _PADDED:
        return values
    return np.asarray(filtfilt(*butter(2, cutoff / _TWICE, fs=rate), values, axis=0))


def smoothed(values: Floats, weight: float) -> Floats:
    """Return even samples (T, 3) of the natural cubic spline that minimises squared residuals plus weighted curvature.

    The weight multiplies the integral of the squared second derivative over time in frames. C. Reinsch, "Smoothing by
    spline functions", Numerische Mathematik 10, 1967.
    """
    bands = np.zeros((3, len(values) - 2))
    bands[0], bands[1], bands[2] = weight, 1.0 / 6.0 - 4.0 * weight, 2.0 / 3.0 + 6.0 * weight
    curvature = np.pad(solveh_banded(bands, np.diff(values, 2, axis=0)), ((2, 2), (0, 0)))
    return np.asarray(values - weight * np.diff(curvature, 2, axis=0))


def freedom(frames: int, weight: float) -> float:
    """Return the degrees of freedom of :func:`smoothed`: its trace, with the modes of a free beam."""
    waves = np.cos(np.pi / frames * np.r_[0.0, 0.0, np.arange(1.5, frames - 1)])
    return float(np.sum(1.0 / (1.0 + weight * 12.0 * (1.0 - waves) ** 2 / (2.0 + waves))))


def spline(values: Floats, times: Floats, cutoff: float) -> Floats:
    """Return values (T, 3) of the cubic smoothing splines that generalised cross-validation chooses, each for itself.

    H. Woltring, "A Fortran package for generalized, cross-validatory spline smoothing and differentiation", Advances in
    Engineering Software 8(2), 1986. The cutoff plays no part.
    """
    frames = len(values)
    if frames < _FEWEST:
        return values
    found, least = values, np.full(values.shape[1], np.inf)
    for weight in np.logspace(-2.0, 4.0 * np.log10(frames), int(_PER_DECADE * (2.0 + 4.0 * np.log10(frames)))):
        tried = smoothed(values, weight)
        error = np.sum((values - tried) ** 2, axis=0) / (frames - freedom(frames, weight)) ** 2
        found, least = np.where(error < least, tried, found), np.minimum(error, least)
    return found


FILTERS: dict[str, Callable[[Floats, Floats, float], Floats]] = {"butterworth": butterworth, "spline": spline}
"""Filters by name."""


def filter_of(text: str) -> tuple[str, float]:
    """Return the name and the cutoff, Hz, of ``butterworth``, ``butterworth:HZ`` or ``spline``.

    Raises:
        ValueError: another text.
    """
    name, _, given = text.partition(":")
    try:
        cutoff = float(given or CUTOFF)
    except ValueError:
        cutoff = np.nan
    if name not in FILTERS or not 0.0 < cutoff < np.inf or (given and name == "spline"):
        raise ValueError(f"--filter: expected butterworth, butterworth:HZ or spline, got {text!r}")
    return name, cutoff


def filtered(people: People, name: str, cutoff: float = CUTOFF) -> People:
    """Return people with filtered joints.

    Args:
        people: people at even times.
        name: name of a filter in :data:`FILTERS`.
        cutoff: of the Butterworth filter, Hz.

    Raises:
        ValueError: times that are uneven, or a cutoff that is too high for the frame rate.
    """
    if people.uniform() is not people:
        raise ValueError("--filter: needs frames at even times; these are uneven")
    joints = people.joints.copy()
    for row, joint in np.ndindex(joints.shape[1:3]):
        there = np.isfinite(joints[:, row, joint]).all(axis=-1)
        for (stretch,) in find_objects(label(there)[0]):
            if stretch.stop - stretch.start > 1:
                joints[stretch, row, joint] = FILTERS[name](joints[stretch, row, joint], people.times[stretch], cutoff)
    return replace(people, joints=joints)
