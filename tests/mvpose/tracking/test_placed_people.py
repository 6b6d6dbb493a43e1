"""Evidence for tracks: poses that the stages of a frame place, pictures of earlier times, and bone lengths."""

import numpy as np
import pytest
from people import STANDING
from walking_people import film

from mvpose import COCO17, PANOPTIC19, Pipeline
from mvpose.reconstruction import Triangulation
from mvpose.tracking import Tracker, TrackingModel, track
from mvpose.tracking.bones import bone_prior, scaled_lengths
from mvpose.tracking.motion import JointMotion, transition
from mvpose.tracking.pose_update import MatchedRays, PlacedPeople, number_people, repetition, update_people

CENTERS = np.array([[4.0, 0.0, 1.0], [0.0, 4.0, 1.5]])


SPEED, TIME, SIGMA = np.array([1.0, 1.3]), np.array([1.6, 0.15]), np.array([0.01, 0.01])
TRUNK = np.array([True, False])
THREE_CENTERS = np.array([[4.0, 0.0, 1.0], [0.0, 4.0, 1.5], [-3.0, -3.0, 2.0]])

NO_POSES = PlacedPeople(np.full(1, -1), np.empty((0, 2, 3)), np.empty((0, 2, 3, 3)), np.empty((0, 2)), 1.0)


def _update(place, spread, *, seen=(1.0, 1.0), factor=1.0, of_pose=0):
    """State and covariance of one joint after the update by a place; its rays pass elsewhere."""
    rng = np.random.default_rng(0)
    root = rng.standard_normal((6, 6))
    state, covariance = 0.01 * rng.standard_normal((1, 1, 6)), (0.02 * root @ root.T + 0.05 * np.eye(6))[None, None]
    before = state[0, 0].copy(), covariance[0, 0].copy()
    rays = np.array([0.3, 0.3, 0.0]) - CENTERS[:, None]
    rays = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    support = np.empty((1, 1))
    both = np.zeros(2, np.int64)
    matched = MatchedRays(both, both, CENTERS, rays, np.array(seen)[:, None], np.zeros(2), np.zeros(2))
    motion = JointMotion(np.array([1.0]), np.array([1.6]), np.array([True]))
    placed = PlacedPeople(np.array([of_pose]), place[None, None], spread[None, None], np.array([[0.7]]), factor)
    update_people(state, covariance, support, np.zeros(1, np.int64), matched, np.array([0.05]), 0.01, motion, placed)
    return before, (state[0, 0], covariance[0, 0]), support[0, 0]


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_a_place_is_a_measurement_of_the_kalman_filter(factor):
    place, spread = np.array([0.02, -0.03, 0.05]), np.diag([1e-3, 2e-3, 3e-3])
    (mean, moments), (state, covariance), support = _update(place, spread, factor=factor)
    H = np.eye(3, 6)
    gain = moments @ H.T @ np.linalg.inv(H @ moments @ H.T + factor * spread)
    np.testing.assert_allclose(state, mean + gain @ (place - mean[:3]), atol=1e-12)
    np.testing.assert_allclose(covariance, (np.eye(6) - gain @ H) @ moments, atol=1e-12)
    assert support == 0.7


def test_far_from_the_prediction_the_place_counts_more_than_for_gaussians():
    place, spread = np.array([3.0, -2.0, 1.0]), 1e-2 * np.eye(3)
    (mean, moments), (state, _), _ = _update(place, spread)
    H = np.eye(3, 6)
    gaussian = mean + moments @ H.T @ np.linalg.inv(H @ moments @ H.T + spread) @ (place - mean[:3])
    assert np.linalg.norm(state[:3] - place) < 0.5 * np.linalg.norm(gaussian[:3] - place)


def test_rays_are_the_evidence_where_one_camera_sees_the_joint_or_nothing_is_placed():
    place, spread = np.array([0.02, -0.03, 0.05]), 1e-3 * np.eye(3)
    _, by_place, _ = _update(place, spread)
    _, one_camera, _ = _update(place, spread, seen=(1.0, 0.0))
    _, one_ray, _ = _update(place + 1.0, spread, seen=(1.0, 0.0), of_pose=-1)
    np.testing.assert_array_equal(one_camera[0], one_ray[0])
    _, unplaced, _ = _update(np.full(3, np.nan), spread * np.nan)
    _, rays, _ = _update(place, spread, of_pose=-1)
    np.testing.assert_array_equal(unplaced[0], rays[0])
    assert np.linalg.norm(rays[0] - by_place[0]) > 0.05


def test_only_people_whom_several_cameras_saw_now_are_numbered():
    labels, groups = np.array([0, 2, 0, 1, 2, -1, 3, 3]), np.array([2, -1, 0, 1, 3])
    lead = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.01])
    of_pose, people = np.full(5, -1), np.full(8, -1)
    number_people(labels, groups, lead, of_pose, people)
    assert of_pose.tolist() == [0, -1, 1, -1, -1]
    assert people.tolist() == [1, 0, 1, -1, 0, -1, -1, -1]


@pytest.mark.parametrize("step", [0.02, 0.1, 0.5])
def test_repeated_errors_average_out_like_larger_independent_ones(step):
    correlation, count = 0.2, 4000
    lags = np.arange(-count + 1, count)
    of_mean = ((1.0 - np.abs(lags) / count) * np.exp(-np.abs(lags) * step / correlation)).sum() / count
    assert repetition(step, correlation) / count == pytest.approx(of_mean, rel=0.02)
    assert repetition(0.0, correlation) == repetition(step, 0.0) == 1.0
    assert repetition(100.0, correlation) == pytest.approx(1.0)


@pytest.mark.parametrize("skeleton", [COCO17, PANOPTIC19])
def test_tracks_start_from_the_size_of_the_person(skeleton):
    prior = bone_prior(skeleton)
    one = np.full((1, len(skeleton), 3), np.nan)
    one[0, 0] = 0.0
    assert scaled_lengths(one, prior) == pytest.approx(prior.length[None])  # too few joints to tell
    assert scaled_lengths(one[:0], prior).shape == (0, len(prior.length))


def test_a_child_gets_the_bones_of_a_child():
    prior = bone_prior(COCO17)
    sizes = np.array([0.65, 0.8, 1.0, 1.1])
    people = sizes[:, None, None] * STANDING
    lengths = scaled_lengths(people, prior)
    np.testing.assert_allclose(lengths / lengths[2], np.tile(sizes[:, None], len(prior.length)))
    people[1, 9] += 5.0  # a wrist that is somewhere else changes nothing
    assert scaled_lengths(people, prior)[1] == pytest.approx(lengths[1], rel=0.05)
    assert (scaled_lengths(0.1 * people, prior) == scaled_lengths(0.2 * people, prior))[2].all()  # nobody is so small


PATHS = [(-0.8, -0.5, 0.4, 0.2), (0.8, 0.6, -0.3, -0.3)]


def test_bodies_placed_as_a_whole_make_tracks_better():
    """With 3DPS in the stages of a frame, tracks follow people better than with the same rays joint by joint."""
    rig, frames, truth = film(PATHS, np.arange(20) / 10.0, noise=12.0)
    errors = []
    for reconstruction in (Pipeline().reconstruction, Triangulation()):
        pipeline = Pipeline(reconstruction=reconstruction)
        estimates = list(track(Tracker(pipeline, model=TrackingModel()), rig, frames, lag=0.2))
        distance = [
            np.linalg.norm(e.joints[:, None] - people, axis=3).mean(axis=2)
            for e, people in zip(estimates, truth, strict=True)
        ]
        errors.append(np.mean([each.min(axis=0) for each in distance][3:]))
    assert errors[0] < 0.97 * errors[1]


def test_a_negative_correlation_is_refused():
    with pytest.raises(ValueError, match="correlation must be 0 s or more"):
        TrackingModel(correlation=-0.1)


def seen(rays, shift):
    """Rays of one person from all cameras, as of pictures that were taken ``shift`` seconds ago."""
    count = len(THREE_CENTERS)
    ones = np.ones((count, rays.shape[1]))
    labels = np.zeros(count, np.int64)
    return MatchedRays(labels, labels, THREE_CENTERS, rays, ones, np.zeros(count), np.full(count, -shift))


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
        rays = -THREE_CENTERS[:, None] + SIGMA[:, None] * rng.standard_normal(
            (3, 2, 3)
        )  # to the origin, where joints were
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
    rays = -THREE_CENTERS[:, None] / np.linalg.norm(THREE_CENTERS, axis=1)[:, None, None]
    update_people(
        state, covariance, np.empty((1, 1)), np.zeros(1, np.int64), seen(rays, shift), SIGMA[:1] * 1e-3, 1e-6,
        JointMotion(SPEED[:1], TIME[:1], TRUNK[:1]), NO_POSES,
    )  # fmt: skip
    reach, *_ = transition(shift, SPEED[0], TIME[0])
    np.testing.assert_allclose(state[0, 0], [*reach * velocity, *velocity], atol=1e-3)
    assert np.abs(reach * velocity - shift * velocity).max() > 1e-2  # it slows down on the way
