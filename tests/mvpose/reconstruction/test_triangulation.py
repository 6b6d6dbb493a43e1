import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, detect, look_at, ring

from mvpose import COCO17, Detections, Rig
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Triangulation
from mvpose.reconstruction.hypotheses import _link, _meetings, _supporting_rays
from mvpose.reconstruction.likelihood import log_likelihood
from mvpose.reconstruction.triangulation import consensus, pair_point


def rays_of(rig, pixels, scores=None):
    scores = np.full(pixels.shape[:2], 0.9) if scores is None else scores
    return viewing_rays(rig, Detections.from_keypoints(np.arange(len(rig)), pixels, scores))


def triangulate(rays, **kwargs):
    """Joints, scores and covariances of the single person to whom all rays belong."""
    return (each[0] for each in Triangulation(**kwargs)(rays, np.zeros(len(rays), int), COCO17)[:3])


@given(st.integers(2, 7), st.floats(-1, 1), st.floats(-1, 1))
def test_exact_pixels_give_the_exact_point(views, x, y):
    rig = ring(views, distortion=[-0.2, 0.05, 0, 0, 0])
    people = (STANDING + [x, y, 0])[None]
    rays = viewing_rays(rig, detect(rig, people, shuffle=False)[0])
    joints, scores, _ = triangulate(rays)
    np.testing.assert_allclose(joints, people[0], atol=1e-4)
    assert (scores > 0.8).all()


def test_a_wrong_view_is_left_out():
    rig = ring(5)
    pixels = rig.project(STANDING)
    pixels[2, 9] += [150, -80]
    joints, scores, _ = triangulate(rays_of(rig, pixels))
    assert np.linalg.norm(joints - STANDING, axis=1).max() < 2e-3
    assert scores[9] == pytest.approx(0.8 * scores[10], rel=0.02)  # four views of five vouch for it


def test_a_single_view_joint_is_missing():
    rig = ring(4)
    pixels, scores = rig.project(STANDING), np.full((4, 17), 0.9)
    scores[1:, 9] = 0
    scores[:, 10] = 0
    joints, scores, covariance = triangulate(rays_of(rig, pixels, scores))
    assert np.isnan(joints[[9, 10]]).all()
    assert (scores[[9, 10]] == 0).all()
    assert np.isnan(covariance[[9, 10]]).all()
    assert np.isfinite(np.delete(joints, [9, 10], axis=0)).all()


def test_covariance_is_largest_along_the_line_of_sight():
    near = ring(12, radius=5.0)
    rig = type(near)([near[0], near[1]])  # two cameras 30 degrees apart: depth is worst known
    _, _, covariance = triangulate(rays_of(rig, rig.project(STANDING)))
    values, vectors = np.linalg.eigh(covariance[11])
    sight = STANDING[11] - rig.centers.mean(axis=0)
    assert abs(vectors[:, 2] @ sight) / np.linalg.norm(sight) > 0.99
    assert values[2] > 5 * values[1] > 0


def test_rays_that_meet_behind_the_cameras_give_no_joint():
    rig = Rig([look_at([4, y, 1], [0, y, 1]) for y in (-0.5, 0.5)])  # side by side; image right is world +y
    pixels = rig.project(STANDING)
    pixels[:, 9] = [[100, 480], [1180, 480]]  # the left camera sees the wrist on its left, the right on its right
    joints, scores, _ = triangulate(rays_of(rig, pixels))
    assert np.isnan(joints[9]).all()
    assert scores[9] == 0
    assert np.isfinite(np.delete(joints, 9, axis=0)).all()


def test_consensus_is_as_likely_as_the_best_of_all_pairs():
    """A third of the views is wrong by up to metres; a point of a pair is hardly ever likelier than the result."""
    worse, trials = 0, 400
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        rig = ring(int(rng.integers(3, 8)))
        truth = rng.uniform([-1, -1, 0.5], [1, 1, 1.8])
        wrong = (rng.random(len(rig)) < 0.3)[:, None] * rng.uniform(-1.5, 1.5, (len(rig), 3))
        directions = truth + rng.normal(0, 0.03, (len(rig), 3)) + wrong - rig.centers
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        view = (rig.centers, directions[:, None], rng.uniform(0.4, 1.0, (len(rig), 1)), np.full(len(rig), 1e-3))
        point, tried = np.empty(3), np.empty(3)
        assert consensus(point, (*view, 0.05, 0.01), np.empty((8, 3)))[0] > 0
        rays = list(zip(view[0], view[1][:, 0], view[2][:, 0], strict=True))
        likelihoods = [
            log_likelihood(tried, *view, 0.05, 0.01)
            for one, other in itertools.combinations(rays, 2)
            if pair_point(*one, *other, tried) > 0
        ]
        worse += log_likelihood(point, *view, 0.05, 0.01) < max(likelihoods, default=-np.inf) - 0.1
    assert worse <= 0.01 * trials


def test_the_all_view_point_is_the_weighted_least_squares_solution():
    """The DLT in metres: rows are the distances to the rays, weighted by score."""
    rig = ring(5)
    rng = np.random.default_rng(3)
    scores = rng.uniform(0.2, 1.0, (5, 17))
    rays = rays_of(rig, rig.project(STANDING) + rng.normal(0, 8, (5, 17, 2)), scores)
    joints, _, _ = triangulate(rays, method="dlt")
    for j in range(17):
        across = np.eye(3) - rays.directions[:, j, :, None] * rays.directions[:, j, None, :]
        rows = (scores[:, j, None, None] * across).reshape(-1, 3)
        right = (scores[:, j, None] * (across @ rays.origins[:, :, None])[..., 0]).ravel()
        np.testing.assert_allclose(joints[j], np.linalg.lstsq(rows, right, rcond=None)[0], atol=1e-9)


def test_best_pair_leaves_a_wrong_view_out():
    rig = ring(5)
    pixels = rig.project(STANDING)
    pixels[2, 9] += [150, -80]
    joints, _, _ = triangulate(rays_of(rig, pixels), method="best-pair")
    assert np.linalg.norm(joints - STANDING, axis=1).max() < 1e-6
    averaged, _, _ = triangulate(rays_of(rig, pixels), method="dlt")
    assert np.linalg.norm(averaged[9] - STANDING[9]) > 0.1
    noisy = pixels + np.random.default_rng(1).normal(0, 5, pixels.shape)
    of_two, _, _ = triangulate(rays_of(rig, noisy), method="best-pair")
    of_all, _, _ = triangulate(rays_of(rig, noisy))
    assert np.linalg.norm(of_two - STANDING, axis=1).mean() > np.linalg.norm(of_all - STANDING, axis=1).mean()


def test_people_do_not_affect_each_other():
    rig = ring(4)
    detections, person = detect(rig, np.stack([STANDING, STANDING + [1, 0, 0]]), noise=3.0)
    rays = viewing_rays(rig, detections)
    labels = np.where(person == 0, 1, -1)
    labels[person == 1] = 0
    both = Triangulation()(rays, labels, COCO17)
    alone = Triangulation()(rays.select(person == 0), np.zeros(4, int), COCO17)
    np.testing.assert_array_equal(both.joints[1], alone.joints[0])
    np.testing.assert_array_equal(both.covariance[1], alone.covariance[0])


def test_an_unknown_method_is_refused():
    with pytest.raises(ValueError, match="robust, dlt, best-pair"):
        Triangulation(method="magic")


def _rows(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return random rays as the state space holds them; see ``_ray_rows``."""
    origins, directions = rng.uniform(-4, 4, (count, 3)), rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    score = rng.uniform(0.05, 1.0, count)
    odds = score / 0.01
    return np.column_stack([origins, directions, score, odds, rng.uniform(0, 1e-4, count), 2 * np.log(odds)])


@pytest.mark.parametrize("seed", range(5))
def test_the_supporting_keypoints_are_those_that_are_more_likely_right_than_wrong(seed: int) -> None:
    rng, sigma = np.random.default_rng(seed), 0.1
    rows = _rows(rng, 30)
    depth = rng.uniform(-3, 6, 60)  # also behind the cameras
    ray = rng.integers(30, size=60)
    points = rows[ray, :3] + depth[:, None] * rows[ray, 3:6] + rng.normal(0, 0.15, (60, 3))
    count, which, evidence = _supporting_rays(rows, points, sigma)
    assert 0 < count.sum() < rows.shape[0] * len(points)
    found = []
    for point in points:
        for k, row in enumerate(rows):
            along = (point - row[:3]) @ row[3:6]
            variance = (sigma**2 + row[8] * along**2) / row[6] ** 2
            likelihood = row[7] * np.exp(-0.5 * ((point - row[:3]) @ (point - row[:3]) - along**2) / variance)
            if along > 0 and likelihood > 1:
                found.append((k, np.log1p(likelihood)))
    assert which.tolist() == [k for k, _ in found]
    np.testing.assert_allclose(evidence, [value for _, value in found], rtol=1e-9)


def test_links_join_exactly_the_states_at_the_length_of_the_bone() -> None:
    rng = np.random.default_rng(0)
    start, parents = np.array([0, 20, 50, 60]), np.array([-1, 0, 1])
    points, length = rng.uniform(-0.6, 0.6, (60, 3)), np.array([0.0, 0.5, 0.3])
    deviation = np.array([np.inf, 0.05, np.inf])  # the last bone has no published length
    first, state, cost = _link(start, points, parents, length, deviation, 2.0)
    reach = np.linalg.norm(points[20:50, None] - points[None, :20], axis=2)
    pairs = [(20 + a, b) for a, b in np.argwhere(abs(reach - 0.5) <= 0.1)]
    assert 0 < len(pairs) < 600
    assert [(s, state[k]) for s in range(60) for k in range(first[s], first[s + 1])] == pairs
    np.testing.assert_allclose(cost, [0.5 * ((reach[s - 20, b] - 0.5) / 0.05) ** 2 for s, b in pairs], rtol=1e-9)


@pytest.mark.parametrize("score", [0.25, 0.5, 1.0])
def test_rays_meet_within_as_many_deviations_as_their_scores_allow(score):
    """Two perpendicular rays a gap apart, whose variance is the sum of both, each over its score squared."""
    sigma, agreement = 0.05, 2.0
    widest = agreement * np.sqrt(2.0) * sigma / score
    for gap, meets in ((0.98 * widest, True), (1.02 * widest, False)):
        rows = np.zeros((2, 10))
        rows[0, :6], rows[1, :6] = [-3, 0, 0, 1, 0, 0], [0, -3, gap, 0, 1, 0]
        rows[:, 6], rows[:, 7], rows[:, 9] = score, score / 0.01, 2 * np.log(score / 0.01)
        points, ends, _ = _meetings(np.array([0, 1]), rows, sigma, agreement)
        assert len(points) == len(ends) == meets
        if meets:
            np.testing.assert_allclose(points, [[0.0, 0.0, gap / 2]], atol=1e-9)
