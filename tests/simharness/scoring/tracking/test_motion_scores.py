"""Velocity and jerk: exact for polynomials at any times, closed forms for noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scoring.tracking.identity_figures import jerk, jerk_ratio, rms_jerk, velocity, velocity_error


@given(st.integers(0, 999))
def test_jerk_of_cubic_motion_is_exact_at_uneven_times(seed):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.05, 0.3, 8))
    factors = rng.normal(size=(4, 3))
    positions = sum(factors[k] * time[:, None] ** k for k in range(4))[:, None]
    np.testing.assert_allclose(jerk(positions, time), np.tile(6 * factors[3], (5, 1, 1)), atol=1e-6)
    np.testing.assert_allclose(jerk(positions - factors[3] * time[:, None, None] ** 3, time), 0, atol=1e-6)


def test_velocity_is_the_slope_between_frames():
    time = np.array([0.0, 0.1, 0.4])
    positions = np.array([[0.0, 0, 0], [0.2, 0, 0], [0.2, 0.9, 0]])
    np.testing.assert_allclose(velocity(positions, time), [[2.0, 0, 0], [0, 3.0, 0]])


def test_an_offset_has_no_velocity_error_and_a_drift_has_its_own():
    time = np.arange(9) / 25
    truth = np.random.default_rng(1).normal(size=(9, 2, 17, 3))
    assert velocity_error(truth, truth + [0.1, -0.2, 0.3], time) == pytest.approx(0.0, abs=1e-9)
    drift = truth + time[:, None, None, None] * [0.3, 0.0, 0.4]
    assert velocity_error(truth, drift, time) == pytest.approx(0.5)


def test_jerk_of_noise():
    """The third difference of noise of deviation s has the variance (1 + 9 + 9 + 1) s² along each axis."""
    rng = np.random.default_rng(2)
    time = np.arange(4000) / 25
    truth = np.zeros((4000, 5, 3))
    truth[..., 0] = time[:, None] ** 3
    found, true = rms_jerk(truth, truth + 0.01 * rng.standard_normal(truth.shape), time)
    assert true == pytest.approx(6.0, rel=1e-3)
    assert found == pytest.approx(np.hypot(6.0, 0.01 * np.sqrt(60) * 25**3), rel=0.02)


def test_jerk_ratio_of_the_same_of_no_and_of_twice_the_motion():
    time = np.arange(12) / 30
    truth = np.sin(5 * time[:, None, None] + np.arange(6.0).reshape(2, 3))
    assert jerk_ratio(truth, truth, time) == pytest.approx(1.0)
    assert jerk_ratio(truth, 2 * truth + 5, time) == pytest.approx(2.0)
    assert jerk_ratio(truth, np.zeros_like(truth), time) == 0.0
    assert jerk_ratio(np.ones_like(truth), truth, time) is None  # nobody moves


def test_only_frames_in_a_row_count():
    time = np.arange(7) / 10
    truth = np.sin(9 * time)[:, None, None] * np.ones((1, 2, 3))
    estimate = truth.copy()
    estimate[3, 0] = np.nan
    estimate[::2, 1] = np.nan
    estimate[:3, 0] += 0.1
    assert velocity_error(truth, estimate, time) == pytest.approx(0.0, abs=1e-12)  # the offset never changes
    assert rms_jerk(truth, estimate, time) is None  # never four in a row
    assert velocity_error(truth[:1], estimate[:1], time[:1]) is None
