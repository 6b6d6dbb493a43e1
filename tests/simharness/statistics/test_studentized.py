"""Student's t corrected for skewness."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import binomtest, ttest_1samp

from simharness.statistics.studentized import mean_ends, p_greater

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
def test_the_lower_end_is_where_the_test_rejects(sample):
    """Where the correction widens the interval, the p-value of a mean at the lower end is 0.025."""
    assume(np.ptp(sample) > 0)
    low, _ = mean_ends(sample)
    student = ttest_1samp(sample, 0).confidence_interval(0.95)[0]
    if low < student - 1e-6:
        assert p_greater(sample - low) == pytest.approx(0.025, rel=1e-3)
    else:
        assert p_greater(sample - low) <= 0.0251


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
