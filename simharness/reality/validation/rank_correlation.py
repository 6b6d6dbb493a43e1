"""Rank correlation (Spearman) of reality and twins, with the interval that comes from reality."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

from mvpose.arrays import Floats
from simharness.statistics.intervals import Interval
from simharness.statistics.resampling import interval


def rank_correlation(real: ArrayLike, twin: ArrayLike, *, resamples: Floats | None = None) -> Interval:
    """Return Spearman's correlation of two lists of n numbers; NaN with fewer than three, or where one is constant.

    Args:
        real: numbers of the recording, (n,).
        twin: numbers of the twins, (n,). Places with a NaN in either are left out.
        resamples: numbers of R bootstrap resamples of the recording, (R, n), for the interval; None: no interval.
    """
    value = _spearman(np.asarray(real, float), np.asarray(twin, float))
    if resamples is None or not np.isfinite(value):
        return Interval(value, np.nan, np.nan, 1)
    low, high = interval([_spearman(each, np.asarray(twin, float)) for each in resamples])
    return Interval(value, float(low), float(high), 1)


def _spearman(one: Floats, other: Floats) -> float:
    known = np.isfinite(one) & np.isfinite(other)
    if known.sum() < 3:
        return float("nan")
    ranks = rankdata(one[known]), rankdata(other[known])
    if any(np.ptp(each) == 0 for each in ranks):
        return float("nan")
    return float(np.corrcoef(*ranks)[0, 1])
