"""What the pipeline returns of each person beside joints: scores and covariances, in the order of the people."""

import numpy as np
import pytest
from people import STANDING, crowd, detect, ring
from scipy.optimize import linear_sum_assignment

import mvpose
from mvpose import COCO17, Detections
from mvpose.reconstruction import Noise
from mvpose.reconstruction.error_scale import SHARED

FLOOR = 0.01  # of the error model: a hundredth of the peak
MATCHED = ["full", "geometry", "hungarian", "no-3dps", "fast"]


def assigned(estimate, people):
    """Index of the estimate of each person."""
    distance = np.linalg.norm(estimate.joints[None] - people[:, None], axis=3).mean(axis=2)
    return linear_sum_assignment(distance)[1]


@pytest.mark.parametrize("preset", MATCHED)
@pytest.mark.parametrize("views", [3, 5])
def test_the_score_of_exact_keypoints_is_their_score_times_the_probability_that_they_are_right(preset, views):
    """All views agree on each person: the mean over views of s times s / (s + floor)."""
    rig, people = ring(views), crowd(3, spacing=1.5)
    detections, person = detect(rig, people)
    own = np.array([0.9, 0.35, 0.6])
    detections = Detections.from_keypoints(detections.view, detections.keypoints, np.repeat(own[person, None], 17, 1))
    estimate = mvpose.preset(preset).estimate(rig, detections)
    scores = np.median(estimate.scores[assigned(estimate, people)], axis=1)  # a bone may pull single joints
    np.testing.assert_allclose(scores, own * own / (own + FLOOR), rtol=0.02)


@pytest.mark.parametrize("preset", ["full", "fast"])
def test_a_view_that_does_not_see_a_joint_counts_in_the_mean(preset):
    rig = ring(5)
    scores = np.full((5, 17), 0.9)
    scores[:2, 9] = 0.0
    estimate = mvpose.preset(preset).estimate(
        rig, Detections.from_keypoints(np.arange(5), rig.project(STANDING), scores)
    )
    assert estimate.scores[0, 9] == pytest.approx(0.6 * estimate.scores[0, 10], rel=0.02)


@pytest.mark.parametrize("preset", ["full", "fast"])
def test_squared_errors_are_those_that_the_covariances_say(preset):
    """Keypoints with the errors of the error model: squared errors over covariances have the median of the t."""
    rng, rig, squares = np.random.default_rng(5), ring(5), []
    pipeline = mvpose.preset(preset)
    for seed in range(40):
        people = crowd(2, spacing=1.5, seed=seed)
        depth = np.linalg.norm(people - rig.centers[:, None, None], axis=3)
        pixels = rig.project(people + SHARED * Noise().sigmas(COCO17)[:, None] * rng.standard_normal(people.shape))
        pixels += rng.standard_normal(pixels.shape) * (Noise().sigmas(COCO17) / 0.9 * 800 / depth)[..., None]
        view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
        detections = Detections.from_keypoints(view, pixels[view, person], np.full((len(view), 17), 0.9))
        estimate = pipeline.estimate(rig, detections)
        order = assigned(estimate, people)
        off = estimate.joints[order] - people
        squares += np.einsum("pji,pjik,pjk->pj", off, np.linalg.inv(estimate.covariance[order]), off).ravel().tolist()
    assert len(squares) == 40 * 2 * 17
    # 3 F(1/2; 3, n) (n - 2) / n with the n = 9.3 of five views is 1.98; factors of sqrt(2) in the covariance are seen
    assert 1.4 < np.median(squares) < 2.8


@pytest.mark.parametrize("preset", ["full", "fast"])
def test_nobody_is_lost_in_any_of_many_frames(preset):
    rig, pipeline = ring(4), mvpose.preset(preset)
    people = crowd(3, spacing=1.2)
    rng = np.random.default_rng(7)
    found = []
    for _ in range(250):
        pixels = rig.project(people) + rng.normal(0, 2.0, (4, 3, 17, 2))
        view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
        scores = rng.uniform(0.6, 1.0, (len(view), 17))
        estimate = pipeline.estimate(rig, Detections.from_keypoints(view, pixels[view, person], scores))
        labels = estimate.matching.labels
        found.append(len(estimate) == 3 and np.array_equal(labels[:, None] == labels, person[:, None] == person))
    assert all(found)
