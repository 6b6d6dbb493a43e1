"""Verdicts: bounds and their three states, with closed-form figures."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from simharness.reality.validation.evidence import Compared, compared, rank_correlation
from simharness.reality.validation.verdicts import (
    BOUNDS,
    VerdictState,
    at_least,
    at_most,
    near,
    ratio,
    same_sign,
    within,
)
from simharness.statistics.intervals import Interval

HOLDS, CANNOT_TELL, FAILS = VerdictState.HOLDS, VerdictState.CANNOT_TELL, VerdictState.FAILS
OF_90 = norm.ppf(0.95) / norm.ppf(0.975)  # half-width of a 90 % interval over that of 95 %


def figure(real, twin, *, real_width=0.0, twin_width=0.0):
    """A figure with symmetric 90 % intervals of these half-widths."""
    real_width, twin_width = real_width / OF_90, twin_width / OF_90
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
        (0.0, 1.4, 0.0, HOLDS),
        (0.0, 1.6, 0.0, CANNOT_TELL),  # no difference, but it could be as large as this
        (0.0, 0.0, 1.6, CANNOT_TELL),  # noisy twins are no better than noisy recordings
        (1.4, 0.2, 0.0, CANNOT_TELL),
        (1.4, 0.05, 0.05, HOLDS),
        (1.6, 0.2, 0.0, CANNOT_TELL),
        (5.0, 2.0, 2.5, FAILS),  # hypot(2, 2.5) = 3.2 < 3.5
        (5.0, 3.0, 2.5, CANNOT_TELL),
        (0.0, math.nan, 0.0, CANNOT_TELL),  # an unknown interval is no point
        (0.0, 0.0, math.nan, CANNOT_TELL),
        (math.nan, 0.0, 0.0, FAILS),  # the recording has the figure, the twins do not
    ],
)
def test_a_difference_is_judged_by_its_whole_interval(difference, real_width, twin_width, state):
    verdict = near("pcp", "pcp.x", figure(90.0, 90.0 + difference, real_width=real_width, twin_width=twin_width), 1.5)
    assert verdict.state == state


def test_a_figure_that_the_recording_lacks_is_not_judged_good():
    assert near("pcp", "pcp.x", figure(math.nan, 90.0), 1.5).state == CANNOT_TELL


@pytest.mark.slow
def test_equivalence_has_the_level_of_two_one_sided_tests():
    """At a true difference on the bound a verdict holds in 5 %, and fails in 5 %."""
    rng = np.random.default_rng(0)
    states = []
    for _ in range(1500):
        real, twins = rng.normal(90.0, 0.3), rng.normal(91.5, 0.3, size=10)
        made = compared(real, rng.normal(real, 0.3, size=400), twins.tolist())
        states.append(near("pcp", "pcp.x", made, 1.5).state)
    assert states.count(HOLDS) / len(states) == pytest.approx(0.05, abs=0.02)
    assert states.count(FAILS) / len(states) == pytest.approx(0.05, abs=0.02)


def test_sides_may_have_other_bounds():
    assert within("x", "x", figure(1.0, 1.3), -0.1, 0.4).state == HOLDS
    assert within("x", "x", figure(1.0, 0.8), -0.1, 0.4).state == FAILS


def test_the_uncertainty_takes_the_sides_that_face_each_other():
    asymmetric = Compared(Interval(10.0, 9.0, 14.0, 1), Interval(12.0, 9.0, 12.5, 3))
    assert asymmetric.uncertainty == pytest.approx((5.0, math.hypot(0.5, 1.0)))
    assert asymmetric.tested == pytest.approx((2.0 - 5.0 * OF_90, 2.0 + math.hypot(0.5, 1.0) * OF_90))


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


@pytest.mark.parametrize(
    ("low", "high", "state"),
    [(0.0, 2.0, HOLDS), (1.0, 2.1, CANNOT_TELL), (2.1, 3.0, FAILS), (1.0, math.nan, CANNOT_TELL)],
)
def test_an_error_is_at_most_its_bound(low, high, state):
    assert at_most("subset_mean", "x", Interval(1.5, low, high, 1), 2.0).state == state


@pytest.mark.parametrize(
    ("low", "high", "twin", "twin_width", "state"),
    [
        (-0.5, 1.0, -3.0, 0.0, None),  # reality is not clear
        (0.5, 1.0, 0.1, 0.0, HOLDS),
        (0.5, 1.0, 0.1, 0.2, CANNOT_TELL),
        (0.5, 1.0, -0.1, 0.0, FAILS),
        (0.5, 1.0, -0.1, 0.2, CANNOT_TELL),
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

    def test_noisy_twins_widen_the_interval(self):
        real = np.arange(6.0)
        resamples = np.tile(real, (400, 1))
        exact = rank_correlation(real, np.tile(real, (5, 1)), resamples=resamples)
        noisy = rank_correlation(
            real, real + np.random.default_rng(0).normal(scale=3.0, size=(5, 6)), resamples=resamples
        )
        assert (exact.low, exact.high) == pytest.approx((1.0, 1.0))
        assert noisy.low < noisy.mean - 0.05

    @pytest.mark.parametrize(
        ("low", "high", "state"),
        [(0.8 - 1e-16, 0.8, HOLDS), (0.7, 0.9, CANNOT_TELL), (0.7, 0.75, FAILS), (0.7, math.nan, CANNOT_TELL)],
    )
    def test_bounds(self, low, high, state):
        assert at_least("draw_rank", "x", Interval((low + high) / 2, low, high, 1), 0.8).state == state


def test_a_figure_has_the_mean_of_its_twins_and_the_interval_of_its_resamples():
    made = compared(1.0, np.linspace(0.0, 2.0, 1001), [2.0, 4.0, 6.0])
    assert (made.real.low, made.real.high) == pytest.approx((0.05, 1.95))
    assert (made.twin.mean, made.difference) == (4.0, 3.0)
    assert made.twin.low < 4.0 < made.twin.high
    assert made.summary()["real_interval"] == pytest.approx([0.05, 1.95])
