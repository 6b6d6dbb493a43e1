"""Verdicts: bounds and their three states, with closed-form figures."""

import math

import numpy as np
import pytest

from simharness.reality.validation.evidence import Compared, compared, rank_correlation
from simharness.reality.validation.verdicts import (
    BOUNDS,
    VerdictState,
    at_least,
    average,
    near,
    ratio,
    same_sign,
    within,
)
from simharness.statistics.intervals import Interval

HOLDS, UNCLEAR, FAILS = VerdictState.HOLDS, VerdictState.UNCLEAR, VerdictState.FAILS


def figure(real, twin, *, real_width=0.0, twin_width=0.0):
    """A figure with symmetric intervals of these half-widths."""
    return Compared(
        Interval(real, real - real_width, real + real_width, 1), Interval(twin, twin - twin_width, twin + twin_width, 9)
    )


@pytest.mark.parametrize(
    ("difference", "real_width", "twin_width", "state"),
    [
        (0.0, 0.0, 0.0, HOLDS),
        (1.5, 0.0, 0.0, HOLDS),
        (-1.5, 0.0, 0.0, HOLDS),
        (1.6, 0.0, 0.0, FAILS),
        (-1.6, 0.0, 0.0, FAILS),
        (1.6, 2.0, 0.0, UNCLEAR),  # the recording is too short to tell
        (-1.6, 2.0, 0.0, UNCLEAR),
        (2.1, 2.0, 0.0, FAILS),  # outside the interval
        (2.1, 2.0, 1.0, UNCLEAR),  # inside the joint interval
        (1.6, 1.4, 1.4, FAILS),  # the recording is long enough for the bound
        (1.6, 0.0, 9.0, FAILS),  # few twins are no excuse
        (math.nan, 9.0, 9.0, FAILS),
    ],
)
def test_a_difference_holds_is_unclear_or_fails(difference, real_width, twin_width, state):
    verdict = near("pcp", "pcp.x", figure(90.0, 90.0 + difference, real_width=real_width, twin_width=twin_width), 1.5)
    assert verdict.state == state


def test_sides_may_have_other_bounds():
    assert within("x", "x", figure(1.0, 1.3), -0.1, 0.4).state == HOLDS
    assert within("x", "x", figure(1.0, 0.8), -0.1, 0.4).state == FAILS


def test_the_uncertainty_takes_the_sides_that_face_each_other():
    asymmetric = Compared(Interval(10.0, 9.0, 14.0, 1), Interval(12.0, 9.0, 12.5, 3))
    assert asymmetric.uncertainty == pytest.approx((5.0, math.hypot(0.5, 1.0)))


@pytest.mark.parametrize(("twin", "state"), [(0.76, HOLDS), (1.32, HOLDS), (0.74, FAILS), (1.34, FAILS)])
def test_a_ratio(twin, state):
    assert ratio("bones", "bones.shank", figure(20.0, 20.0 * twin), *BOUNDS.bones).state == state


@pytest.mark.parametrize(
    ("real", "twin", "state"), [(1.0, 2.9, HOLDS), (1.0, 3.1, FAILS), (30.0, 35.9, HOLDS), (30.0, 36.1, FAILS)]
)
def test_a_loss_may_differ_by_two_points_or_a_fifth(real, twin, state):
    assert near("dose", "dose.x", figure(real, twin), BOUNDS.loss_of(real)).state == state


def test_the_gain_of_more_cameras_has_the_last_bound():
    assert [BOUNDS.gain(count) for count in (2, 3, 4, 5, 10)] == [3.0, 1.5, 1.0, 1.0, 1.0]


def test_a_mean_difference_counts_absolute_values():
    curve = {2: figure(80.0, 84.0), 3: figure(90.0, 88.0)}
    assert average("subsets", "subsets.full", curve, 3.0).state == HOLDS
    assert average("subsets", "subsets.full", curve, 2.9).state == FAILS
    wide = {count: figure(each.real.mean, each.twin.mean, real_width=3.5) for count, each in curve.items()}
    assert average("subsets", "subsets.full", wide, 2.9).state == UNCLEAR


@pytest.mark.parametrize(
    ("low", "high", "twin", "twin_width", "state"),
    [
        (-0.5, 1.0, -3.0, 0.0, None),  # reality is not clear
        (0.5, 1.0, 0.1, 0.0, HOLDS),
        (0.5, 1.0, -0.1, 0.0, FAILS),
        (0.5, 1.0, -0.1, 0.2, UNCLEAR),
        (-1.0, -0.5, 0.1, 0.0, FAILS),
    ],
)
def test_the_order_counts_where_reality_is_clear(low, high, twin, twin_width, state):
    contrast = Compared(
        Interval((low + high) / 2, low, high, 1), Interval(twin, twin - twin_width, twin + twin_width, 9)
    )
    verdict = same_sign("order.a.b", contrast)
    assert (verdict and verdict.state) == state


class TestRanks:
    def test_a_monotone_function_has_correlation_one(self):
        values = np.array([3.0, 1.0, 4.0, 1.5, 9.0])
        assert rank_correlation(values, np.exp(values)).mean == pytest.approx(1.0)
        assert rank_correlation(values, -values).mean == pytest.approx(-1.0)

    def test_the_formula_without_ties(self):
        one, other = [1, 2, 3, 4], [1, 3, 2, 4]
        assert rank_correlation(one, other).mean == pytest.approx(1 - 6 * 2 / (4 * 15))

    def test_what_cannot_be_ranked_is_nan(self):
        for one, other in (([1, 2], [1, 2]), ([1, 1, 1], [1, 2, 3]), ([1, 2, np.nan, 3], [np.nan, 1, 2, 3])):
            assert np.isnan(rank_correlation(one, other).mean)

    def test_the_interval_comes_from_the_resamples(self):
        resamples = np.array([[1.0, 2.0, 3.0]] * 50 + [[1.0, 3.0, 2.0]] * 50)
        rank = rank_correlation([1, 2, 3], [1, 2, 3], resamples=resamples)
        assert (rank.low, rank.high) == pytest.approx((0.5, 1.0))

    @pytest.mark.parametrize(
        ("value", "high", "state"),
        [(0.8 - 1e-16, 0.8, HOLDS), (0.7, 0.9, UNCLEAR), (0.7, 0.75, FAILS), (0.7, math.nan, FAILS)],
    )
    def test_bounds(self, value, high, state):
        assert at_least("draw_rank", "x", Interval(value, value, high, 1), 0.8).state == state


def test_a_figure_has_the_mean_of_its_twins_and_the_interval_of_its_resamples():
    made = compared(1.0, np.linspace(0.0, 2.0, 1001), [2.0, 4.0, 6.0])
    assert (made.real.low, made.real.high) == pytest.approx((0.05, 1.95))
    assert (made.twin.mean, made.difference) == (4.0, 3.0)
    assert made.twin.low < 4.0 < made.twin.high
    assert made.summary()["real_interval"] == pytest.approx([0.05, 1.95])
