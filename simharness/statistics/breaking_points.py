"""Values of a factor at which a mean score passes a threshold."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import isotonic_regression

from mvpose.arrays import Floats
from simharness.statistics.studentized import mean_ends


@dataclass(frozen=True)
class BreakingPoint:
    """Value of a factor at which a score passes its threshold.

    Attributes:
        value: value of the factor; None without a crossing (see ``why``).
        low, high: ends of its 95 % interval, tested values; None where an end lies outside of these, or with a single
            scene for each value.
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

    The interval reaches from the last tested value at which the mean is significantly good, as at all before it, to the
    first at which it is significantly past the threshold, as at all after it, by the skewness-corrected t over scenes
    (:mod:`simharness.statistics.studentized`). What the curve does between two tested values is unknown, so that it
    holds the break of every monotone curve, however many scenes there are; more values make it narrower. Testing in
    a fixed order until the first result that is not significant keeps the level (Maurer, Hothorn & Lehmacher 1995).

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
    """Return the tested values around all at which the mean of margins (n, k) may be zero; None where there is none."""
    low, high = np.array([mean_ends(column[np.isfinite(column)]) for column in margin.T]).T
    # Unknown ends are NaN, and the mean may be on either side.
    good, past = int(np.argmin([*(low > 0), False])), int(np.argmin([*(high < 0)[::-1], False]))
    if max(good, past) == len(values):  # the break is outside
        return None, None
    return (float(values[good - 1]) if good else None, float(values[-past]) if past else None)
