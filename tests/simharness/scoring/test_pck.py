import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scoring.joint_errors import pck, pck_area

errors = st.lists(st.one_of(st.floats(0, 0.3), st.just(np.inf), st.just(np.nan)), max_size=12)


def test_the_curve_counts_errors_within_the_limit():
    curve = pck([[0.01, 0.05], [0.2, np.inf]], [0.0, 0.01, 0.05, 0.19, 9.0])
    assert curve.tolist() == [0.0, 25.0, 50.0, 50.0, 75.0]


def test_infinite_errors_are_wrong_and_nan_is_ignored():
    assert pck([np.nan, np.inf], [0.1]).tolist() == [0.0]
    assert np.isnan(pck(np.full(3, np.nan), [0.1, 0.2])).all()
    assert np.isnan(pck_area([], 0.1))


def test_the_area_of_one_error_is_the_rest_of_the_width():
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
