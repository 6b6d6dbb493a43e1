"""Motion model: an Ornstein-Uhlenbeck velocity, against its closed form, its limits and a simulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose import COCO17, PANOPTIC19, SHELF14
from mvpose.tracking.motion import MotionModel, carry, condition, predict, transition

TRUNK = np.array([True])
SPANS = st.floats(1e-4, 5.0)


def _joint(rng):
    factor = rng.standard_normal((6, 6))
    return rng.standard_normal((1, 6)), (factor @ factor.T + 0.1 * np.eye(6))[None]


@given(SPANS, SPANS, st.integers(0, 1000))
def test_two_steps_are_one(first, second, seed):
    state, covariance = _joint(np.random.default_rng(seed))
    speed, time = np.array([0.7]), np.array([0.8])
    at_once, once = state.copy(), covariance.copy()
    predict(at_once, once, first + second, speed, time, TRUNK)
    predict(state, covariance, first, speed, time, TRUNK)
    predict(state, covariance, second, speed, time, TRUNK)
    np.testing.assert_allclose(state, at_once, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(covariance, once, rtol=1e-6, atol=1e-9)


@given(SPANS)
def test_velocities_stay_as_they_are_on_average(dt):
    state, covariance = np.zeros((1, 6)), np.zeros((1, 6, 6))
    covariance[0, 3:, 3:] = 0.49 * np.eye(3)
    predict(state, covariance, dt, np.array([0.7]), np.array([0.8]), TRUNK)
    np.testing.assert_allclose(covariance[0, 3:, 3:], 0.49 * np.eye(3), rtol=1e-12)


def test_a_short_step_has_white_accelerations_and_a_long_one_is_a_random_walk():
    speed, time = 0.7, 0.8
    density = 2 * speed**2 / time
    dt = 1e-3
    reach, decay, q_xx, q_xv, q_vv = transition(dt, speed, time)
    assert reach == pytest.approx(dt, rel=1e-3)
    assert decay == pytest.approx(1.0, abs=2e-3)
    assert (q_xx, q_xv, q_vv) == pytest.approx((density * dt**3 / 3, density * dt**2 / 2, density * dt), rel=5e-3)
    dt = 1000.0
    _, _, q_xx, _, q_vv = transition(dt, speed, time)
    assert q_xx == pytest.approx(2 * speed**2 * time * dt, rel=2e-3)
    assert q_vv == pytest.approx(speed**2)


def test_noise_is_that_of_a_simulated_velocity():
    speed, time, dt, steps = 1.0, 0.3, 0.5, 500
    rng, h = np.random.default_rng(0), 0.5 / 500
    x, v = np.zeros(20_000), np.zeros(20_000)
    for _ in range(steps):
        x += v * h
        v += -v / time * h + np.sqrt(2 * speed**2 / time * h) * rng.standard_normal(len(v))
    _, _, q_xx, q_xv, q_vv = transition(dt, speed, time)
    simulated = np.cov(x, v)
    assert [simulated[0, 0], simulated[0, 1], simulated[1, 1]] == pytest.approx([q_xx, q_xv, q_vv], rel=0.05)


def test_conditioning_on_a_measured_position_is_the_kalman_update():
    rng = np.random.default_rng(3)
    state, covariance = _joint(rng)
    state, covariance = state[0], covariance[0]
    measured, noise = rng.standard_normal(3), np.diag([0.2, 0.5, 1.0])
    H = np.eye(3, 6)
    gain = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + noise)
    mean = state + gain @ (measured - state[:3])
    expected = (np.eye(6) - gain @ H) @ covariance
    condition(
        state, covariance, mean[:3].copy(), np.linalg.inv(covariance[:3, :3]), expected[:3, :3].copy(), np.empty((6, 3))
    )
    np.testing.assert_allclose(state, mean, atol=1e-12)
    np.testing.assert_allclose(covariance, expected, atol=1e-12)


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19])
def test_both_sides_move_alike(skeleton):
    speed, time, trunk = MotionModel().of_joints(skeleton)
    np.testing.assert_array_equal(speed, speed[list(skeleton.mirror)])
    np.testing.assert_array_equal(time, time[list(skeleton.mirror)])
    np.testing.assert_array_equal(trunk, trunk[list(skeleton.mirror)])
    assert trunk.any()


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19])
def test_joints_are_carried_along_by_the_trunk(skeleton):
    """Independent velocities of the trunk and of a joint relative to it: their variances add up."""
    motion = MotionModel(newcomer=1.7)
    joints = motion.of_joints(skeleton)
    expected = np.sqrt(np.where(joints.trunk, 0.0, joints.speed**2) + 1.7**2)
    np.testing.assert_allclose(motion.of_newcomers(skeleton), expected)


def test_bad_settings_are_refused():
    with pytest.raises(ValueError, match="trunk"):
        MotionModel(trunk=(0.0, 0.8))
    with pytest.raises(ValueError, match="newcomer of the motion model must be above 0"):
        MotionModel(newcomer=0.0)


@given(st.floats(-0.5, 0.5), st.integers(0, 1000))
def test_carrying_joints_is_linear_and_can_be_undone(lead, seed):
    state, covariance = _joint(np.random.default_rng(seed))
    moved, moments = state[0].copy(), covariance[0].copy()
    carry(moved, moments, lead)
    F = np.block([[np.eye(3), lead * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    np.testing.assert_allclose(moved, F @ state[0], atol=1e-12)
    np.testing.assert_allclose(moments, F @ covariance[0] @ F.T, atol=1e-12)
    carry(moved, moments, -lead)
    np.testing.assert_allclose(moved, state[0], atol=1e-12)
    np.testing.assert_allclose(moments, covariance[0], atol=1e-12)


def test_limbs_come_to_move_with_the_trunk():
    """A person who walks on unseen for two seconds stays whole: wrists do not stay behind, nor fly on."""
    speed, time, trunk = MotionModel().of_joints(COCO17)
    state, covariance = np.zeros((17, 6)), np.tile(np.eye(6), (17, 1, 1))
    state[:, 3] = 1.3
    state[9, 3] = 4.0  # a wrist that swings forward
    predict(state, covariance, 2.0, speed, time, trunk)
    np.testing.assert_allclose(
        state[:, 0], np.where(np.arange(17) == 9, state[5, 0] + 2.7 * 0.15, state[5, 0]), atol=1e-3
    )
