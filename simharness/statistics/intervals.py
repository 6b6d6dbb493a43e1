"""Means of scores over scenes with confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.statistics.bootstrap import block_weights, interval, resampled


@dataclass(frozen=True)
class Interval:
    """Mean over scenes with its 95 % confidence interval.

    Attributes:
        mean: mean over the scenes; NaN without scenes.
        low, high: ends of the interval; NaN with fewer than two scenes.
        n: number of scenes to which the score applies.
    """

    mean: float
    low: float
    high: float
    n: int


def mean_interval(values: Sequence[float | None] | ArrayLike, *, seed: int = 0, resamples: int = 2000) -> Interval:
    """Return the mean of a score (n,) over scenes with its 95 % interval, by resampling scenes.

    Percentiles are expanded because scenes are few (:func:`simharness.statistics.bootstrap.interval`).

    Args:
        values: score of each scene.
        seed: seed of the resampling.
        resamples: number of resamples.
    """
    values = scene_scores(values)
    values = values[np.isfinite(values)]
    if not len(values):
        return Interval(np.nan, np.nan, np.nan, 0)
    low, high = mean_ends(values, seed, resamples)
    return Interval(float(values.mean()), low, high, len(values))


def scene_scores(values: Sequence[float | None] | ArrayLike) -> Floats:
    """Return the scores of scenes as floats, (n,), NaN for None.

    Raises:
        ValueError: not one-dimensional.
    """
    scores = np.array(values, float)
    if scores.ndim != 1:
        raise ValueError(f"scores must be (n,), one for each scene, got shape {scores.shape}")
    return scores


def mean_ends(values: Floats, seed: int, resamples: int) -> tuple[float, float]:
    """Return the ends of the 95 % interval of a mean over finite values (n,); NaN for fewer than two."""
    if len(values) < 2:
        return np.nan, np.nan
    weights = block_weights(np.arange(len(values)), resamples=resamples, seed=seed)
    low, high = interval(resampled(values, weights) / len(values), blocks=len(values))
    return float(low), float(high)
