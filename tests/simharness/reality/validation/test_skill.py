"""Skill of forecasts, correlations and rank violations, of figures that are known exactly."""

import itertools
import json

import numpy as np
import pytest

from simharness.reality.validation.evidence import compared, twin_means
from simharness.reality.validation.skill import Forecasts, rank_violation, read_other_figures


def forecasts(real, twin, rivals=None, *, noise=0.0, twins=6, seed=0):
    """Forecasts of given figures; noise of resamples and twins about them."""
    rng = np.random.default_rng(seed)
    figures = [
        compared(r, rng.normal(r, noise, size=300), rng.normal(t, noise, size=twins).tolist())
        for r, t in zip(real, twin, strict=True)
    ]
    return Forecasts(tuple(figures), {key: np.atleast_2d(each) for key, each in (rivals or {}).items()})


def test_a_perfect_forecast_has_skill_one_and_a_copy_of_the_rival_none():
    real = [10.0, 20.0, 5.0]
    assert forecasts(real, real, {"nothing": np.zeros(3)}).skill("nothing").mean == 1.0
    assert forecasts(real, np.zeros(3), {"nothing": np.zeros(3)}).skill("nothing").mean == 0.0


def test_skill_is_one_minus_the_ratio_of_the_errors():
    made = forecasts([10.0, 20.0], [12.0, 17.0], {"rival": [15.0, 25.0]})
    assert made.error.mean == pytest.approx(2.5)
    assert made.error_of("rival").mean == pytest.approx(5.0)
    assert made.skill("rival").mean == pytest.approx(0.5)


def test_a_better_rival_makes_skill_negative():
    made = forecasts([10.0, 20.0, 30.0], [12.0, 22.0, 32.0], {"rival": [11.0, 21.0, 31.0]}, noise=0.05)
    assert made.skill("rival").high < 0


def test_a_rival_is_judged_where_it_predicts_something():
    made = forecasts([10.0, 20.0], [12.0, 99.0], {"rival": [14.0, np.nan]})
    assert made.skill("rival").mean == pytest.approx(0.5)
    assert made.error.mean == pytest.approx(40.5)
    assert np.isnan(forecasts([1.0], [1.0], {"rival": [np.nan]}).skill("rival").mean)


@pytest.mark.slow
def test_the_interval_of_the_error_covers_it():
    """The mean absolute error without noise is 2; draws of recording and twins scatter about their own figures."""
    inside = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        truth = rng.uniform(50, 90, size=20)
        made = forecasts(truth + rng.normal(scale=0.7, size=20), truth + 2.0, noise=0.7, seed=seed + 1000)
        inside.append(made.error.low <= 2.0 <= made.error.high)
    assert np.mean(inside) >= 0.9


def test_noise_alone_is_no_proof_of_an_error():
    """Figures without any difference but noise of 5 points: the interval of the error reaches 0."""
    rng = np.random.default_rng(0)
    truth = rng.uniform(50, 90, size=20)
    made = forecasts(truth + rng.normal(scale=5.0, size=20), truth, noise=5.0, twins=40)
    assert made.error.mean > 2.5
    assert made.error.low < 0.5


def test_joined_forecasts_have_all_conditions_and_rivals():
    one, other = (
        forecasts([1.0, 2.0], [1.0, 3.0], {"a": [0.0, 0.0], "b": [0.0, 0.0]}), forecasts([5.0], [5.0], {"a": [4.0]})
    )  # fmt: skip
    both = Forecasts.joined([one, other])
    assert both.error.mean == pytest.approx(1 / 3)
    assert both.error_of("a").mean == pytest.approx((1 + 2 + 1) / 3)
    assert both.error_of("b").mean == pytest.approx((1 + 2) / 2)


def test_rank_violation_is_that_of_all_pairs():
    rng = np.random.default_rng(0)
    real, twin = rng.normal(size=9), rng.normal(size=9)
    worst = np.zeros(9)
    for i, j in itertools.permutations(range(9), 2):
        if (real[i] > real[j]) != (twin[i] > twin[j]):
            worst[i] = max(worst[i], abs(real[i] - real[j]))
    assert rank_violation(real, twin) == pytest.approx(worst.mean())
    assert rank_violation(real, np.exp(real)) == 0.0
    assert rank_violation(np.array([1.0, 4.0]), np.array([2.0, 1.0])) == pytest.approx(3.0)


def test_means_of_resampled_twins_are_spread_as_a_mean():
    twins = np.random.default_rng(0).normal(size=(5, 200))
    drawn = twin_means(twins, resamples=4000)
    expected = twins.std(axis=0, ddof=1) / np.sqrt(5)
    np.testing.assert_allclose(drawn.mean(axis=0), twins.mean(axis=0), atol=0.05)
    np.testing.assert_allclose(drawn.std(axis=0), expected, rtol=0.05)


def test_figures_of_another_recording_are_read_by_condition(tmp_path):
    path = tmp_path / "validation.json"
    path.write_text(json.dumps({
        "dose": {"noise": {"12": {"full": {"real": 3.5}, "fast": {"real": None}}}},
        "subsets": {"2": {"full": {"real": 80.0}}},
    }))  # fmt: skip
    assert read_other_figures(path) == {"noise.12.full": 3.5, "2.full": 80.0}
    path.write_text("{}")
    with pytest.raises(ValueError, match=r"validation.json: expected the validation.json of another recording"):
        read_other_figures(path)
