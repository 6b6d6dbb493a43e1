"""Test of a change in the number of rare events, such as ghosts, between two measurements of the same scenes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betainc

from mvpose.arrays import Floats
from simharness.statistics.intervals import scene_scores
from simharness.statistics.paired_tests import Alternative, Paired
from simharness.statistics.studentized import mean_ends

_PRIOR_SCENES = 4.0
"""Weight, in scenes, of the mean square change (which contains the tested effect) beside the variance of the changes.

The variance of few scenes may be small by chance; with this weight the level holds for 5 scenes as for 20.
"""


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
