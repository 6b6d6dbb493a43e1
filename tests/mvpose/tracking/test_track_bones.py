"""Bone lengths of one person: learned from joints, and applied to them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from mvpose.tracking.bones import constrain, learn_lengths

DEFINITION2 = 0.02**2  # m²: variance of the definition of a bone's length in one pose
PAIR = np.array([[0, 1]])


def _joints(rng, count, *, spread=0.03):
    """Random states (J, 6) with joints a metre or so apart, and their covariances (J, 6, 6)."""
    root = rng.standard_normal((count, 6, 6))
    covariance = spread**2 * (root @ root.swapaxes(1, 2) / 6.0 + 0.3 * np.eye(6))
    return rng.uniform(-1.0, 1.0, (count, 6)), covariance


def _constrained(state, covariance, ends, length, variance):
    """Joints and covariances of a person, written into arrays that hold other numbers before."""
    joints, spread = np.full((len(state), 3), 7.0), np.full((len(state), 3, 3), 7.0)
    constrain(joints, spread, state, covariance, np.array(ends).reshape(-1, 2), np.array(length), np.array(variance))
    return joints, spread


@given(st.integers(0, 1000))
def test_without_bones_joints_stay_as_they_are_and_unknown_ones_are_unknown(seed):
    state, covariance = _joints(np.random.default_rng(seed), 3)
    state[1] = np.nan
    joints, spread = _constrained(state, covariance, np.zeros((0, 2), np.int64), [], [])
    np.testing.assert_allclose(joints, state[:, :3], atol=1e-12)
    np.testing.assert_allclose(spread[[0, 2]], covariance[[0, 2], :3, :3], rtol=1e-9, atol=1e-15)
    assert np.isnan(spread[1]).all()


def test_a_bone_to_an_unknown_joint_moves_nothing():
    state, covariance = _joints(np.random.default_rng(0), 2)
    state[0] = np.nan
    joints, spread = _constrained(state, covariance, PAIR, [0.3], [1e-4])
    np.testing.assert_allclose(joints[1], state[1, :3], atol=1e-12)
    np.testing.assert_allclose(spread[1], covariance[1, :3, :3], rtol=1e-9)
    assert np.isnan(joints[0]).all()


def test_joints_without_any_uncertainty_are_reported_as_they_are():
    state, covariance = _joints(np.random.default_rng(1), 3)
    covariance[1] = 0.0
    joints, spread = _constrained(state, covariance, [[0, 2]], [0.3], [1e-4])
    np.testing.assert_array_equal(joints, state[:, :3])
    np.testing.assert_array_equal(spread, covariance[:, :3, :3])


@given(st.integers(0, 1000), st.floats(0.2, 0.6))
def test_a_joint_at_the_end_of_a_bone_is_where_the_posterior_is_highest(seed, length):
    """One end is known exactly; the other has a Gaussian, and the bone a Gaussian length."""
    rng = np.random.default_rng(seed)
    state, covariance = _joints(rng, 2, spread=0.05)
    way = rng.standard_normal(3)
    state[1, :3] = state[0, :3] + (length + 0.1) * way / np.linalg.norm(way)
    covariance[0] = 1e-12 * np.eye(6)
    variance = 0.02**2
    joints, spread = _constrained(state, covariance, PAIR, [length], [variance])
    precision = np.linalg.inv(covariance[1, :3, :3])

    def minus_log(x):
        off, reach = x - state[1, :3], np.linalg.norm(x - state[0, :3])
        return 0.5 * off @ precision @ off + 0.5 * (reach - length) ** 2 / (variance + DEFINITION2)

    best = minimize(minus_log, state[1, :3], method="BFGS", options={"gtol": 1e-8}).x
    assert np.linalg.norm(joints[1] - best) < 2e-3  # sweeps end where joints move by less than a millimetre
    way = (joints[1] - state[0, :3]) / np.linalg.norm(joints[1] - state[0, :3])
    expected = np.linalg.inv(precision + np.outer(way, way) / (variance + DEFINITION2))
    np.testing.assert_allclose(spread[1], expected, rtol=0.05, atol=1e-6)


@pytest.mark.parametrize("free", [0, 1])
def test_the_end_that_is_less_certain_moves(free):
    state, covariance = np.zeros((2, 6)), np.tile(1e-8 * np.eye(6), (2, 1, 1))
    state[1, 0] = 0.5
    covariance[free] = 0.2**2 * np.eye(6)
    joints, _ = _constrained(state, covariance, PAIR, [0.4], [1e-6])
    moved = (0.5 - 0.4) * 0.2**2 / (0.2**2 + DEFINITION2 + 1e-6 + 1e-8)
    np.testing.assert_allclose(joints[1 - free], state[1 - free, :3], atol=1e-6)
    np.testing.assert_allclose(joints[free, 0], 0.5 - moved if free else moved, atol=1e-5)


def test_a_length_is_learned_as_by_the_kalman_filter():
    state, covariance = np.zeros((2, 6)), np.zeros((2, 6, 6))
    state[1, 2] = 0.5
    covariance[0, 2, 2], covariance[1, 2, 2], covariance[1, 0, 0] = 0.03**2, 0.01**2, 9.0  # only along the bone
    for dt, noise in ((1.0, DEFINITION2 + 0.001), (0.25, 4 * (DEFINITION2 + 0.001)), (5.0, DEFINITION2 + 0.001)):
        length, variance = np.array([0.4]), np.array([0.03**2])
        learn_lengths(length, variance, state, covariance, PAIR, dt)
        gain = 0.03**2 / (0.03**2 + noise)
        assert length[0] == pytest.approx(0.4 + gain * 0.1)
        assert variance[0] == pytest.approx((1.0 - gain) * 0.03**2)


def test_nothing_is_learned_from_unknown_joints_or_in_no_time_and_no_bone_is_known_better_than_joints_are_points():
    state, covariance = np.zeros((2, 6)), np.tile(1e-6 * np.eye(6), (2, 1, 1))
    state[1, 2] = 0.5
    for joint, dt in ((np.nan, 1.0), (0.5, 0.0)):
        length, variance = np.array([0.4]), np.array([0.03**2])
        learn_lengths(length, variance, np.where(np.arange(2)[:, None] == 1, joint, state), covariance, PAIR, dt)
        assert (length[0], variance[0]) == (0.4, 0.03**2)
    for _ in range(1000):
        learn_lengths(length, variance, state, covariance, PAIR, 1.0)
    assert length[0] == pytest.approx(0.5, abs=1e-3)
    assert variance[0] == pytest.approx(0.01**2)
