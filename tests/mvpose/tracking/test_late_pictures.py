"""Pictures that were taken before the time of the frame: what they say of the joints now, and how surely."""

import numpy as np
import pytest

from mvpose.tracking.motion import JointMotion, transition
from mvpose.tracking.pose_update import MatchedRays, PlacedPeople, update_people

SPEED, TIME, SIGMA = np.array([1.0, 1.3]), np.array([1.6, 0.15]), np.array([0.01, 0.01])
TRUNK = np.array([True, False])
CENTERS = np.array([[4.0, 0.0, 1.0], [0.0, 4.0, 1.5], [-3.0, -3.0, 2.0]])

NO_POSES = PlacedPeople(np.full(1, -1), np.empty((0, 2, 3)), np.empty((0, 2, 3, 3)), np.empty((0, 2)), 1.0)


def seen(rays, shift):
    """Rays of one person from all cameras, as of pictures that were taken ``shift`` seconds ago."""
    count = len(CENTERS)
    ones = np.ones((count, rays.shape[1]))
    labels = np.zeros(count, np.int64)
    return MatchedRays(labels, labels, CENTERS, rays, ones, np.zeros(count), np.full(count, -shift))


def _moved(rng, velocity, shift, joint):
    """Places and velocities after ``shift`` seconds of a simulated Ornstein-Uhlenbeck velocity, (n, 3) each."""
    steps = 200
    h, place = shift / steps, np.zeros_like(velocity)
    for _ in range(steps):
        place = place + h * velocity
        kick = np.sqrt(2.0 * SPEED[joint] ** 2 / TIME[joint] * h)
        velocity = velocity - h / TIME[joint] * velocity + kick * rng.standard_normal(velocity.shape)
    return place, velocity


@pytest.mark.parametrize("shift", [0.02, 0.15])
def test_errors_after_a_late_picture_are_as_large_as_their_covariance_says(shift):
    """The trunk and a limb were seen ``shift`` seconds ago and have moved on since, as people do."""
    rng, people = np.random.default_rng(4), 1500
    trunk_then, limb_then = (SPEED[j] * rng.standard_normal((people, 3)) for j in range(2))
    trunk, trunk_now = _moved(rng, trunk_then, shift, 0)
    limb, limb_now = _moved(rng, limb_then, shift, 1)
    places = np.stack([trunk, trunk + limb], axis=1)  # now, from the place then
    velocities = np.stack([trunk_now, trunk_now + limb_now], axis=1)
    squares = []
    for place, velocity in zip(places, velocities, strict=True):
        prior = np.diag([0.05**2] * 3 + [0.2**2] * 3)
        state = np.concatenate([place, velocity], axis=1) + rng.multivariate_normal(np.zeros(6), prior, 2)
        state, covariance = state[None].copy(), np.tile(prior, (1, 2, 1, 1))
        rays = -CENTERS[:, None] + SIGMA[:, None] * rng.standard_normal((3, 2, 3))  # to the origin, where joints were
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        matched = seen(rays, shift)
        motion = JointMotion(SPEED, TIME, TRUNK)
        update_people(
            state, covariance, np.empty((1, 2)), np.zeros(1, np.int64), matched, SIGMA, 1e-6, motion, NO_POSES
        )
        for joint in range(2):
            error = state[0, joint, :3] - place[joint]
            squares.append(error @ np.linalg.solve(covariance[0, joint, :3, :3], error))
    for of_joint in np.reshape(squares, (-1, 2)).T:
        assert 2.3 < of_joint.mean() < 4.4  # three degrees of freedom; the heavy tails of the prior add to it


def test_backwards_a_joint_moves_as_it_does_forwards():
    """A noiseless picture of a known velocity: the place now is the place then plus the reach of the velocity."""
    shift, velocity = 0.2, np.array([1.0, -0.5, 0.2])
    state, covariance = np.zeros((1, 1, 6)), np.zeros((1, 1, 6, 6))
    state[0, 0, :3], state[0, 0, 3:] = [0.1, 0.0, 0.0], velocity
    covariance[0, 0] = np.diag([25.0] * 3 + [1e-12] * 3)
    rays = -CENTERS[:, None] / np.linalg.norm(CENTERS, axis=1)[:, None, None]
    update_people(
        state, covariance, np.empty((1, 1)), np.zeros(1, np.int64), seen(rays, shift), SIGMA[:1] * 1e-3, 1e-6,
        JointMotion(SPEED[:1], TIME[:1], TRUNK[:1]), NO_POSES,
    )  # fmt: skip
    reach, *_ = transition(shift, SPEED[0], TIME[0])
    np.testing.assert_allclose(state[0, 0], [*reach * velocity, *velocity], atol=1e-3)
    assert np.abs(reach * velocity - shift * velocity).max() > 1e-2  # it slows down on the way
