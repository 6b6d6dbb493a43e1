import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.statistics.comparison import DRAWS, breaking_point, holm, mean_interval, paired

# --- means


def test_the_mean_is_over_the_scenes_to_which_the_score_applies():
    result = mean_interval([80.0, None, 90.0, float("nan"), 100.0])
    assert (result.mean, result.n) == (90.0, 3)
    assert 80.0 <= result.low < 90.0 < result.high <= 100.0


def test_of_no_scene_and_of_one_nothing_is_claimed():
    assert mean_interval([]).n == 0
    assert math.isnan(mean_interval([None]).mean)
    alone = mean_interval([3.0])
    assert (alone.mean, alone.n) == (3.0, 1)
    assert math.isnan(alone.low)
    assert math.isnan(alone.high)


def test_scores_that_do_not_vary_have_no_width():
    result = mean_interval(np.full(12, 97.5))
    assert (result.low, result.mean, result.high) == (97.5, 97.5, 97.5)


@pytest.mark.parametrize("scenes", [6, 12, 30])
def test_intervals_hold_the_mean_about_as_often_as_they_say(scenes):
    rng = np.random.default_rng(scenes)
    results = [mean_interval(rng.normal(5.0, 2.0, scenes), seed=trial, resamples=500) for trial in range(600)]
    held = np.mean([each.low <= 5.0 <= each.high for each in results])
    assert 0.95 - 0.035 < held < 0.95 + 0.03  # 600 intervals: two standard errors are 0.018
    # Student's t would be as wide.
    from scipy.stats import t

    width = np.mean([each.high - each.low for each in results])
    c4 = math.sqrt(2 / (scenes - 1)) * math.gamma(scenes / 2) / math.gamma((scenes - 1) / 2)
    expected = 2 * t.isf(0.025, scenes - 1) * c4 * 2.0 / math.sqrt(scenes)
    assert width == pytest.approx(expected, rel=0.1)


# --- pairs


def by_enumeration(change, alternative):
    sums = [
        sum(s * c for s, c in zip(signs, change, strict=True))
        for signs in itertools.product((1, -1), repeat=len(change))
    ]
    seen, tiny = sum(change), 1e-9
    extreme = {
        "greater": [each >= seen - tiny for each in sums],
        "less": [each <= seen + tiny for each in sums],
        "two-sided": [abs(each) >= abs(seen) - tiny for each in sums],
    }
    return sum(extreme[alternative]) / len(sums)


@pytest.mark.parametrize("alternative", ["greater", "less", "two-sided"])
@given(change=st.lists(st.integers(-5, 5).map(float), min_size=1, max_size=8))
def test_p_is_the_share_of_all_signs_that_are_as_extreme(change, alternative):
    before = np.linspace(50, 90, len(change))
    result = paired(before, before + change, alternative=alternative)
    assert result.p == pytest.approx(by_enumeration(change, alternative), abs=1e-12)
    assert result.difference == pytest.approx(np.mean(change))


def test_twelve_pairs_that_all_fall_are_one_in_4096():
    before = np.arange(12.0)
    fallen = paired(before, before - np.linspace(1, 2, 12), alternative="less")
    assert fallen.p == 1 / 4096
    assert paired(before, before - np.linspace(1, 2, 12)).p == 2 / 4096
    assert fallen.high < 0
    # Pairs that do not differ say nothing, however many.
    many = np.concatenate([before, np.zeros(200)])
    assert paired(many, many - np.concatenate([np.linspace(1, 2, 12), np.zeros(200)]), alternative="less").p == 1 / 4096


def test_drawn_signs_agree_with_all_signs():
    rng = np.random.default_rng(3)
    change = rng.normal(0.45, 1.0, 16)
    ways = 1 - 2 * ((np.arange(2**16)[:, None] >> np.arange(16)) & 1)
    exact = np.mean(ways @ change >= change.sum() - 1e-9)
    result = paired(np.zeros(16), change, alternative="greater")
    assert 0.01 < exact < 0.3
    assert abs(result.p - exact) < 4 * math.sqrt(exact * (1 - exact) / DRAWS)
    assert paired(np.zeros(16), change, alternative="greater").p == result.p  # the draws are keyed
    assert paired(np.zeros(100), np.ones(100), alternative="greater").p == 1 / (1 + DRAWS)


def test_nothing_changed_is_no_evidence():
    same = paired(np.arange(50.0), np.arange(50.0))
    assert (same.difference, same.p, same.n) == (0.0, 1.0, 50)
    none = paired([None, 1.0], [2.0, None])
    assert (none.p, none.n) == (1.0, 0)


def test_chance_is_significant_no_more_often_than_the_level():
    rng = np.random.default_rng(8)
    for pairs in (10, 20):
        p = np.array([paired(np.zeros(pairs), rng.standard_t(3, pairs)).p for _ in range(200)])
        assert (p <= 0.05).mean() < 0.05 + 2.5 * math.sqrt(0.05 * 0.95 / 200)
        assert 0.4 < p.mean() < 0.6


def test_pairs_must_be_pairs():
    with pytest.raises(ValueError, match=r"got 2 and 3"):
        paired([1, 2, 3], [1, 2])
    with pytest.raises(ValueError, match="two-sided, greater or less"):
        paired([1], [2], alternative="worse")


# --- many tests


def by_definition(p, level):
    """What Holm's procedure rejects, step by step."""
    rejected = set()
    for step, index in enumerate(sorted(range(len(p)), key=p.__getitem__)):
        if p[index] > level / (len(p) - step):
            break
        rejected.add(index)
    return rejected


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []
    assert holm([0.7, 0.8]) == [1.0, 1.0]
    with pytest.raises(ValueError, match="between 0 and 1"):
        holm([0.5, float("nan")])


@given(
    p=st.lists(st.integers(0, 997).map(lambda i: i / 997), min_size=1, max_size=12),
    level=st.sampled_from([0.0101, 0.0502, 0.2003]),
)
def test_holm_rejects_what_the_procedure_rejects(p, level):
    assert {i for i, adjusted in enumerate(holm(p)) if adjusted <= level} == by_definition(p, level)


# --- breaking points


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
    assert (point.low, point.high) == (None, None)  # one seed says nothing of the others


def test_on_the_threshold_is_good():
    assert breaking_point([1, 2], [[80, 80]] * 3, 80, better="higher").why == "never"
    assert breaking_point([1, 2], [[80, 79]] * 3, 80, better="higher").value == pytest.approx(1.0)


def test_no_breaking_point_says_which_side_it_lies_on():
    never = breaking_point([1, 2, 3], [[99, 98, 97], [99, 97, 96]], 90, better="higher")
    assert (never.value, never.low, never.high, never.why) == (None, None, None, "never")
    at_once = breaking_point([1, 2, 3], [[50, 95, 95], [51, 95, 95]], 90, better="higher")
    assert (at_once.value, at_once.low, at_once.high, at_once.why) == (None, None, None, "at once")


def test_the_interval_is_open_where_some_seeds_hold_to_the_end():
    scores = [[100, 100, 60]] * 4 + [[100, 100, 100]] * 4
    point = breaking_point([1, 2, 3], scores, 85, better="higher")
    assert point.value == pytest.approx(2.75)
    assert point.low == pytest.approx(2.375, abs=0.2)  # where the four that fall are drawn: 2 + 15/40
    assert point.high is None


def test_values_to_which_the_score_does_not_apply_are_passed_over():
    gap = [[100.0, np.nan, 60.0], [100.0, np.nan, 60.0]]
    assert breaking_point([0, 1, 2], gap, 80, better="higher").value == pytest.approx(1.0)
    one = [[100.0, np.nan, 60.0], [100.0, 70.0, 60.0]]
    assert breaking_point([0, 1, 2], one, 85, better="higher").value == pytest.approx(0.5)


def test_the_interval_of_a_breaking_point_holds_it_about_as_often_as_it_says():
    """Scores fall by 10 a step with an offset of each seed's: seeds break at 2 + N(0, 0.5)."""
    rng = np.random.default_rng(5)
    values = np.arange(7.0)
    held = []
    for trial in range(300):
        offset = rng.normal(0, 5, (12, 1))
        point = breaking_point(values, 100 - 10 * values + offset, 80, better="higher", seed=trial, resamples=400)
        held.append(point.low <= 2.0 <= point.high)
    assert 0.90 < np.mean(held) < 0.985


def test_what_is_no_curve_is_refused():
    with pytest.raises(ValueError, match="ascends"):
        breaking_point([1, 1], [[1, 2]], 0, better="higher")
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        breaking_point([1, 2, 3], [[1, 2]], 0, better="higher")
