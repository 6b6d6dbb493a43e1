"""Filters of joints over time by name, as laboratories use them, beside the smoothing of the trackers.

Each stretch of frames in which a joint is there is filtered for itself; gaps stay gaps, and stretches that are too
short stay as they are. Covariances stay those of the estimates before.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_smoothing_spline
from scipy.ndimage import find_objects, label
from scipy.signal import butter, filtfilt

from mvpose.arrays import Floats
from mvpose.recording import People

CUTOFF = 6.0
"""Usual cutoff of joints in gait, Hz: D. Winter, Biomechanics and Motor Control of Human Movement, 4th edition."""

_FEWEST = 5  # frames of a stretch that a smoothing spline takes
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


def spline(values: Floats, times: Floats, cutoff: float) -> Floats:
    """Return values (T, 3) of the cubic smoothing spline that generalised cross-validation chooses.

    H. Woltring, "A Fortran package for generalized, cross-validatory spline smoothing and differentiation", Advances in
    Engineering Software 8(2), 1986. The cutoff plays no part.
    """
    if len(values) < _FEWEST:
        return values
    return np.stack([make_smoothing_spline(times, column)(times) for column in values.T], axis=1)


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
