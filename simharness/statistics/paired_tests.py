"""Significance of the difference between two measurements of the same scenes, and correction for many tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.statistics.intervals import mean_ends, scene_scores
from simharness.types.random_streams import stream

Alternative = Literal["two-sided", "greater", "less"]

EXACT = 12
"""Largest number of differing pairs for which all sign flips are enumerated; for more, :data:`DRAWS` are drawn."""

DRAWS = 20_000
"""Number of random sign flips."""

_CHUNK = 1_000  # draws at a time: 8 MB for a thousand pairs


@dataclass(frozen=True)
class Paired:
    """Difference between two measurements of the same scenes.

    Attributes:
        difference: mean of after - before; NaN without pairs.
        low, high: ends of its 95 % interval; NaN with fewer than two pairs.
        p: p-value, the probability of a difference at least this large under random signs; 1 without pairs.
        n: number of pairs.
    """

    difference: float
    low: float
    high: float
    p: float
    n: int


def paired(
    before: Sequence[float | None] | ArrayLike,
    after: Sequence[float | None] | ArrayLike,
    *,
    alternative: Alternative = "two-sided",
    seed: int = 0,
) -> Paired:
    """Compare two measurements of the same scenes, (n,) each, by a sign-flip permutation test of the mean difference.

    Flipping the sign of a pair without difference changes nothing. With at most ``EXACT`` other pairs the test is
    exact, with p down to 2^-12 = 0.00024; with more, ``DRAWS`` flips are drawn, and p is at least 1 / 20,001 (Phipson
    & Smyth, 2010). Signs are flipped independently, so p is valid only if the pairs are independent of each other.

    Args:
        before: score of each scene.
        after: score of each scene, in the same order.
        alternative: alternative hypothesis; "greater": after is greater than before.
        seed: seed of the draws.

    Raises:
        ValueError: different numbers of scores, or an unknown alternative.
    """
    if alternative not in ("two-sided", "greater", "less"):
        raise ValueError(f"alternative must be two-sided, greater or less, got {alternative!r}")
    before, after = scene_scores(before), scene_scores(after)
    if before.shape != after.shape:
        raise ValueError(f"pairs need as many scores after as before, got {len(after)} and {len(before)}")
    change = after - before
    change = change[np.isfinite(change)]
    if not len(change):
        return Paired(np.nan, np.nan, np.nan, 1.0, 0)
    low, high = mean_ends(change, seed, 2000)
    return Paired(float(change.mean()), low, high, _sign_flip_p(change, alternative, seed), len(change))


def holm(p: Sequence[float]) -> list[float]:
    """Return Holm's adjusted p-values, in the order of ``p``, which control the family-wise error rate.

    Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 1979.

    Raises:
        ValueError: a p-value that is not between 0 and 1.
    """
    values = np.asarray(p, float)
    if not ((values >= 0) & (values <= 1)).all():
        raise ValueError(f"p must be between 0 and 1, got {list(p)}")
    order = np.argsort(values, kind="stable")
    adjusted = np.empty(len(values))
    adjusted[order] = np.maximum.accumulate(values[order] * np.arange(len(values), 0, -1))
    return [float(each) for each in np.minimum(adjusted, 1.0)]


def _sign_flip_p(change: Floats, alternative: Alternative, seed: int) -> float:
    """Return the share of sign flips with a sum at least as extreme as the observed one."""
    differing = change[change != 0]
    # The order of a summation changes its rounding, so equal sums are compared with a tolerance.
    observed, tolerance = differing.sum(), 1e-9 * np.abs(differing).sum()

    def count_extreme(sums: Floats) -> int:
        if alternative == "greater":
            return int((sums >= observed - tolerance).sum())
        if alternative == "less":
            return int((sums <= observed + tolerance).sum())
        return int((np.abs(sums) >= abs(observed) - tolerance).sum())

    n = len(differing)
    if n <= EXACT:
        flips = np.arange(2**n)
        signs = 1 - 2 * ((flips[:, None] >> np.arange(n)) & 1)
        return count_extreme(signs @ differing) / len(flips)
    draws = stream(seed, "sign-flip")
    count = sum(
        count_extreme((1 - 2 * draws.integers(2, size=(_CHUNK, n))) @ differing) for _ in range(DRAWS // _CHUNK)
    )
    return (1 + count) / (1 + DRAWS)
