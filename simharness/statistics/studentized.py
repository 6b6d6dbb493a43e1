"""Student's t corrected for skewness: tests and intervals of the mean of few scenes without assuming symmetry.

The distribution of t is skewed against the skewness of the scores: for exponential changes with mean zero a test at
level 0.05 rejects 13 % of samples of twelve, and Student's interval misses the mean as often on one side. A monotone
function of T = t / sqrt(n),

    g(T) = T + skewness T² / 3 + skewness / 6n + higher orders of T,

removes this error to second order, whatever the distribution (Johnson, "Modified t tests and confidence intervals for
asymmetrical populations", JASA 1978; Hall, "On the removal of skewness by transformation", JRSS B 1992). The higher
orders are free. Here g is T -> (exp(k T) - 1) / k where this strengthens the evidence, and its inverse,
T -> log(1 + k T) / k, where this weakens it, with ``k = 2 |skewness| / 3``: unlike Hall's cubic, both ascend everywhere
and without a bound, so that changes of equal size remain significant in samples that happen to be skewed.

The skewness of a small sample is far less than that of its population, so it is multiplied by 1 + 10 / n. The factor is
chosen on exponential and gamma populations.

One far value in ten makes the skewness so large that the end of the interval lies far beyond that value. What the mean
can be at most if such scenes are more frequent than in the sample is also known without moments: by uniform random
weights of the scenes (Rubin, "The Bayesian bootstrap", Annals of Statistics 1981), of which one more scene, at the
bound of the score, would make a bound for all distributions (Gaffke 2005). Here this scene lies a little beyond the
farthest one, and the interval ends at the latest where the mean under random weights does.

No test of a mean has its level for all distributions (Bahadur & Savage, Annals of Mathematical Statistics 1956): where
one scene in ten loses much, one sample of twelve in four does not contain any (:func:`unseen_share`).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betainc, betaincinv, ndtr, stdtr, stdtrit

from mvpose.arrays import Floats

_INFLATION = 10.0  # the skewness of n scenes is multiplied by 1 + _INFLATION / max(n, _INFLATION)
_BEYOND = 2.0  # the additional scene of an end lies _BEYOND / sqrt(n) distances from the mean to the farthest beyond it
_FARTHER = 0.8  # that of a test lies _FARTHER times the skewness such distances from the mean
_CONSTANT = 1e-12  # deviation, relative to the largest value, below which values are equal but for rounding


def p_greater(values: Floats) -> float:
    """Return the p-value of the hypothesis that the mean is at most zero, from finite values (n,).

    1 for fewer than two values and for zeros. Equal positive values have p = 0. For values that are skewed to the left
    p is at least the probability of a negative mean under random weights; the additional scene is the farther off, the
    larger the skewness.
    """
    n = len(values)
    if n < 2 or not np.any(values):
        return 1.0
    mean, deviation, skewness = (float(each) for each in _moments(values))
    if deviation == 0:
        return float(mean <= 0)
    ratio = mean / deviation
    k = 2 / 3 * skewness
    bent = _strengthened(ratio, k) if k * ratio > 0 else _weakened(ratio, -k)
    p = float(stdtr(n - 1, -np.sqrt(n) * (bent + skewness / (6 * n))))
    added = _FARTHER * max(-skewness, 0.0) * (mean - values.min()) - mean
    least, span, a, b = _weighted_mean(-values, np.asarray(added))
    return max(p, float(betainc(b, a, np.clip(1 + least / span, 0.0, 1.0))))


def unseen_share(n: int, *, level: float = 0.95) -> float:
    """Return the largest share of scenes of which n scenes may not contain a single one: (1 - share)^n = 1 - level."""
    return float(1 - (1 - level) ** (1 / n))


def mean_ends(values: ArrayLike, *, level: float = 0.95) -> tuple[Floats, Floats]:
    """Return the ends of intervals of means (...) over finite values (..., n); NaN for fewer than two values.

    Each end is the farther one of Student's interval and of the interval from the corrected t, because the correction
    may only widen an interval: a sample shows little of a skewness to the other side. The latter is limited by the mean
    under random weights.

    Args:
        values: scores of the scenes along the last axis.
        level: coverage probability of the intervals.
    """
    values = np.asarray(values, float)
    n = values.shape[-1]
    if n < 2:
        unknown = np.full(values.shape[:-1], np.nan)
        return unknown, unknown.copy()
    mean, deviation, skewness = _moments(values)
    quantile = stdtrit(n - 1, (1 + level) / 2)
    reach = quantile / np.sqrt(n)
    tail = ndtr(-np.sqrt(n / (n - 1)) * quantile)  # expanded percentiles (Hesterberg, The American Statistician 2015)
    reaches = []
    for sign in (-1, 1):
        corrected = _solved(reach + sign * skewness / (6 * n), -2 / 3 * sign * skewness) * deviation
        most = (sign * values).max(axis=-1)
        least, span, a, b = _weighted_mean(sign * values, most + _BEYOND / np.sqrt(n) * (most - sign * mean))
        weighted = least + span * betaincinv(a, b, 1 - tail) - sign * mean
        reaches.append(np.where(deviation > 0, np.maximum(reach * deviation, np.minimum(corrected, weighted)), 0.0))
    return mean - reaches[0], mean + reaches[1]


def _weighted_mean(values: Floats, added: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the least value, the span and the shapes of a beta distribution (...): of the mean under random weights.

    Mean and variance are those under uniform random weights of the values (..., n) and of one more, ``added`` (...).
    """
    every = np.concatenate([values, added[..., None]], axis=-1)
    least = every.min(axis=-1)
    span = np.where(np.ptp(every, axis=-1) > 0, np.ptp(every, axis=-1), 1.0)
    share = (every - least[..., None]) / span[..., None]
    centre, variance = share.mean(axis=-1), np.maximum(share.var(axis=-1), 1e-300) / (every.shape[-1] + 1)
    total = centre * (1 - centre) / variance - 1
    return least, span, centre * total, (1 - centre) * total


def _moments(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Return mean, deviation and inflated skewness (...) of values (..., n)."""
    n = values.shape[-1]
    mean = values.mean(axis=-1)
    error = values - mean[..., None]
    second = (error**2).mean(axis=-1)
    equal = np.sqrt(second) <= _CONSTANT * np.abs(values).max(axis=-1)
    spread = np.where(equal, 1.0, second)
    skewness = np.where(equal | (n < 3), 0.0, (error**3).mean(axis=-1) / spread**1.5)
    unbiased = np.sqrt(n * (n - 1)) / max(n - 2, 1)
    deviation = np.where(equal, 0.0, np.sqrt(second * n / (n - 1)))
    return mean, deviation, skewness * unbiased * (1 + _INFLATION / max(n, _INFLATION))


def _strengthened(ratio: float, k: float) -> float:
    """Return (exp(k ratio) - 1) / k, for k ratio > 0."""
    return float(np.expm1(min(k * ratio, 100.0)) / k)


def _weakened(ratio: float, k: float) -> float:
    """Return log(1 + k ratio) / k, for k ratio >= 0."""
    return float(np.log1p(k * ratio) / k) if k else ratio


def _solved(reach: Floats, k: Floats) -> Floats:
    """Return the T >= 0 whose transform is ``reach``, where positive ``k`` strengthens."""
    size = np.maximum(np.abs(k), 1e-9)
    strengthened = np.log1p(size * np.maximum(reach, 0.0)) / size
    weakened = np.expm1(np.minimum(size * np.maximum(reach, 0.0), 100.0)) / size
    return np.where(np.abs(k) <= 1e-9, reach, np.where(k > 0, strengthened, weakened))
