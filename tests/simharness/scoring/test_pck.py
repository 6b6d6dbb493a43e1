import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scoring.pck import joint_errors, pck, pck_area

errors = st.lists(st.one_of(st.floats(0, 0.3), st.just(np.inf), st.just(np.nan)), max_size=12)


def test_the_curve_counts_what_is_within_the_limit():
    curve = pck([[0.01, 0.05], [0.2, np.inf]], [0.0, 0.01, 0.05, 0.19, 9.0])
    assert curve.tolist() == [0.0, 25.0, 50.0, 50.0, 75.0]


def test_what_was_missed_is_wrong_and_what_is_not_known_does_not_count():
    truth, estimate = np.zeros((2, 3)), np.zeros((2, 3))
    truth[0, 2], estimate[1] = np.nan, np.nan
    np.testing.assert_array_equal(joint_errors(truth, estimate), [np.nan, np.inf])
    assert pck(joint_errors(truth, estimate), [0.1]).tolist() == [0.0]
    assert np.isnan(pck(np.full(3, np.nan), [0.1, 0.2])).all()
    assert np.isnan(pck_area([], 0.1))


def test_the_area_of_one_error_is_what_is_left_of_the_width():
    assert pck_area([0.0], 0.15) == 100.0
    assert pck_area([0.05], 0.15) == pytest.approx(100 * 2 / 3)
    assert pck_area([0.15, np.inf], 0.15) == 0.0


@given(errors)
def test_the_curve_rises_and_the_area_is_its_mean(values):
    limits = (np.arange(3000) + 0.5) * 0.15 / 3000
    curve, area = pck(values, limits), pck_area(values, 0.15)
    if np.isnan(values).all():
        assert np.isnan(curve).all()
        assert np.isnan(area)
        return
    assert (np.diff(curve) >= 0).all()
    assert area == pytest.approx(curve.mean(), abs=0.05)
