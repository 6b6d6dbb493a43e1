"""Tests of counts of rare events in pairs of measurements."""

import numpy as np
import pytest
from scipy.stats import binomtest

from simharness.statistics.paired_tests import paired_counts


def test_single_events_are_binomial():
    before, after = [0] * 12, [1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0]
    assert paired_counts(before, after, alternative="greater").p == pytest.approx(1 / 32)
    assert paired_counts(after, before, alternative="greater").p == 1.0
    assert paired_counts(before, after).p == pytest.approx(1 / 16)
    both = paired_counts([1, 0, 0, 0, 0, 0, 0, 0], [0, 1, 1, 1, 1, 1, 1, 0], alternative="greater")
    assert both.p == pytest.approx(binomtest(6, 7, alternative="greater").pvalue)


def test_events_that_both_have_say_nothing():
    base = np.array([40, 0, 3, 200, 7, 9, 0, 1, 5, 2])
    extra = np.array([1, 1, 0, 1, 1, 1, 0, 1, 1, 0])
    assert paired_counts(base, base + extra).p == paired_counts(np.zeros(10), extra).p
    assert paired_counts(base, base).p == 1.0


def test_a_cluster_in_one_scene_counts_as_one_event():
    after = [30] + [0] * 11
    assert paired_counts([0] * 12, after, alternative="greater").p > 0.4


def test_the_rate_is_over_all_frames():
    result = paired_counts([1, 0, 2], [2, 3, 2], [50, 100, 50])
    assert result.difference == pytest.approx(4 / 200)
    assert (result.n, paired_counts([1, None, 2], [2, 1, None]).n) == (3, 1)
    assert result.low < result.difference < result.high
    assert (paired_counts([], []).p, paired_counts([], []).n) == (1.0, 0)


def compound(rng, shape, rate, size):
    """Return counts of events that come in clusters of geometric sizes."""
    clusters = rng.poisson(rate, shape)
    return np.where(clusters > 0, clusters + rng.negative_binomial(np.maximum(clusters, 1), 1 / size), 0)


EQUAL_RATES = {
    "single events": lambda rng, shape: rng.poisson(5, (2, *shape)),
    "hard and easy scenes": lambda rng, shape: rng.poisson(rng.gamma(0.5, 10, shape), (2, *shape)),
    "ghosts that stay": lambda rng, shape: compound(rng, (2, *shape), 0.5, 5),
    "long ghosts": lambda rng, shape: compound(rng, (2, *shape), 2, 10),
    "shared events": lambda rng, shape: rng.poisson(20, shape) + compound(rng, (2, *shape), 0.3, 5),
}


@pytest.mark.parametrize("events", sorted(EQUAL_RATES))
@pytest.mark.parametrize("scenes", [5, 8, 12, 20])
def test_equal_rates_are_seldom_significant(events, scenes):
    """A binomial test without dispersion rejects 25 to 35 % of clustered events."""
    before, after = EQUAL_RATES[events](np.random.default_rng(scenes), (500, scenes))
    p = np.array([paired_counts(*each, alternative="greater").p for each in zip(before, after, strict=True)])
    assert binomtest(int((p <= 0.05).sum()), 500, 0.05, alternative="greater").pvalue > 0.01
    assert (p <= 0.001).sum() <= 6


def test_more_ghosts_are_found_where_only_some_scenes_have_any():
    """Three lost frames on average in each of twelve scenes: significant among 170 tests."""
    rng = np.random.default_rng(2)
    p = [paired_counts(rng.poisson(0.2, 12), rng.poisson(3, 12), 50, alternative="greater").p for _ in range(200)]
    assert np.mean(np.array(p) * 170 <= 0.05) > 0.85


def test_bad_counts_are_refused():
    with pytest.raises(ValueError, match="got 2 and 1"):
        paired_counts([1], [1, 2])
    with pytest.raises(ValueError, match="at least 0"):
        paired_counts([1, -1], [1, 2])
    with pytest.raises(ValueError, match="above 0"):
        paired_counts([1], [1], [0.0])
    with pytest.raises(ValueError, match="two-sided, greater or less"):
        paired_counts([1], [1], alternative="worse")
