"""Pseudo-values of figures of sums."""

import numpy as np
import pytest

from simharness.statistics.intervals import mean_interval
from tools.jackknife import pseudo_values


def ratio(sums):
    return sums[..., 0] / sums[..., 1]


def test_the_pseudo_values_of_a_mean_are_the_values():
    values = np.random.default_rng(0).normal(size=9)
    pairs = np.stack([values, np.full(9, 4.0)], axis=1)
    np.testing.assert_allclose(pseudo_values(ratio, pairs), values / 4)


def test_their_deviation_is_that_of_a_ratio():
    """The variance of a ratio by linearisation: that of (count - ratio * of) / mean of."""
    rng = np.random.default_rng(1)
    of = rng.integers(50, 150, 200).astype(float)
    count = rng.poisson(0.1 * of).astype(float)
    linear = (count - count.sum() / of.sum() * of) / of.mean()
    values = pseudo_values(ratio, np.stack([count, of], axis=1))
    assert values.std() == pytest.approx(linear.std(), rel=0.02)


def test_intervals_of_ratios_cover_them():
    rng = np.random.default_rng(2)
    covered = 0
    for _ in range(300):
        of = rng.integers(20, 200, 12).astype(float)
        count = rng.binomial(of.astype(int), rng.beta(2, 6, 12))
        interval = mean_interval(100 * pseudo_values(ratio, np.stack([count, of], axis=1)), unit="%")
        covered += interval.low <= 25.0 <= interval.high
    assert 0.91 < covered / 300 < 0.995
