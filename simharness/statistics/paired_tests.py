"""Significance of the difference between two measurements of the same scenes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betainc

from mvpose.arrays import Floats
from simharness.statistics.intervals import scene_scores
from simharness.statistics.studentized import mean_ends, p_greater
from simharness.types.random_streams import stream

Alternative = Literal["two-sided", "greater", "less"]

EXACT = 12
"""Largest number of differing pairs for which all sign flips are enumerated; for more, :data:`DRAWS` are drawn."""

DRAWS = 20_000
"""Usual number of random sign flips."""

ROUNDING = 1e-9
"""Relative tolerance of equal sums, since the order of a summation changes its rounding."""

_PRIOR_SCENES = 4.0
"""Weight, in scenes, of the mean square change (which contains the tested effect) beside the variance of the changes.

The variance of few scenes may be small by chance; with this weight the level holds for 5 scenes as for 20.
"""


@dataclass(frozen=True)
class Paired:
    """Difference between two measurements of the same scenes.

    Attributes:
        difference: mean of after - before; NaN without pairs.
        low, high: ends of its 95 % interval; NaN with fewer than two pairs.
        p: p-value of no difference; 1 without pairs.
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
    symmetric: bool = False,
    draws: int = DRAWS,
    seed: int = 0,
) -> Paired:
    """Test whether the mean of a score changed between two measurements of the same scenes, (n,) each.

    Two tests are made, and the larger p-value counts, so that the level holds where either test is valid:

    - A sign-flip permutation test of the mean difference, exact for differences with a symmetrical distribution.
      Flipping the sign of a pair without difference changes nothing. With at most ``EXACT`` other pairs all signs are
      enumerated; with more, ``draws`` flips are drawn, and p is at least 1 / (1 + draws) (Phipson & Smyth, 2010).
    - Student's t corrected for skewness (:mod:`simharness.statistics.studentized`).

    Pairs must be independent of each other.

    Args:
        before: score of each scene.
        after: score of each scene, in the same order.
        alternative: alternative hypothesis; "greater": after is greater than before.
        symmetric: whether the hypothesis is that both measurements have one distribution, not only one mean. The
            differences are symmetrical then, and sign flips alone are exact, with more power.
        draws: number of random sign flips; of many tests that are corrected, each needs a smaller least p-value.
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
    low, high = (float(end) for end in mean_ends(change))
    p = _sign_flip_p(change, alternative, draws, seed)
    if not symmetric:
        p = max(p, _studentized_p(change, alternative))
    return Paired(float(change.mean()), low, high, p, len(change))


def paired_counts(
    before: Sequence[float | None] | ArrayLike,
    after: Sequence[float | None] | ArrayLike,
    exposure: Sequence[float | None] | ArrayLike | float = 1.0,
    *,
    alternative: Alternative = "two-sided",
) -> Paired:
    """Test whether the rate of events changed between two measurements of the same scenes, (n,) each.

    Events that both measurements have say nothing. Of the others, u came and d went, by the net change of each scene;
    without a change of the rate u is binomial, Binomial(u + d, 1/2) (McNemar, Psychometrika 1947; Przyborowski &
    Wilenski, Biometrika 1940). Events of a scene come in clusters, because a ghost stays for many frames: both
    numbers are divided by the dispersion, the variance of the changes over scenes in units of the mean number of events
    that came or went, at least 1 (quasi-likelihood; McCullagh & Nelder, "Generalized linear models", section 4.5). The
    binomial probability of fractional numbers is the incomplete beta function.

    The test is for events that few scenes have, or several in each: the p-value can be less than that of
    :func:`simharness.statistics.paired_tests.paired`, which sees only the scenes (2^-n), and not the events.

    Args:
        before: number of events in each scene; None or NaN where it is unknown, which leaves the scene out.
        after: number of events in each scene, in the same order.
        exposure: frames of each scene, or of all scenes; both measurements have the same.
        alternative: alternative hypothesis; "greater": after is greater than before.

    Returns:
        The change of the rate, in events per unit of exposure, over all scenes together, with its interval.

    Raises:
        ValueError: different numbers of counts, negative or infinite counts, exposures that are not positive, or an
            unknown alternative.
    """
    if alternative not in ("two-sided", "greater", "less"):
        raise ValueError(f"alternative must be two-sided, greater or less, got {alternative!r}")
    before, after = scene_scores(before), scene_scores(after)
    if before.shape != after.shape:
        raise ValueError(f"pairs need as many counts after as before, got {len(after)} and {len(before)}")
    frames: Floats = np.broadcast_to(np.asarray(exposure, float), before.shape)
    known = ~(np.isnan(before) | np.isnan(after) | np.isnan(frames))
    before, after, frames = before[known], after[known], frames[known]
    if not (np.isfinite(before) & np.isfinite(after) & (before >= 0) & (after >= 0)).all():
        raise ValueError("counts must be finite and at least 0")
    if not (np.isfinite(frames) & (frames > 0)).all():
        raise ValueError("exposures must be finite and above 0")
    change: Floats = after - before
    if not len(change):
        return Paired(np.nan, np.nan, np.nan, 1.0, 0)
    rate = float(change.sum() / frames.sum())
    # A ratio of two sums has the error of the mean of its residuals (linearisation).
    low, high = mean_ends(rate + (change - rate * frames) / frames.mean())
    return Paired(rate, float(low), float(high), _p(change, alternative), len(change))


def _studentized_p(change: Floats, alternative: Alternative) -> float:
    """Return the p-value of the t test corrected for skewness; 0 for a single pair, which has no deviation."""
    if len(change) < 2:
        return 0.0
    if alternative == "greater":
        return p_greater(change)
    if alternative == "less":
        return p_greater(-change)
    return min(1.0, 2 * min(p_greater(change), p_greater(-change)))


def _sign_flip_p(change: Floats, alternative: Alternative, draws: int, seed: int) -> float:
    """Return the share of sign flips with a sum at least as extreme as the observed one."""
    differing = change[change != 0]
    observed, tolerance = differing.sum(), ROUNDING * np.abs(differing).sum()

    def count_extreme(sums: Floats) -> int:
        if alternative == "greater":
            return int((sums >= observed - tolerance).sum())
        if alternative == "less":
            return int((sums <= observed + tolerance).sum())
        return int((np.abs(sums) >= abs(observed) - tolerance).sum())

    n = len(differing)
    if n <= EXACT:
        return count_extreme(sign_flips(n) @ differing) / 2**n
    # A random byte is the signs of eight differences; their sums are looked up.
    eights = np.pad(differing, (0, -n % 8)).reshape(-1, 8)
    sums = sign_flips(8) @ eights.T
    drawn = stream(seed, "sign-flip").integers(256, size=(draws, len(eights)))
    share = (1 + count_extreme(sums[drawn, np.arange(len(eights))].sum(axis=1))) / (1 + draws)
    return max(share, 2.0**-n)  # no sum of random signs is rarer, but few draws may miss all


def sign_flips(n: int) -> Floats:
    """Return all signs of n differences, (2^n, n)."""
    return np.where((np.arange(2**n)[:, None] >> np.arange(n)) & 1, -1.0, 1.0)


def _p(change: Floats, alternative: Alternative) -> float:
    """Return the p-value of net changes (n,)."""
    came, went = np.maximum(change, 0).sum(), np.maximum(-change, 0).sum()
    if came + went == 0:
        return 1.0
    n = len(change)
    spread = ((change - change.mean()) ** 2).sum() + _PRIOR_SCENES * (change**2).mean()
    dispersion = max(1.0, spread / (n - 1 + _PRIOR_SCENES) / ((came + went) / n))
    came, went = came / dispersion, went / dispersion
    more, less = _binomial_tail(came, went), _binomial_tail(went, came)
    return {"greater": more, "less": less, "two-sided": min(1.0, 2 * min(more, less))}[alternative]


def _binomial_tail(up: float, down: float) -> float:
    """Return the probability of at least ``up`` heads among ``up + down`` tosses, continued to fractions."""
    return 1.0 if up <= 0 else float(betainc(up, down + 1, 0.5))
