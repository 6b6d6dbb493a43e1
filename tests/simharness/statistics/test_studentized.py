"""Student's t corrected for skewness."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import beta, binomtest, ttest_1samp

from simharness.statistics.studentized import mean_ends, p_greater, unseen_share

SAMPLES = st.lists(st.integers(-50, 50).map(float), min_size=3, max_size=20).map(np.array)


def test_symmetrical_samples_have_students_t():
    sample = np.array([-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0])  # symmetrical about 1
    assert p_greater(sample) == pytest.approx(ttest_1samp(sample, 0, alternative="greater").pvalue)
    assert mean_ends(sample) == pytest.approx(tuple(ttest_1samp(sample, 0).confidence_interval(0.95)))


@given(sample=SAMPLES, shift=st.floats(-100, 100), factor=st.floats(0.1, 10))
def test_intervals_move_with_their_scores(sample, shift, factor):
    low, high = mean_ends(sample)
    assert mean_ends(factor * sample + shift) == pytest.approx((factor * low + shift, factor * high + shift), abs=1e-6)
    assert mean_ends(-sample) == pytest.approx((-high, -low))
    student = ttest_1samp(sample, 0).confidence_interval(0.95) if np.ptp(sample) else (sample[0], sample[0])
    assert low <= student[0] + 1e-9
    assert high >= student[1] - 1e-9


@given(sample=SAMPLES, shift=st.floats(0.0, 100))
def test_greater_scores_have_smaller_p(sample, shift):
    assume(np.ptp(sample) > 0 and np.any(sample + shift) and np.any(sample))
    assert p_greater(sample + shift) <= p_greater(sample) + 1e-12
    assert p_greater(3 * sample) == pytest.approx(p_greater(sample))


@given(sample=SAMPLES)
def test_the_correction_ends_where_the_test_rejects_or_near_the_worst_scene(sample):
    assume(np.ptp(sample) > 0)
    low, _ = mean_ends(sample)
    student = ttest_1samp(sample, 0).confidence_interval(0.95)[0]
    assert low <= student + 1e-9
    if low < student - 1e-6:
        assert p_greater(sample - low) >= 0.025 * (1 - 1e-3)
        assert low > sample.min() - 2 / np.sqrt(len(sample)) * (sample.mean() - sample.min())


def test_one_far_scene_of_ten_gives_an_interval_that_reaches_no_farther_than_its_frequency_allows():
    """One value of 80, nine from 97 to 99.3: at most 45 % of scenes are like the one (Clopper-Pearson), mean 90."""
    scores = np.array([80.0, 97.0, 97.5, 98.0, 98.2, 98.5, 98.7, 98.9, 99.1, 99.3])
    low, high = mean_ends(scores)
    share = beta.ppf(0.975, 2, 9)
    assert scores.min() < low < (1 - share) * 98.4 + share * 80.0
    assert 99.3 < high < 101
    mirrored = mean_ends(100 - scores)
    assert (100 - mirrored[1], 100 - mirrored[0]) == pytest.approx((low, high))


@pytest.mark.parametrize("scenes", [10, 20, 40])
def test_intervals_of_rare_collapses_hold_the_mean_where_one_was_seen(scenes):
    """One scene of ten falls from 97..100 to 40..80; a lower end beyond the worst scene would say nothing."""
    rng = np.random.default_rng(scenes)
    fallen = rng.random((2000, scenes)) < 0.1
    scores = np.where(fallen, rng.uniform(40, 80, fallen.shape), rng.uniform(97, 100, fallen.shape))[fallen.any(axis=1)]
    low, high = mean_ends(scores)
    assert binomtest(int(((low <= 92.65) & (high >= 92.65)).sum()), len(scores), 0.94, alternative="less").pvalue > 0.01
    student = ttest_1samp(scores, 0, axis=1).confidence_interval(0.95)
    assert np.quantile((high - low) / (student.high - student.low), 0.95) < 1.9
    assert unseen_share(scenes) == pytest.approx(1 - 0.05 ** (1 / scenes))


def test_constant_scores():
    assert mean_ends(np.full(5, 0.1)) == pytest.approx((0.1, 0.1))
    assert (p_greater(np.full(5, 0.1)), p_greater(np.full(5, -0.1)), p_greater(np.zeros(5))) == (0.0, 1.0, 1.0)
    assert (p_greater(np.array([3.0])), p_greater(np.array([]))) == (1.0, 1.0)
    assert np.isnan(mean_ends([3.0])).all()


def test_many_intervals_at_once_are_those_of_each():
    values = np.random.default_rng(0).exponential(size=(4, 3, 9))
    low, high = mean_ends(values)
    for index in np.ndindex(4, 3):
        assert mean_ends(values[index]) == pytest.approx((low[index], high[index]))


@pytest.mark.parametrize("scenes", [8, 12, 20, 60])
def test_the_tail_that_student_misses_has_its_level(scenes):
    """Left-skewed changes with mean zero: Student's t is above its level at 0.05 in 9 (n = 60) to 14 % (n = 8)."""
    changes = 1 - np.random.default_rng(scenes).exponential(size=(1000, scenes))
    rejected = sum(p_greater(each) <= 0.05 for each in changes)
    assert binomtest(rejected, 1000, 0.075, alternative="greater").pvalue > 0.005


@pytest.mark.parametrize(("scenes", "level"), [(20, 0.08), (40, 0.055)])
def test_log_normal_changes_are_seldom_significant_on_the_side_of_their_tail(scenes, level):
    """The corrected t alone rejects 10 and 9 % at 0.05."""
    changes = np.exp(0.5) - np.random.default_rng(scenes).lognormal(0, 1, (2000, scenes))
    rejected = sum(p_greater(each) <= 0.05 for each in changes)
    assert binomtest(rejected, 2000, level, alternative="greater").pvalue > 0.005
    normal = 1 + np.random.default_rng(scenes).normal(size=(300, 12))
    assert np.mean([p_greater(each) <= 0.05 for each in normal]) > 0.85  # the power for symmetrical changes stays
