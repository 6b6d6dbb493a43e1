"""Means over scenes with intervals."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest, gamma, t

from simharness.statistics.intervals import SCALES, Interval, mean_interval


def test_the_mean_is_over_the_scenes_to_which_the_score_applies():
    result = mean_interval([80.0, None, 90.0, float("nan"), 100.0], unit="%")
    assert (result.mean, result.n) == (90.0, 3)
    assert 0.0 <= result.low < 90.0 < result.high <= 100.0


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
def test_intervals_of_normal_scores_have_their_nominal_coverage(scenes):
    rng = np.random.default_rng(scenes)
    results = [mean_interval(rng.normal(5.0, 2.0, scenes)) for _ in range(600)]
    covered = np.mean([each.low <= 5.0 <= each.high for each in results])
    assert 0.95 - 0.03 < covered < 0.99  # 600 intervals: two standard errors are 0.018
    # Little wider than Student's t interval.
    width = np.median([each.high - each.low for each in results])
    c4 = math.sqrt(2 / (scenes - 1)) * math.gamma(scenes / 2) / math.gamma((scenes - 1) / 2)
    student = 2 * t.isf(0.025, scenes - 1) * c4 * 2.0 / math.sqrt(scenes)
    assert 0.95 * student < width < (1 + 3 / scenes) * student


def clusters(rng, shape, rate, frames):
    """Return ghosts per frame of scenes of 50 frames, whose ghosts stay for a geometric number of frames."""
    count = rng.poisson(rate, shape)
    return np.where(count > 0, count + rng.negative_binomial(np.maximum(count, 1), 1 / frames), 0) / 50


SCORES = {
    "ghosts, rare": ("per frame", lambda rng, shape: clusters(rng, shape, 0.08, 10), 0.016),
    "ghosts, rare, single": ("per frame", lambda rng, shape: rng.poisson(0.1, shape) / 50, 0.002),
    "ghosts, few scenes": ("per frame", lambda rng, shape: clusters(rng, shape, 0.3, 5), 0.03),
    "ghosts, half of the scenes": ("per frame", lambda rng, shape: clusters(rng, shape, 1.0, 5), 0.1),
    "ghosts, overdispersed": ("per frame", lambda rng, shape: rng.poisson(rng.gamma(0.3, 5 / 3, shape)) / 50, 0.01),
    "switches of six people in 15 s": ("/min", lambda rng, shape: rng.poisson(0.3, shape) / 1.5, 0.2),
    "a poster": ("per frame", lambda rng, shape: (rng.random(shape) < 0.1).astype(float), 0.1),
    "recall, mostly 100": (
        "%",
        lambda rng, shape: 100 - np.where(rng.random(shape) < 0.1, 100 * rng.beta(1, 19, shape), 0.0),
        99.5,
    ),
    "recall, often 100": (
        "%",
        lambda rng, shape: 100 - np.where(rng.random(shape) < 0.3, 100 * rng.beta(1, 19, shape), 0.0),
        98.5,
    ),
    "PCP, close to 100": ("%", lambda rng, shape: 100 - 100 * rng.beta(1, 49, shape), 98.0),
    "PCP, in the middle": ("%", lambda rng, shape: 100 * rng.beta(3, 2, shape), 60.0),
    "errors": ("mm", lambda rng, shape: rng.lognormal(0, 0.5, shape), math.exp(0.125)),
}


@pytest.mark.parametrize("score", sorted(SCORES))
@pytest.mark.parametrize("scenes", [5, 12, 20, 40])
def test_intervals_of_scores_cover_their_means(score, scenes):
    """Expanded percentiles of a bootstrap cover 35 to 55 % of the means of rare ghosts of 5 to 12 scenes."""
    unit, draw, mean = SCORES[score]
    values = draw(np.random.default_rng(scenes), (300, scenes))
    results = [mean_interval(each, unit=unit) for each in values]
    covered = sum(each.low <= mean <= each.high for each in results)
    assert binomtest(covered, 300, 0.94, alternative="less").pvalue > 0.005
    assert all(SCALES[unit].low <= each.low <= each.mean <= each.high <= SCALES[unit].high for each in results)


def test_no_event_in_any_scene_limits_the_mean_by_poisson():
    """exp(-n mean / event) = 0.025 (Garwood)."""
    assert mean_interval(np.zeros(2000), unit="per frame").high == pytest.approx(-math.log(0.025) / 2000, rel=0.01)
    assert mean_interval(np.zeros(2000), unit="/min").high == pytest.approx(-math.log(0.025) / 2000, rel=0.01)
    assert mean_interval(np.full(2000, 100.0), unit="%").low == pytest.approx(100 + 25 * math.log(0.025) / 2000)
    few = mean_interval(np.zeros(12), unit="per frame")
    assert (few.low, few.mean) == (0.0, 0.0)
    assert few.high == pytest.approx(-math.log(0.025) / 12)


def test_single_events_of_equal_weight_have_an_exact_lower_end():
    """Three scenes of 2000 have one event each: Garwood's interval has the quantile of a gamma variable."""
    values = np.zeros(2000)
    values[:3] = 0.02
    result = mean_interval(values, unit="per frame")
    assert result.low == pytest.approx(gamma.ppf(0.025, 3) * 0.02 / 2000, rel=0.01)
    assert result.high > gamma.isf(0.025, 4) * 0.02 / 2000


@pytest.mark.parametrize(("scenes", "rate"), [(10, 0.2), (20, 0.1)])
def test_the_largest_of_a_few_events_is_not_the_largest_possible_one(scenes, rate):
    """Events of exponential weight in a few scenes: the upper end lies above the mean in 95 of 100 draws.

    With the largest weight seen as the largest possible one it does in 91; 2000 draws have a deviation of half a point.
    """
    rng = np.random.default_rng(7)
    weights = np.where(rng.random((2000, scenes)) < rate, rng.exponential(1.0, (2000, scenes)), 0.0)
    assert np.mean([mean_interval(each, unit="per frame").high >= rate for each in weights]) > 0.94


def test_a_mirrored_percentage_has_a_mirrored_interval():
    values = np.array([0.0, 0.0, 3.0, 0.0, 7.0, 0.0, 0.0, 1.0])
    one, other = mean_interval(values, unit="%"), mean_interval(100 - values, unit="%")
    assert (other.low, other.high) == pytest.approx((100 - one.high, 100 - one.low))


def test_an_interval_as_text_and_in_json():
    found = Interval(0.964, 0.9404, 0.9806, 12)
    assert found.texts(1, 100.0) == ("96.4", "94.0 to 98.1")
    assert found.to_json() == {"mean": 0.964, "low": 0.9404, "high": 0.9806, "scenes": 12}
    assert Interval(3.0, math.nan, math.nan, 1).texts(1) == ("3.0", "")
    assert Interval(math.nan, math.nan, math.nan, 0).texts(1) == ("–", "")
