"""Breaking points of scores along a factor."""

import numpy as np
import pytest
from scipy.stats import binomtest

from simharness.statistics.breaking_points import breaking_point


def test_a_line_breaks_where_it_meets_the_threshold():
    values = np.array([0.0, 1.0, 2.0, 4.0])
    scores = np.tile(100 - 10 * values, (5, 1))
    point = breaking_point(values, scores, 75.0, better="higher")
    assert point.value == pytest.approx(2.5)
    assert point.why == "crosses"
    assert (point.low, point.high) == (2.0, 4.0)  # a curve with a knee may break anywhere between them
    rising = breaking_point(values, 10 * np.tile(values, (5, 1)), 25.0, better="lower")
    assert rising.value == pytest.approx(2.5)


def test_means_that_rise_again_are_pooled():
    point = breaking_point([1, 2, 3, 4], [[90, 70, 95, 60]], 80, better="higher")
    assert point.value == pytest.approx(3 + 2.5 / 22.5)  # 70 and 95 are 82.5 in the monotone fit
    assert (point.low, point.high) == (None, None)  # one seed has no interval


@pytest.mark.parametrize("values", [[2, 1], [0, 1, 1], [0, 2, 1, 3], [], [[0, 1]]])
def test_values_that_do_not_ascend_are_refused(values):
    with pytest.raises(ValueError, match="values must be one row that ascends"):
        breaking_point(values, np.ones((3, max(len(values), 1))), 0.5, better="higher")


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
    assert point.low == 2.0
    assert point.high is None


def test_missing_scores_are_ignored():
    gap = [[100.0, np.nan, 60.0], [100.0, np.nan, 60.0]]
    assert breaking_point([0, 1, 2], gap, 80, better="higher").value == pytest.approx(1.0)
    one = [[100.0, np.nan, 60.0], [100.0, 70.0, 60.0]]
    assert breaking_point([0, 1, 2], one, 85, better="higher").value == pytest.approx(0.5)


def test_the_interval_reaches_from_the_last_good_to_the_first_bad_value():
    """Noise of a mean that is less than its distance from the threshold: ends are the values beside the crossing."""
    rng = np.random.default_rng(5)
    values = np.array([0.0, 0.5, 1.5, 2.5, 2.75, 9.0])
    scores = 100 - 10 * values + rng.normal(0, 0.1, (12, 6))
    point = breaking_point(values, scores, 80, better="higher")
    assert (point.low, point.value, point.high) == pytest.approx((1.5, 2.0, 2.5), abs=0.01)
    uncertain = breaking_point(values, 100 - 10 * values + rng.normal(0, 9, (12, 6)), 80, better="higher")
    assert uncertain.low <= 1.5
    assert uncertain.high is None or uncertain.high >= 2.5


@pytest.mark.parametrize("scenes", [5, 10, 20, 80])
def test_more_scenes_do_not_lose_the_break_of_a_knee(scenes):
    """The mean falls from 5.5 on and passes 90 at 6.0, between the tested 4 and 8; interpolation crosses at 5.1.

    Intervals of the interpolated curve hold 6.0 in 49, 2 and 0 % of the samples of 5, 10 and 20 scenes.
    """
    rng = np.random.default_rng(scenes)
    values = np.array([0.0, 2.0, 4.0, 8.0])
    mean = 97 - np.maximum(values - 5.5, 0) * 14
    points = [
        breaking_point(
            values, mean + rng.normal(0, 4, (scenes, 1)) + rng.normal(0, 4, (scenes, 4)), 90, better="higher"
        )
        for _ in range(120)
    ]
    covered = sum((each.low is None or each.low <= 6.0) and (each.high is None or each.high >= 6.0) for each in points)
    assert binomtest(covered, 120, 0.95, alternative="less").pvalue > 0.01
    if scenes >= 20:
        assert np.median([each.low for each in points]) == 4.0
        assert np.median([each.high for each in points]) == 8.0


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


def test_bad_curves_are_refused():
    with pytest.raises(ValueError, match="ascends"):
        breaking_point([1, 1], [[1, 2]], 0, better="higher")
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        breaking_point([1, 2, 3], [[1, 2]], 0, better="higher")
