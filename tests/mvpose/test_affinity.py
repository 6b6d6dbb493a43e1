import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import crowd, detect, look_at, ring
from scipy.optimize import minimize

from mvpose import Camera, Detections, Rig
from mvpose.affinity import GeometricAffinity, epipolar_distance, ray_distance, sigmoid
from mvpose.rays import Rays, viewing_rays


def two_rays(origin, direction, other_origin, other_direction):
    directions = np.array([[direction], [other_direction]], float)
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return Rays(
        np.array([0, 1]),
        np.array([origin, other_origin], float),
        directions,
        np.ones((2, 1)),
        np.full(2, 1e-3),
    )


@given(st.integers(0, 100_000))
def test_ray_distance_is_the_least_distance_of_the_half_lines(seed):
    rng = np.random.default_rng(seed)
    rays = two_rays(*rng.standard_normal((4, 3)))
    (o, p), (u, v) = rays.origins, rays.directions[:, 0]

    def squared(s):
        return float(((o + s[0] * u - p - s[1] * v) ** 2).sum())

    starts = [(0, 0), (1, 1), (5, 0), (0, 5)]
    best = min(minimize(squared, s, bounds=[(0, None)] * 2, options={"ftol": 1e-15}).fun for s in starts)
    assert ray_distance(rays)[0][0, 1] == pytest.approx(np.sqrt(best), abs=1e-4)


def test_parallel_and_diverging_rays_are_defined():
    assert ray_distance(two_rays([0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 0, 0]))[0][0, 1] == pytest.approx(2)
    # They would meet behind both cameras; in front, they are nearest at the centres.
    assert ray_distance(two_rays([0, 0, 0], [1, -1, 0], [0, 2, 0], [1, 1, 0]))[0][0, 1] == pytest.approx(2)


def test_true_matches_are_at_no_distance_and_others_are_not():
    rig, people = ring(5), crowd(4)
    detections, person = detect(rig, people)
    same = (person[:, None] == person) & (detections.view[:, None] != detections.view)
    distance, shared = ray_distance(viewing_rays(rig, detections))
    assert distance[same].max() < 1e-6
    assert (shared[same] == 17).all()
    assert np.isinf(distance[detections.view[:, None] == detections.view]).all()
    assert np.median(distance[(person[:, None] != person) & np.isfinite(distance)]) > 0.1


def test_epipolar_distance_is_the_mean_over_both_lines():
    rig, people = ring(3), crowd(2)
    detections, person = detect(rig, people, noise=5.0)
    distance = epipolar_distance(rig, detections)
    a, b = (
        np.argmax((detections.view == 0) & (person == 0)),
        np.argmax((detections.view == 1) & (person == 1)),
    )
    x, y = detections.keypoints[a], detections.keypoints[b]
    in_b = cv2.computeCorrespondEpilines(x[:, None], 1, rig.F[0, 1])[:, 0]  # normalised lines
    in_a = cv2.computeCorrespondEpilines(y[:, None], 2, rig.F[0, 1])[:, 0]
    expected = 0.5 * (np.abs((in_b[:, :2] * y).sum(1) + in_b[:, 2]) + np.abs((in_a[:, :2] * x).sum(1) + in_a[:, 2]))
    assert distance[a, b] == pytest.approx(expected.mean(), rel=1e-4)  # OpenCV works in single precision
    np.testing.assert_allclose(distance, distance.T)


def test_missing_joints_are_left_out_and_sure_joints_weigh_more():
    rig = ring(2)
    people = crowd(1)
    pixels = rig.project(people[0])
    scores = np.full((2, 17), 0.5)
    pixels[1, 9] += 200  # one wrong wrist
    wrong = ray_distance(viewing_rays(rig, Detections.from_keypoints([0, 1], pixels, scores)))[0][0, 1]
    scores[1, 9] = 0.05
    doubted = ray_distance(viewing_rays(rig, Detections.from_keypoints([0, 1], pixels, scores)))[0][0, 1]
    scores[1, 9] = 0.0
    gone, shared = ray_distance(viewing_rays(rig, Detections.from_keypoints([0, 1], pixels, scores)))
    assert wrong > 5 * doubted > 0
    assert gone[0, 1] < 1e-9
    assert shared[0, 1] == 16


def test_ray_affinity_does_not_depend_on_resolution():
    people = crowd(3)
    matrices = []
    for scale in (0.25, 1.0, 4.0):
        rig = ring(4)
        cameras = [
            Camera(
                np.diag([scale, scale, 1]) @ c.K,
                c.R,
                c.t,
                size=(int(c.size[0] * scale), int(c.size[1] * scale)),
            )
            for c in rig
        ]
        detections, _ = detect(Rig(cameras), people, noise=3.0 * scale)
        matrices.append(GeometricAffinity()(viewing_rays(Rig(cameras), detections)))
    np.testing.assert_allclose(matrices[0], matrices[1], atol=1e-9)
    np.testing.assert_allclose(matrices[2], matrices[1], atol=1e-9)


def test_same_view_and_far_pairs_have_no_affinity_at_all():
    rig = ring(4)
    detections, person = detect(rig, crowd(3, spacing=1.5), noise=2.0)
    affinity = GeometricAffinity()(viewing_rays(rig, detections))
    assert (affinity[detections.view[:, None] == detections.view] == 0).all()
    true = (person[:, None] == person) & (detections.view[:, None] != detections.view)
    assert affinity[true].min() > 0.9
    assert ((affinity >= 0) & (affinity <= 1)).all()
    np.testing.assert_array_equal(affinity, affinity.T)


def test_sigmoid_is_half_at_its_midpoint_and_zero_at_infinity():
    values = sigmoid(np.array([0.0, 0.15, 0.19, 1e6, np.inf]), midpoint=0.15, slope=0.04)
    np.testing.assert_allclose(values, [1 / (1 + np.exp(-3.75)), 0.5, 1 / (1 + np.e), 0, 0], atol=1e-12)


def test_a_view_that_the_rig_does_not_have_is_refused():
    detections, _ = detect(ring(5), crowd(1))
    with pytest.raises(ValueError, match="names view 4, but the rig has 3 cameras"):
        viewing_rays(ring(3), detections)


def test_a_distorted_lens_changes_nothing():
    straight, bent = ring(3), ring(3, distortion=[-0.2, 0.05, 0.001, -0.001, 0.0])
    people = crowd(2, spacing=0.6)
    for rig in (straight, bent):
        detections, person = detect(rig, people)
        same = (person[:, None] == person) & (detections.view[:, None] != detections.view)
        assert epipolar_distance(rig, detections)[same].max() < 1e-5
    assert look_at([1, 0, 0], [0, 0, 0]).distortion.any() == False  # noqa: E712
