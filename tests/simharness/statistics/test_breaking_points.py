"""Breaking points of scores along a factor."""

import numpy as np
import pytest
from scipy.stats import binomtest

from simharness.statistics.breaking_points import breaking_point
from simharness.statistics.intervals import mean_interval


def test_a_line_breaks_where_it_meets_the_threshold():
    values = np.array([0.0, 1.0, 2.0, 4.0])
    scores = np.tile(100 - 10 * values, (5, 1))
    point = breaking_point(values, scores, 75.0, better="higher")
    assert point.value == pytest.approx(2.5)
    assert point.why == "crosses"
    assert (point.low, point.high) == pytest.approx((2.5, 2.5))
    rising = breaking_point(values, 10 * np.tile(values, (5, 1)), 25.0, better="lower")
    assert rising.value == pytest.approx(2.5)


def test_means_that_rise_again_are_pooled():
    point = breaking_point([1, 2, 3, 4], [[90, 70, 95, 60]], 80, better="higher")
    assert point.value == pytest.approx(3 + 2.5 / 22.5)  # 70 and 95 are 82.5 in the monotone fit
    assert (point.low, point.high) == (None, None)  # one seed has no interval


def test_a_score_at_the_threshold_is_good():
    assert breaking_point([1, 2], [[80, 80]] * 3, 80, better="higher").why == "never"
    assert breaking_point([1, 2], [[80, 79]] * 3, 80, better="higher").value == pytest.approx(1.0)


def test_without_a_crossing_the_side_is_named():
    never = breaking_point([1, 2, 3], [[99, 98, 97], [99, 97, 96]], 90, better="higher")
    assert (never.value, never.low, never.high, never.why) == (None, None, None, "never")
    at_once = breaking_point([1, 2, 3], [[50, 95, 95], [51, 95, 95]], 90, better="higher")
    assert (at_once.value, at_once.low, at_once.high, at_once.why) == (None, None, None, "at once")


def test_the_interval_is_open_where_some_seeds_never_cross():
    scores = [[100, 100, 60]] * 4 + [[100, 100, 100]] * 4
    point = breaking_point([1, 2, 3], scores, 85, better="higher")
    assert point.value == pytest.approx(2.75)
    assert 2.375 <= point.low < 2.75  # if all seeds fell as four of them do: 2 + 15/40
    assert point.high is None


def test_missing_scores_are_ignored():
    gap = [[100.0, np.nan, 60.0], [100.0, np.nan, 60.0]]
    assert breaking_point([0, 1, 2], gap, 80, better="higher").value == pytest.approx(1.0)
    one = [[100.0, np.nan, 60.0], [100.0, 70.0, 60.0]]
    assert breaking_point([0, 1, 2], one, 85, better="higher").value == pytest.approx(0.5)


def test_intervals_of_breaking_points_have_their_nominal_coverage():
    """Scores fall by 10 a step with an offset for each seed: seeds break at 2 + N(0, 0.5)."""
    rng = np.random.default_rng(5)
    values = np.arange(7.0)
    covered = []
    for _ in range(300):
        offset = rng.normal(0, 5, (12, 1))
        point = breaking_point(values, 100 - 10 * values + offset, 80, better="higher")
        covered.append(point.low <= 2.0 <= point.high)
    assert 0.90 < np.mean(covered) < 0.985


@pytest.mark.parametrize(
    ("scenes", "plateau", "offset", "noise"),
    [(5, 95.0, 5.0, 5.0), (12, 92.0, 0.0, 6.0), (12, 92.0, 3.0, 3.0), (20, 91.0, 0.0, 6.0)],
)
def test_a_plateau_near_the_threshold_does_not_break_early(scenes, plateau, offset, noise):
    """The mean stays on a plateau up to 8 and passes 90 at 8.3; the first low mean would break at 3.5 to 7.4."""
    rng = np.random.default_rng(scenes)
    values = np.arange(1.0, 13.0)
    mean = plateau - np.maximum(values - 8, 0) * (plateau - 90) / 0.3
    broken, covered = [], []
    for _ in range(150):
        scores = mean + rng.normal(0, offset, (scenes, 1)) + rng.normal(0, noise, (scenes, 12))
        point = breaking_point(values, scores, 90, better="higher")
        broken.append({"at once": 1.0, "never": 12.0}.get(point.why, point.value))
        covered.append((point.low is None or point.low <= 8.3) and (point.high is None or point.high >= 8.3))
    assert np.mean(broken) == pytest.approx(8.3, abs=0.8)
    assert np.median(broken) == pytest.approx(8.3, abs=0.25)
    assert binomtest(int(np.sum(covered)), 150, 0.95, alternative="less").pvalue > 0.01


def test_the_interval_holds_the_values_whose_mean_may_be_the_threshold():
    """At one tested value the interval of a mean meets the threshold where the interval of the break ends."""
    rng = np.random.default_rng(3)
    values, base = np.array([0.0, 10.0]), rng.normal(0, 2, (12, 1))
    scores = 100 - 2 * values + base
    point = breaking_point(values, scores, 90, better="higher")
    means = mean_interval(base[:, 0])
    assert (point.low, point.value, point.high) == pytest.approx(
        tuple(5 + each / 2 for each in (means.low, means.mean, means.high)), abs=1e-6
    )


def test_bad_curves_are_refused():
    with pytest.raises(ValueError, match="ascends"):
        breaking_point([1, 1], [[1, 2]], 0, better="higher")
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        breaking_point([1, 2, 3], [[1, 2]], 0, better="higher")
