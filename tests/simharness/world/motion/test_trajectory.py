"""Trajectories of objects and motions of people: interpolation, and checks of their arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.motion import RATE, Motion, Trajectory, interpolate, motion_clock


def turning(time, rate=1.0):
    """Return the trajectory of an object that moves along x at 2 m/s and rotates about z at ``rate`` rad/s."""
    turns = Rotation.from_rotvec(np.outer(rate * time, [0, 0, 1])).as_quat(scalar_first=True)
    place = np.stack([2.0 * time, 0 * time, 0 * time], axis=-1)
    return Trajectory(time, np.concatenate([place, turns], axis=1))


@given(duration=st.floats(0.0, 100.0), margin=st.floats(0.0, 2.0))
def test_the_clock_has_its_rate_and_covers_the_duration(duration, margin):
    time = motion_clock(duration, margin=margin)
    np.testing.assert_allclose(np.diff(time), 1 / RATE)
    assert time[0] <= -margin
    assert time[-1] >= duration + margin
    assert 0.0 in time


def test_interpolation_passes_the_samples_and_reproduces_lines():
    time = np.array([0.0, 0.1, 0.3, 0.35, 0.6])
    values = stream(0, "x").normal(size=(5, 3))
    np.testing.assert_allclose(interpolate(time, values, time), values, atol=1e-12)
    line = np.stack([3 * time - 1, 0 * time], axis=-1)
    when = np.linspace(0.0, 0.6, 50)
    np.testing.assert_allclose(interpolate(time, line, when)[:, 0], 3 * when - 1, atol=1e-12)


def test_velocity_is_continuous_at_the_samples():
    time = np.arange(20) / RATE
    values = stream(1, "x").normal(size=(20, 1))
    step = 1e-6
    for knot in time[1:-1]:
        before = (interpolate(time, values, knot) - interpolate(time, values, knot - step)) / step
        after = (interpolate(time, values, knot + step) - interpolate(time, values, knot)) / step
        np.testing.assert_allclose(before, after, rtol=1e-2, atol=1e-1)
        assert np.abs(before).max() > 0.01


def test_poses_are_constant_beyond_the_ends():
    trajectory = turning(np.linspace(0.0, 1.0, 61))
    np.testing.assert_array_equal(trajectory.at([-5.0, 7.0]), trajectory.pose[[0, -1]])
    alone = Trajectory(np.zeros(1), trajectory.pose[:1])
    np.testing.assert_array_equal(alone.at([[-1.0, 0.0], [2.0, 3.0]]), np.broadcast_to(trajectory.pose[0], (2, 2, 7)))


@given(rate=st.floats(-20.0, 20.0), when=st.floats(0.05, 0.95))
def test_rotations_take_the_shorter_arc_for_all_quaternion_signs(rate, when):
    time = np.linspace(0.0, 1.0, 61)
    trajectory = turning(time, rate)
    signs = np.where(stream(2, "signs").random(61) < 0.5, -1.0, 1.0)
    flipped = Trajectory(time, trajectory.pose * np.concatenate([np.ones((61, 3)), signs[:, None] * np.ones(4)], 1))
    for each in (trajectory, flipped):
        pose = each.at(when)
        assert np.linalg.norm(pose[3:]) == pytest.approx(1.0)
        expected = Rotation.from_euler("z", rate * when)
        got = Rotation.from_quat(pose[3:], scalar_first=True)
        assert (expected.inv() * got).magnitude() < 2e-4
        assert pose[0] == pytest.approx(2.0 * when)


@pytest.mark.parametrize(
    ("time", "pose", "message"),
    [
        (np.zeros(0), np.zeros((0, 7)), "one or more"),
        (np.array([0.0, 0.0]), np.tile([0.0, 0, 0, 1, 0, 0, 0], (2, 1)), "ascending"),
        (np.array([0.0]), np.zeros((1, 7)), "unit length"),
        (np.array([0.0]), np.full((1, 7), np.nan), "finite"),
        (np.array([0.0]), np.zeros((1, 6)), r"\(1, 7\)"),
    ],
)
def test_bad_trajectories_are_refused(time, pose, message):
    with pytest.raises(ValueError, match=message):
        Trajectory(time, pose)


def upright(frames: int) -> np.ndarray:
    return np.tile([0.0, 0, 1, 1, 0, 0, 0], (frames, 1))


def test_motion_is_read_only_and_has_a_length():
    motion = Motion(time=np.arange(3.0), root=upright(3), angles=np.zeros((3, len(DOFS))))
    assert len(motion) == 3
    with pytest.raises(ValueError, match="read-only"):
        motion.angles[0, 0] = 1.0


@pytest.mark.parametrize(
    ("root", "angles", "message"),
    [
        (upright(3)[:, :6], np.zeros((3, 35)), r"motion root must be \(3, 7\), got \(3, 6\)"),
        (upright(3), np.zeros((2, 35)), r"motion angles must be \(3, 35\), got \(2, 35\)"),
        (2 * upright(3), np.zeros((3, 35)), "unit length"),
        (upright(2), np.array([[0.0] * 35, [np.nan] * 35]), "index 1"),
    ],
)
def test_bad_motions_are_refused(root, angles, message):
    with pytest.raises(ValueError, match=message):
        Motion(time=np.arange(float(len(root))), root=root, angles=angles)
