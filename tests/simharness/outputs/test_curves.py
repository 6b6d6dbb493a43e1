"""Curves and breaking points of a synthetic study with known scores."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from made_study import make_study

from simharness.outputs.study.curves import grid, panels
from simharness.study.factors import factor_breaking_points, factors, factors_by_case

VARIANTS = ("full", "fast")
SEEDS_ADD = np.mean([0.0, 0.5, 1.0, 0.0])  # mean offset of PCP over four seeds


def test_a_line_is_the_mean_over_seeds(tmp_path):
    (factor,) = factors(make_study(tmp_path, factors={"cameras.count": [5, 2, 3]}))
    assert factor.values == (2, 3, 5)
    for variant, less in (("full", 0.0), ("fast", 4.0)):
        line = factor.line(variant, "pcp")
        np.testing.assert_allclose([each.mean for each in line], 60 + 5 * np.array([2, 3, 5]) + SEEDS_ADD - less)
        assert all(each.low < each.mean < each.high and each.n == 4 for each in line)


def test_a_grid_is_averaged_over_the_other_factor(tmp_path):
    first, second = factors(make_study(tmp_path, factors={"cameras.count": [2, 4], "people.count": [1, 2, 6]}))
    np.testing.assert_allclose(
        [each.mean for each in first.line("full", "pcp")], 60 + 5 * (np.array([2, 4]) + 3) + SEEDS_ADD
    )
    np.testing.assert_allclose(
        [each.mean for each in second.line("full", "pcp")], 60 + 5 * (np.array([1, 2, 6]) + 3) + SEEDS_ADD
    )
    assert first.line("full", "pcp")[0].n == 4  # seeds, not trials
    expected = 60 + 5 * (np.array([[2], [4]]) + np.array([1, 2, 6])) + SEEDS_ADD
    np.testing.assert_allclose(grid(first, second, "full", "pcp"), expected)


def test_one_at_a_time_leaves_the_other_factor_at_its_base(tmp_path):
    results = make_study(tmp_path, factors={"cameras.count": [2, 4], "people.count": [1, 2, 6]}, one_at_a_time=True)
    first, second = factors(results)
    np.testing.assert_allclose(
        [each.mean for each in first.line("full", "pcp")], 60 + 5 * (np.array([2, 4]) + 1) + SEEDS_ADD
    )
    np.testing.assert_allclose(
        [each.mean for each in second.line("full", "pcp")], 60 + 5 * (np.array([1, 2, 6]) + 2) + SEEDS_ADD
    )
    assert grid(first, second, "full", "pcp") is None


def test_a_mean_says_what_it_is_over(tmp_path):
    keys = {"cameras.count": [2, 4], "people.count": [1, 2, 6], "detector.profile": ["poor", "good"]}
    first, second, third = factors(make_study(tmp_path, factors=keys))
    assert first.over == {"people.count": (1, 2, 6), "detector.profile": ("poor", "good")}
    assert second.over == {"cameras.count": (2, 4), "detector.profile": ("poor", "good")}
    assert third.over == {"cameras.count": (2, 4), "people.count": (1, 2, 6)}
    assert all(each.over == {} for each in factors(make_study(tmp_path, factors=keys, one_at_a_time=True)))
    assert factors(make_study(tmp_path, factors={"cameras.count": [2, 4]}))[0].over == {}


def test_a_case_has_its_own_curves(tmp_path):
    results = make_study(tmp_path, factors={"cameras.count": [2, 3, 5], "people.count": [1, 4]}, cases=("a", "b"))
    more = pl.when(pl.col("case") == "b").then(10.0).otherwise(0.0)
    results = replace(results, trials=results.trials.with_columns(pcp=pl.col("pcp") + more))
    by_case = factors_by_case(results)
    assert {key: list(each) for key, each in panels(by_case).items()} == {
        "cameras.count": ["a", "b"],
        "people.count": ["a", "b"],
    }
    for case, add in (("a", 0.0), ("b", 10.0)):
        count, _ = by_case[case]
        assert "case" not in count.over
        expected = 60 + 5 * (np.array([2, 3, 5]) + 2.5) + SEEDS_ADD + add
        np.testing.assert_allclose([each.mean for each in count.line("full", "pcp")], expected)
    pooled, _ = factors(results)
    assert pooled.over["case"] == ("a", "b")
    assert pooled.line("full", "pcp")[0].mean == pytest.approx(60 + 5 * 4.5 + SEEDS_ADD + 5.0)


def test_keys_that_change_together_are_one_factor(tmp_path):
    results = make_study(tmp_path)
    trials = results.trials.with_columns((pl.col("cameras.count") * 0.5).alias("cameras.radius"))
    paired = replace(results, info={**results.info, "factors": ["cameras.count", "cameras.radius"]}, trials=trials)
    (factor,) = factors(paired)
    assert (factor.key, factor.along) == ("cameras.count", ("cameras.radius",))


def test_a_score_that_does_not_apply_is_left_out(tmp_path):
    results = make_study(tmp_path)
    lost = (pl.col("seed") == 2) & (pl.col("cameras.count") == 3)
    trials = results.trials.with_columns(pcp=pl.when(lost).then(None).otherwise(pl.col("pcp")))
    (factor,) = factors(replace(results, trials=trials))
    line = factor.line("full", "pcp")
    assert [each.n for each in line] == [4, 3, 4]
    assert line[1].mean == pytest.approx(60 + 15 + np.mean([0.0, 0.5, 0.0]))


def test_words_keep_the_order_of_the_study(tmp_path):
    (factor,) = factors(make_study(tmp_path, factors={"detector.profile": ["poor", "typical", "good"]}))
    assert (factor.values, factor.numeric) == (("poor", "typical", "good"), False)


def test_what_does_not_vary_is_no_factor(tmp_path):
    assert factors(make_study(tmp_path, factors={"cameras.count": [4]})) == []


def test_a_score_that_falls_as_the_factor_shrinks_breaks_below(tmp_path):
    (factor,) = factors(make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}))
    full, fast = factor_breaking_points(factor, VARIANTS, "pcp", 80.0)
    assert not full.rising
    assert full.point.value == pytest.approx((80 - 60 - SEEDS_ADD) / 5)
    assert fast.point.value == pytest.approx((84 - 60 - SEEDS_ADD) / 5)
    assert full.point.low < full.point.value < full.point.high
    assert full.swept == (2.0, 5.0)


def test_a_score_that_falls_as_the_factor_grows_breaks_above(tmp_path):
    (factor,) = factors(make_study(tmp_path, factors={"clutter.boxes": [0, 2, 6]}, slope=-5.0))
    full, _ = factor_breaking_points(factor, VARIANTS, "pcp", 40.0)
    assert full.rising
    assert full.point.value == pytest.approx((60 + SEEDS_ADD - 40) / 5)


def test_the_same_curve_mirrored_breaks_at_the_mirrored_value(tmp_path):
    """Breaking above and below are one computation: values change their sign, and the ends are exchanged."""
    (down,) = factors(make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}))
    (up,) = factors(make_study(tmp_path, factors={"cameras.count": [-5, -3, -2]}, slope=-5.0))
    (one,), (other,) = (factor_breaking_points(factor, ["full"], "pcp", 80.0) for factor in (down, up))
    assert (one.rising, other.rising) == (False, True)
    assert one.point.value == pytest.approx(-other.point.value)
    assert (one.point.low, one.point.high) == pytest.approx((-other.point.high, -other.point.low), abs=0.02)


@pytest.mark.parametrize(("threshold", "why"), [(50.0, "never"), (99.0, "at once")])
def test_without_a_breaking_point_in_the_range_the_reason_is_given(tmp_path, threshold, why):
    (factor,) = factors(make_study(tmp_path))
    (full,) = factor_breaking_points(factor, ["full"], "pcp", threshold)
    assert (full.point.value, full.point.why) == (None, why)
