"""Correction of p-values for many tests."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.statistics.paired_tests import DRAWS, EXACT, ROUNDING, sign_flips
from simharness.types.random_streams import stream


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


@dataclass(frozen=True)
class JointP:
    """P-values of many tests of the same scenes, corrected for each other.

    Attributes:
        p: corrected p-values, (m + k,): of the sign-flip tests, then of the others.
        least: least p-value of the sign-flip tests for each sign flip, (f,).
        others: number k of other tests.
    """

    p: Floats
    least: Floats
    others: int

    def corrected(self, p: float) -> float:
        """Return the corrected p-value of a test with this p-value, if no other is rejected before it."""
        return max(p, min(1.0, float((self.least <= p * (1 + ROUNDING)).mean()) + self.others * p))


def joint_p(changes: Floats, others: Sequence[float] = (), *, draws: int = DRAWS, seed: int = 0) -> JointP:
    """Correct the p-values of many tests of the same scenes, so that the level holds for all of them together.

    The signs of all changes of a scene are flipped together, as exchanging the two measurements would. Of a test, as
    many flips count as have a smaller least p-value among the tests that are not yet rejected: step-down minP (Westfall
    & Young, "Resampling-based multiple testing", 1993). Tests that agree, such as similar scores of one change, are
    hardly corrected; for tests that have nothing in common it is nearly Holm's correction. Tests of another kind
    are added by Boole's inequality.

    Args:
        changes: differences of m tests in n scenes, (m, n); 0 where a test lacks a scene.
        others: p-values of k tests that are not sign-flip tests of a mean.
        draws: number of random sign flips, for more than ``EXACT`` scenes.
        seed: seed of the draws.

    Raises:
        ValueError: a p-value that is not between 0 and 1.
    """
    p = _flipped_p(changes, draws, seed)
    observed = np.concatenate([p[:, 0], np.asarray(others, float)])
    if not ((observed >= 0) & (observed <= 1)).all():
        raise ValueError(f"p must be between 0 and 1, got {list(others)}")
    order = np.argsort(observed, kind="stable")
    adjusted, least, added = np.ones(len(observed)), np.ones(p.shape[1]), 0
    for at in order[::-1]:
        if at < len(p):
            least = np.minimum(least, p[at])
        else:
            added += 1
        adjusted[at] = min(1.0, (least <= observed[at] * (1 + ROUNDING)).mean() + added * observed[at])
    adjusted[order] = np.maximum.accumulate(adjusted[order])
    return JointP(adjusted, least, added)


def _flipped_p(changes: Floats, draws: int, seed: int) -> Floats:
    """Return the p-values of m tests (m, n) for f joint sign flips of the scenes, (m, f); the first flips nothing."""
    n = changes.shape[1]
    if n <= EXACT:
        signs = sign_flips(n)
    else:
        signs = stream(seed, "joint-sign-flip").choice([-1.0, 1.0], (1 + draws, n))
        signs[0] = 1.0
    sums = np.abs(changes @ signs.T)
    lowest = sums - ROUNDING * np.abs(changes).sum(axis=1, keepdims=True)
    below = [np.searchsorted(np.sort(row), low) for row, low in zip(sums, lowest, strict=True)]
    return 1 - np.reshape(below, sums.shape) / len(signs)
