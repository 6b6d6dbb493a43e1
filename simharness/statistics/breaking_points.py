"""Values of a factor at which a mean score passes a threshold."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import isotonic_regression

from mvpose.arrays import Floats
from simharness.statistics.studentized import mean_ends

_STEPS = 64
"""Number of values between two tested ones at which the mean is tested against the threshold."""


@dataclass(frozen=True)
class BreakingPoint:
    """Value of a factor at which a score passes its threshold.

    Attributes:
        value: value of the factor; None without a crossing (see ``why``).
        low, high: ends of its 95 % interval; None where an end lies outside the tested values, or with a single scene
            for each value.
        why: "crosses" at ``value``; "never" within the tested values; "at once": the first value is past the threshold.
    """

    value: float | None
    low: float | None
    high: float | None
    why: Literal["crosses", "never", "at once"]


def breaking_point(
    values: ArrayLike, scores: ArrayLike, threshold: float, *, better: Literal["higher", "lower"]
) -> BreakingPoint:
    """Return the value of a factor at which the mean score over scenes becomes worse than a threshold.

    The score is taken to get worse, never better, as the factor grows: the means are fitted by isotonic regression
    (Barlow et al., "Statistical inference under order restrictions", 1972), so that a plateau near the threshold does
    not break where one of its means happens to be low. The fit is interpolated linearly between the tested values.

    The interval contains all values at which the mean is not significantly on either side of the threshold (inversion
    of a test, as of Fieller, "Some problems in interval estimation", JRSS B 1954), by the skewness-corrected t over
    scenes (:mod:`simharness.statistics.studentized`); between tested values the scores of each scene are interpolated.

    Args:
        values: tested values of the factor, (k,), ascending.
        scores: scores of each seed, (n, k); NaN where the score does not apply: ignored.
        threshold: worst good value of the mean.
        better: direction of better scores.

    Raises:
        ValueError: values that do not ascend, or scores of another shape.
    """
    values, scores = np.asarray(values, float), np.asarray(scores, float)
    if values.ndim != 1 or not len(values) or not (np.diff(values) > 0).all():
        raise ValueError(f"values must be one row that ascends, got {values.tolist()}")
    if scores.ndim != 2 or scores.shape[1] != len(values) or not len(scores):
        raise ValueError(f"scores must be (n, {len(values)}), n at least 1, got {scores.shape}")
    margin = (scores - threshold) * (1 if better == "higher" else -1)  # negative: past the threshold
    tested = np.isfinite(margin).any(axis=0)
    values, margin = values[tested], margin[:, tested]
    if not len(values):
        return BreakingPoint(None, None, None, "never")
    crossing = _crossing(values, margin)
    low, high = _ends(values, margin)
    if np.isposinf(crossing):
        return BreakingPoint(None, low, high, "never")
    if np.isneginf(crossing):
        return BreakingPoint(None, low, high, "at once")
    return BreakingPoint(
        crossing, None if low is None else min(low, crossing), None if high is None else max(high, crossing), "crosses"
    )


def _crossing(values: Floats, margin: Floats) -> float:
    """Return where the monotone fit of margins (n, k) falls below zero; inf if never, -inf if at the first value."""
    means = np.nanmean(margin, axis=0)
    fit = isotonic_regression(means, weights=np.isfinite(margin).sum(axis=0), increasing=False).x
    below = np.flatnonzero(fit < -1e-9 * np.abs(means).max())  # a mean at the threshold, but for rounding, is good
    if not len(below):
        return np.inf
    after = int(below[0])
    if after == 0:
        return -np.inf
    share = max(fit[after - 1], 0.0) / (max(fit[after - 1], 0.0) - fit[after])
    return float(values[after - 1] + share * (values[after] - values[after - 1]))


def _ends(values: Floats, margin: Floats) -> tuple[float | None, float | None]:
    """Return the first and last value at which the mean of margins (n, k) may be zero; None where that is outside."""
    if len(margin) < 2:
        return None, None
    at, low, high = _bands(values, margin)
    # Unknown ends are of no help: the mean may be on either side.
    above, below = np.nan_to_num(low, nan=-np.inf) > 0, np.nan_to_num(high, nan=np.inf) < 0
    if above.all():  # beyond the last value
        return None, None
    if below.all():  # before the first
        return None, None
    first, last = int(np.argmin(above)), len(at) - 1 - int(np.argmin(below[::-1]))
    return (_between(at, low, first - 1) if above[0] else None, _between(at, high, last) if below[-1] else None)


def _between(at: Floats, end: Floats, before: int) -> float:
    """Return where ``end`` passes zero after the index ``before``, linearly."""
    one, other = end[before], end[before + 1]
    share = one / (one - other) if np.isfinite(one) and np.isfinite(other) and one != other else 0.5
    return float(at[before] + share * (at[before + 1] - at[before]))


def _bands(values: Floats, margin: Floats) -> tuple[Floats, Floats, Floats]:
    """Return values of the factor with the ends of the 95 % interval of the mean margin at each, ascending."""
    if len(values) == 1:
        low, high = mean_ends(margin[np.isfinite(margin[:, 0]), 0])
        return values, np.atleast_1d(low), np.atleast_1d(high)
    shares = np.linspace(0, 1, _STEPS + 1)
    at, lows, highs = [], [], []
    for index in range(len(values) - 1):
        pair = margin[:, index : index + 2]
        pair = pair[np.isfinite(pair).all(axis=1)]
        low, high = mean_ends(np.outer(1 - shares, pair[:, 0]) + np.outer(shares, pair[:, 1]))
        at.append(values[index] + shares * (values[index + 1] - values[index]))
        lows.append(low)
        highs.append(high)
    return np.concatenate(at), np.concatenate(lows), np.concatenate(highs)
