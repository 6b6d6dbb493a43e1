"""What scores over many scenes say: means, paired differences, and where a score breaks.

A scene is the unit, never a frame: frames of a scene have its people, its cameras and its clutter in common. Settings
at one seed have much of their scene in common, too, and what helps in one helps in the next: where a study has several
settings, average them at each seed first, and give the mean of each seed as one scene. A score that does not apply to
a scene is NaN or None there, and is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.statistics.bootstrap import block_weights, interval, resampled
from simharness.types.random_streams import stream

Alternative = Literal["two-sided", "greater", "less"]

EXACT = 12
"""So many pairs that differ are flipped in every way that there is; of more, ``DRAWS`` ways are drawn."""

DRAWS = 20_000

_CHUNK = 1_000  # draws at a time: of a thousand pairs, 8 MB


@dataclass(frozen=True)
class Interval:
    """A mean over scenes with its 95 % interval; NaN of no scene, and of one scene a mean without interval.

    Attributes:
        mean: over the scenes.
        low, high: the interval's ends.
        n: how many scenes the score applied to.
    """

    mean: float
    low: float
    high: float
    n: int


@dataclass(frozen=True)
class Paired:
    """How two measurements of the same scenes differ.

    Attributes:
        difference: mean of after - before; NaN without a pair.
        low, high: its 95 % interval; NaN of fewer than two pairs.
        p: how likely so large a difference is where signs are by chance; 1 without a pair.
        n: how many pairs.
    """

    difference: float
    low: float
    high: float
    p: float
    n: int


@dataclass(frozen=True)
class BreakingPoint:
    """Where a score passes its threshold as a factor grows.

    Attributes:
        value: of the factor; None where there is none: see ``why``.
        low, high: its 95 % interval. None: that end lies outside the values that were tried, or there is but one
            scene a value.
        why: "crosses" at ``value``; "never" within the values; "at once": the first value is past the threshold.
    """

    value: float | None
    low: float | None
    high: float | None
    why: Literal["crosses", "never", "at once"]


def mean_interval(values: Sequence[float | None] | ArrayLike, *, seed: int = 0, resamples: int = 2000) -> Interval:
    """The mean of a score (n,) over scenes with its 95 % interval, by resampling scenes.

    Percentiles are expanded as :func:`simharness.statistics.bootstrap.interval` says: a dozen scenes are few.

    Args:
        values: the score of each scene.
        seed: of the resampling.
        resamples: how many.
    """
    values = _floats(values)
    values = values[np.isfinite(values)]
    if not len(values):
        return Interval(np.nan, np.nan, np.nan, 0)
    low, high = _mean_ends(values, seed, resamples)
    return Interval(float(values.mean()), low, high, len(values))


def paired(
    before: Sequence[float | None] | ArrayLike,
    after: Sequence[float | None] | ArrayLike,
    *,
    alternative: Alternative = "two-sided",
    seed: int = 0,
) -> Paired:
    """Compare two measurements of the same scenes, (n,) each, by a sign-flip permutation test of the mean difference.

    Pairs that do not differ are the same flipped: among ``EXACT`` others the test is exact, with p down to
    2^-12 = 0.00024; of more pairs ``DRAWS`` flips are drawn, and p is at least 1 / 20,001 (Phipson & Smyth, 2010).
    The signs are flipped one by one, so that p holds only where the pairs are independent of each other.

    Args:
        before: the score of each scene.
        after: likewise, in the same order.
        alternative: of what p is the probability: of "greater" that after is, by chance, so much greater than before.
        seed: of the draws.

    Raises:
        ValueError: not as many after as before, or an alternative that does not exist.
    """
    if alternative not in ("two-sided", "greater", "less"):
        raise ValueError(f"alternative must be two-sided, greater or less, got {alternative!r}")
    before, after = _floats(before), _floats(after)
    if before.shape != after.shape:
        raise ValueError(f"pairs need as many scores after as before, got {len(after)} and {len(before)}")
    change = after - before
    change = change[np.isfinite(change)]
    if not len(change):
        return Paired(np.nan, np.nan, np.nan, 1.0, 0)
    low, high = _mean_ends(change, seed, 2000)
    return Paired(float(change.mean()), low, high, _sign_flip(change, alternative, seed), len(change))


def holm(p: Sequence[float]) -> list[float]:
    """Holm's adjusted p of many tests, in their order: those below a level may be believed all together.

    Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 1979.

    Raises:
        ValueError: a p that is not between 0 and 1.
    """
    values = np.asarray(p, float)
    if not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f"p must be between 0 and 1, got {list(p)}")
    order = np.argsort(values, kind="stable")
    adjusted = np.empty(len(values))
    adjusted[order] = np.maximum.accumulate(values[order] * np.arange(len(values), 0, -1))
    return [float(each) for each in np.minimum(adjusted, 1.0)]


def breaking_point(
    values: ArrayLike,
    scores: ArrayLike,
    threshold: float,
    *,
    better: Literal["higher", "lower"],
    seed: int = 0,
    resamples: int = 2000,
) -> BreakingPoint:
    """The first value of a factor at which the mean score over scenes passes a threshold to its bad side.

    Between the values that were tried it is interpolated linearly; the interval is by resampling seeds (rows).

    Args:
        values: of the factor, (k,), ascending.
        scores: (n, k): a row for each seed, NaN where the score does not apply; such values are passed over.
        threshold: of the mean; on it is still good.
        better: which side is good.
        seed: of the resampling.
        resamples: how many.

    Raises:
        ValueError: values that do not ascend, or scores of another shape.
    """
    values, scores = np.asarray(values, float), np.asarray(scores, float)
    if values.ndim != 1 or not len(values) or not (np.diff(values) > 0).all():
        raise ValueError(f"values must be one row that ascends, got {values.tolist()}")
    if scores.ndim != 2 or scores.shape[1] != len(values) or not len(scores):
        raise ValueError(f"scores must be (n, {len(values)}), n at least 1, got {scores.shape}")
    good = (scores - threshold) * (1 if better == "higher" else -1)  # negative is past the threshold
    known = np.isfinite(good)
    weights = np.vstack([np.ones(len(good)), block_weights(np.arange(len(good)), resamples=resamples, seed=seed)])
    counts = resampled(known, weights)
    sums = resampled(np.where(known, good, 0.0), weights)
    means = np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)
    crossings = np.array([_crossing(values, row) for row in means])
    value = float(crossings[0])
    low = high = None
    if len(scores) > 1:
        # Those that never cross, or at once, lie outside by as much as the range is wide: quantiles must be finite.
        span = max(float(np.ptp(values)), 1.0)
        finite = np.clip(crossings[1:], values[0] - span, values[-1] + span)
        ends = [float(end) for end in interval(finite, blocks=len(scores))]
        low, high = (end if values[0] <= end <= values[-1] else None for end in ends)
    if np.isposinf(value):
        return BreakingPoint(None, low, high, "never")
    if np.isneginf(value):
        return BreakingPoint(None, low, high, "at once")
    return BreakingPoint(value, low, high, "crosses")


def _floats(values: Sequence[float | None] | ArrayLike) -> Floats:
    """A row of floats, NaN for None."""
    row = np.array(values, float)
    if row.ndim != 1:
        raise ValueError(f"scores must be one row, a scene each, got shape {row.shape}")
    return row


def _mean_ends(values: Floats, seed: int, resamples: int) -> tuple[float, float]:
    """The 95 % interval of a mean over scenes."""
    if len(values) < 2:
        return np.nan, np.nan
    weights = block_weights(np.arange(len(values)), resamples=resamples, seed=seed)
    low, high = interval(resampled(values, weights) / len(values), blocks=len(values))
    return float(low), float(high)


def _sign_flip(change: Floats, alternative: Alternative, seed: int) -> float:
    """How often random signs make a sum at least as extreme as the one that was seen."""
    moved = change[change != 0]
    seen, tiny = moved.sum(), 1e-9 * np.abs(moved).sum()  # sums in another order are equal but for rounding

    def extreme(sums: Floats) -> int:
        if alternative == "greater":
            return int((sums >= seen - tiny).sum())
        if alternative == "less":
            return int((sums <= seen + tiny).sum())
        return int((np.abs(sums) >= abs(seen) - tiny).sum())

    if len(moved) <= EXACT:
        ways = np.arange(2 ** len(moved))
        signs = 1 - 2 * ((ways[:, None] >> np.arange(len(moved))) & 1)
        return extreme(signs @ moved) / len(ways)
    draws = stream(seed, "sign-flip")
    count = sum(extreme((1 - 2 * draws.integers(2, size=(_CHUNK, len(moved)))) @ moved) for _ in range(DRAWS // _CHUNK))
    return (1 + count) / (1 + DRAWS)


def _crossing(values: Floats, good: Floats) -> float:
    """Where a broken line first goes below zero; inf where it never does, -inf where it begins there."""
    known = np.isfinite(good)
    values, good = values[known], good[known]
    below = np.flatnonzero(good < 0)
    if not len(below):
        return np.inf
    after = below[0]
    if after == 0:
        return -np.inf
    share = good[after - 1] / (good[after - 1] - good[after])
    return float(values[after - 1] + share * (values[after] - values[after - 1]))
