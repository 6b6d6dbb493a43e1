"""Breaking points of scores along a factor."""

import numpy as np
import pytest

from simharness.statistics.breaking_points import breaking_point


def test_a_line_breaks_where_it_meets_the_threshold():
    values = np.array([0.0, 1.0, 2.0, 4.0])
    scores = np.tile(100 - 10 * values, (5, 1))
    point = breaking_point(values, scores, 75.0, better="higher")
    assert point.value == pytest.approx(2.5)
    assert point.why == "crosses"
    assert (point.low, point.high) == pytest.approx((2.5, 2.5))
    rising = breaking_point(values, 10 * np.tile(values, (5, 1)), 25.0, better="lower")
    assert rising.value == pytest.approx(2.5)


def test_the_first_crossing_counts():
    point = breaking_point([1, 2, 3, 4], [[90, 70, 95, 60]], 80, better="higher")
    assert point.value == pytest.approx(1.5)
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
    assert point.low == pytest.approx(2.375, abs=0.2)  # all four falling seeds drawn: 2 + 15/40
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
    for trial in range(300):
        offset = rng.normal(0, 5, (12, 1))
        point = breaking_point(values, 100 - 10 * values + offset, 80, better="higher", seed=trial, resamples=400)
        covered.append(point.low <= 2.0 <= point.high)
    assert 0.90 < np.mean(covered) < 0.985


def test_bad_curves_are_refused():
    with pytest.raises(ValueError, match="ascends"):
        breaking_point([1, 1], [[1, 2]], 0, better="higher")
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        breaking_point([1, 2, 3], [[1, 2]], 0, better="higher")
