"""Values of a factor at which a mean score passes a threshold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.statistics.bootstrap import block_weights, interval, resampled


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
    values: ArrayLike,
    scores: ArrayLike,
    threshold: float,
    *,
    better: Literal["higher", "lower"],
    seed: int = 0,
    resamples: int = 2000,
) -> BreakingPoint:
    """Return the first value of a factor at which the mean score over scenes becomes worse than a threshold.

    The mean is interpolated linearly between the tested values; the interval comes from resampling seeds (rows).

    Args:
        values: tested values of the factor, (k,), ascending.
        scores: scores of each seed, (n, k); NaN where the score does not apply: ignored.
        threshold: worst good value of the mean.
        better: direction of better scores.
        seed: seed of the resampling.
        resamples: number of resamples.

    Raises:
        ValueError: values that do not ascend, or scores of another shape.
    """
    values, scores = np.asarray(values, float), np.asarray(scores, float)
    if values.ndim != 1 or not len(values) or not (np.diff(values) > 0).all():
        raise ValueError(f"values must be one row that ascends, got {values.tolist()}")
    if scores.ndim != 2 or scores.shape[1] != len(values) or not len(scores):
        raise ValueError(f"scores must be (n, {len(values)}), n at least 1, got {scores.shape}")
    margin = (scores - threshold) * (1 if better == "higher" else -1)  # negative: past the threshold
    known = np.isfinite(margin)
    weights = np.vstack([np.ones(len(margin)), block_weights(np.arange(len(margin)), resamples=resamples, seed=seed)])
    counts = resampled(known, weights)
    sums = resampled(np.where(known, margin, 0.0), weights)
    means = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
    crossings = np.array([_first_crossing(values, row) for row in means])
    value = float(crossings[0])
    low = high = None
    if len(scores) > 1:
        # Quantiles need finite values: resamples that never cross, or cross at once, count as one range width outside.
        span = max(float(np.ptp(values)), 1.0)
        finite = np.clip(crossings[1:], values[0] - span, values[-1] + span)
        ends = [float(end) for end in interval(finite, blocks=len(scores))]
        low, high = (end if values[0] <= end <= values[-1] else None for end in ends)
    if np.isposinf(value):
        return BreakingPoint(None, low, high, "never")
    if np.isneginf(value):
        return BreakingPoint(None, low, high, "at once")
    return BreakingPoint(value, low, high, "crosses")


def _first_crossing(values: Floats, margin: Floats) -> float:
    """Return where a polyline first falls below zero; inf if it never does, -inf if its first point is below."""
    known = np.isfinite(margin)
    values, margin = values[known], margin[known]
    below = np.flatnonzero(margin < 0)
    if not len(below):
        return np.inf
    after = below[0]
    if after == 0:
        return -np.inf
    share = margin[after - 1] / (margin[after - 1] - margin[after])
    return float(values[after - 1] + share * (values[after] - values[after - 1]))
