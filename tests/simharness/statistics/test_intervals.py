"""Means over scenes with intervals."""

import math

import numpy as np
import pytest
from scipy.stats import t

from simharness.statistics.intervals import mean_interval


def test_the_mean_is_over_the_scenes_to_which_the_score_applies():
    result = mean_interval([80.0, None, 90.0, float("nan"), 100.0])
    assert (result.mean, result.n) == (90.0, 3)
    assert 80.0 <= result.low < 90.0 < result.high <= 100.0


def test_fewer_than_two_scenes_have_no_interval():
    assert mean_interval([]).n == 0
    assert math.isnan(mean_interval([None]).mean)
    alone = mean_interval([3.0])
    assert (alone.mean, alone.n) == (3.0, 1)
    assert math.isnan(alone.low)
    assert math.isnan(alone.high)


def test_constant_scores_have_an_interval_of_no_width():
    result = mean_interval(np.full(12, 97.5))
    assert (result.low, result.mean, result.high) == (97.5, 97.5, 97.5)


@pytest.mark.parametrize("scenes", [6, 12, 30])
def test_intervals_have_their_nominal_coverage(scenes):
    rng = np.random.default_rng(scenes)
    results = [mean_interval(rng.normal(5.0, 2.0, scenes), seed=trial, resamples=500) for trial in range(600)]
    covered = np.mean([each.low <= 5.0 <= each.high for each in results])
    assert 0.95 - 0.035 < covered < 0.95 + 0.03  # 600 intervals: two standard errors are 0.018
    # As wide as Student's t interval.
    width = np.mean([each.high - each.low for each in results])
    c4 = math.sqrt(2 / (scenes - 1)) * math.gamma(scenes / 2) / math.gamma((scenes - 1) / 2)
    expected = 2 * t.isf(0.025, scenes - 1) * c4 * 2.0 / math.sqrt(scenes)
    assert width == pytest.approx(expected, rel=0.1)
