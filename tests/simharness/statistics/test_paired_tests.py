"""Tests of pairs, and Holm's correction."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from simharness.statistics.paired_tests import DRAWS, paired
from simharness.statistics.studentized import p_greater


def by_enumeration(change, alternative):
    sums = [
        sum(s * c for s, c in zip(signs, change, strict=True))
        for signs in itertools.product((1, -1), repeat=len(change))
    ]
    observed, tolerance = sum(change), 1e-9
    extreme = {
        "greater": [each >= observed - tolerance for each in sums],
        "less": [each <= observed + tolerance for each in sums],
        "two-sided": [abs(each) >= abs(observed) - tolerance for each in sums],
    }
    return sum(extreme[alternative]) / len(sums)


@pytest.mark.parametrize("alternative", ["greater", "less", "two-sided"])
@given(change=st.lists(st.integers(-5, 5).map(float), min_size=1, max_size=8))
def test_p_is_the_share_of_all_signs_that_are_as_extreme_or_that_of_t(change, alternative):
    before = np.linspace(50, 90, len(change))
    result = paired(before, before + change, alternative=alternative)
    more, less = (p_greater(sign * np.array(change)) if len(change) > 1 else 0.0 for sign in (1, -1))
    of_t = {"greater": more, "less": less, "two-sided": min(1.0, 2 * min(more, less))}[alternative]
    assert result.p == pytest.approx(max(by_enumeration(change, alternative), of_t), abs=1e-9)
    assert result.difference == pytest.approx(np.mean(change))


def test_twelve_pairs_that_all_fall_have_p_of_one_in_4096():
    before = np.arange(12.0)
    fallen = paired(before, before - np.linspace(1, 2, 12), alternative="less")
    assert fallen.p == 1 / 4096
    assert paired(before, before - np.linspace(1, 2, 12)).p == 2 / 4096
    assert fallen.high < 0
    # Few pairs without difference do not change p.
    many = np.concatenate([before, np.zeros(20)])
    assert paired(many, many - np.concatenate([np.linspace(1, 2, 12), np.zeros(20)]), alternative="less").p == 1 / 4096


def test_drawn_signs_agree_with_all_signs():
    rng = np.random.default_rng(3)
    change = rng.normal(0.45, 1.0, 16)
    flips = 1 - 2 * ((np.arange(2**16)[:, None] >> np.arange(16)) & 1)
    exact = np.mean(flips @ change >= change.sum() - 1e-9)
    result = paired(np.zeros(16), change, alternative="greater")
    assert 0.01 < exact < 0.3
    assert abs(result.p - exact) < 4 * math.sqrt(exact * (1 - exact) / DRAWS)
    assert paired(np.zeros(16), change, alternative="greater").p == result.p  # the draws are keyed
    assert paired(np.zeros(100), np.ones(100), alternative="greater").p == 1 / (1 + DRAWS)
    assert paired(np.zeros(100), np.ones(100), alternative="greater", draws=400_000).p == 1 / 400_001


def test_no_change_is_no_evidence():
    same = paired(np.arange(50.0), np.arange(50.0))
    assert (same.difference, same.p, same.n) == (0.0, 1.0, 50)
    none = paired([None, 1.0], [2.0, None])
    assert (none.p, none.n) == (1.0, 0)


def test_random_differences_are_significant_no_more_often_than_the_level():
    rng = np.random.default_rng(8)
    for pairs in (10, 20):
        p = np.array([paired(np.zeros(pairs), rng.standard_t(3, pairs)).p for _ in range(200)])
        assert (p <= 0.05).mean() < 0.05 + 2.5 * math.sqrt(0.05 * 0.95 / 200)
        assert 0.4 < p.mean() < 0.6


SKEWED = {
    "exponential": lambda rng, shape: rng.exponential(size=shape) - 1,
    "gamma": lambda rng, shape: rng.gamma(0.7, size=shape) - 0.7,
    "mostly zero": lambda rng, shape: np.where(rng.random(shape) < 0.5, 0.0, rng.exponential(size=shape)) - 0.5,
}


@pytest.mark.parametrize("distribution", sorted(SKEWED))
@pytest.mark.parametrize("pairs", [8, 20, *(pytest.param(many, marks=pytest.mark.slow) for many in (12, 60))])
def test_skewed_differences_without_a_mean_are_seldom_significant(distribution, pairs):
    """Sign flips and Student's t alone reject 10 to 25 % of these, below the mean."""
    changes = SKEWED[distribution](np.random.default_rng(pairs), (400, pairs))
    p = np.array([paired(np.zeros(pairs), each, alternative="less").p for each in changes])
    assert binomtest(int((p <= 0.05).sum()), 400, 0.085, alternative="greater").pvalue > 0.01
    assert (p <= 0.001).sum() <= 4  # binomial: 0.003 would give more once in 500


@pytest.mark.parametrize("side", [1, -1])
def test_homogeneous_losses_stay_significant_among_170_tests(side):
    """Twelve seeds that all change by 1 ± 0.2, tested with Holm's correction at level 0.05."""
    rng = np.random.default_rng(4)
    alternative = "greater" if side > 0 else "less"
    p = [paired(np.zeros(12), side * rng.normal(1.0, 0.2, 12), alternative=alternative).p for _ in range(200)]
    assert np.mean(np.array(p) * 170 <= 0.05) > 0.93


def test_bad_arguments_of_paired_are_refused():
    with pytest.raises(ValueError, match=r"got 2 and 3"):
        paired([1, 2, 3], [1, 2])
    with pytest.raises(ValueError, match="two-sided, greater or less"):
        paired([1], [2], alternative="worse")
