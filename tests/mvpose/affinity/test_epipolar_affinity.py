import cv2
import numpy as np
import pytest
from gathering import noisy, people_in_a_room, rig_around
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, crowd, detect, look_at, ring

from mvpose import Camera, Detections, Rig
from mvpose.affinity import EpipolarAffinity, epipolar_distance
from mvpose.rays import viewing_rays


def affinities(rig, detections, **parameters):
    return EpipolarAffinity(**parameters)(rig, detections, viewing_rays(rig, detections))


def test_epipolar_distance_is_the_mean_over_both_lines():
    rig, people = ring(3), crowd(2)
    detections, person = detect(rig, people, noise=5.0)
    distance = epipolar_distance(rig, detections)
    a, b = (np.argmax((detections.view == 0) & (person == 0)), np.argmax((detections.view == 1) & (person == 1)))
    x, y = detections.keypoints[a], detections.keypoints[b]
    in_b = cv2.computeCorrespondEpilines(x[:, None], 1, rig.F[0, 1])[:, 0]  # normalised lines
    in_a = cv2.computeCorrespondEpilines(y[:, None], 2, rig.F[0, 1])[:, 0]
    expected = 0.5 * (np.abs((in_b[:, :2] * y).sum(1) + in_b[:, 2]) + np.abs((in_a[:, :2] * x).sum(1) + in_a[:, 2]))
    expected *= 1000 / 1280  # pixels of an image 1000 wide
    assert distance[a, b] == pytest.approx(expected.mean(), rel=1e-4)  # OpenCV works in single precision
    np.testing.assert_allclose(distance, distance.T)


def test_lens_distortion_does_not_change_the_distance():
    straight, bent = ring(3), ring(3, distortion=[-0.2, 0.05, 0.001, -0.001, 0.0])
    people = crowd(2, spacing=0.6)
    for rig in (straight, bent):
        detections, person = detect(rig, people)
        same = (person[:, None] == person) & (detections.view[:, None] != detections.view)
        assert epipolar_distance(rig, detections)[same].max() < 1e-5
    assert look_at([1, 0, 0], [0, 0, 0]).distortion.any() == False  # noqa: E712


def traced(camera, origin, direction, pixel, nearest):
    """Distance from a pixel to the image of a ray, sampled point by point; infinite where the ray is not visible."""
    along = nearest + np.concatenate([[0.0], np.geomspace(1e-4, 1e7, 20_000)])
    points = origin + along[:, None] * direction
    seen = camera.project(points[camera.depth(points) > 1e-9])
    if len(seen) < 2:
        return np.inf
    start, step = seen[:-1], np.diff(seen, axis=0)
    share = np.clip(((pixel - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12), 0, 1)
    return np.linalg.norm(pixel - start - share[:, None] * step, axis=1).min()


@given(st.integers(0, 100_000))
def test_the_distance_is_to_the_image_of_the_ray(seed):
    """Cameras at any position, also behind each other: one joint, both directions, in normalised pixels."""
    rng = np.random.default_rng(seed)
    sizes = [(1280, 960), (500, 400)]
    rig = Rig([look_at(rng.uniform(-3, 3, 3), rng.uniform(-3, 3, 3), focal=0.6 * size[0], size=size) for size in sizes])
    pixels = np.array([rng.uniform(0, size) for size in sizes])
    detections = Detections.from_keypoints(
        [0, 1], np.tile(pixels[:, None], (1, 17, 1)), np.tile(np.arange(17) == 3, (2, 1))
    )
    one_way = [
        1000 / sizes[other][0] * traced(rig[other], rig.centers[k], rig[k].rays(pixels[k]), pixels[other], 0.3)
        for k, other in ((0, 1), (1, 0))
    ]
    expected = np.minimum(one_way, 300).mean()
    scale = dict(midpoint=150.0, slope=40.0, threshold=1e3, saturation=300.0, least_joints=1, nearest=0.3, epipole=0.0)
    found = 150 + 40 * np.log(1 / affinities(rig, detections, **scale)[0, 1] - 1)  # the sigmoid, inverted
    assert found == pytest.approx(expected, rel=2e-3, abs=0.3)


@pytest.mark.parametrize("seed", range(3))
def test_joint_distances_are_saturated_weighted_and_mapped(seed):
    """Distances of single joints come from detections with that joint only; the mean is computed by hand."""
    rig = rig_around(3, seed=seed)
    detections, _ = noisy(rig, people_in_a_room(2, half=0.6, seed=seed), seed=seed, pixels=12, missed=0.4)
    m = len(detections)
    distances = np.full((17, m, m), np.nan)
    for j in range(17):
        only = Detections.from_keypoints(
            detections.view, detections.keypoints, detections.scores * (np.arange(17) == j)
        )
        distances[j] = epipolar_distance(rig, only)
    weights = detections.scores.T[:, :, None] * detections.scores.T[:, None, :]
    weights = np.where(np.isfinite(distances), weights, 0)
    mass = weights.sum(axis=0)
    mean = (weights * np.where(weights > 0, distances, 0)).sum(axis=0) / np.where(mass > 0, mass, 1)
    finite = mass > 0
    np.testing.assert_allclose(epipolar_distance(rig, detections)[finite], mean[finite], rtol=1e-9)
    expected = np.where(finite & (mean <= 50) & ((weights > 0).sum(axis=0) >= 4), 1 / (1 + np.exp((mean - 20) / 9)), 0)
    found = affinities(
        rig, detections, midpoint=20, slope=9, threshold=50, saturation=np.inf, least_joints=4, nearest=0, epipole=0
    )
    assert 0.1 < (found > 0).mean() < 0.9
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_epipolar_affinity_does_not_depend_on_resolution():
    people = people_in_a_room(3)
    matrices = []
    for size in ((360, 270), (1280, 960), (4000, 3000)):
        rig = rig_around(4, size=size)
        scale = np.array(size) / [1280, 960]
        reference = rig_around(4)
        detections, _ = noisy(reference, people)
        # The same picture, sampled otherwise: pixel centres are at integers, so the corner is at -0.5.
        keypoints = (detections.keypoints + 0.5) * scale - 0.5
        matrices.append(affinities(rig, Detections.from_keypoints(detections.view, keypoints, detections.scores)))
    np.testing.assert_allclose(matrices[0], matrices[1], atol=1e-9)
    np.testing.assert_allclose(matrices[2], matrices[1], atol=1e-9)
    assert (matrices[1] > 0.8).any()


def test_lines_that_meet_behind_a_camera_are_no_match():
    """Two cameras side by side: a shift the wrong way keeps every joint on its line, but behind both cameras."""
    rig = Rig([look_at([5, y, 1], [0, y, 1]) for y in (-0.5, 0.5)])
    shift = {"ahead": 0.0, "behind": 400.0}  # the disparity ahead is 800 x 1 / 5 = 160 pixels
    values = {}
    for name, pixels in shift.items():
        keypoints = rig.project(STANDING)
        # The right camera (+y, whose image x runs to +y) sees a point ahead further left.
        sign = np.sign(keypoints[1, 0, 0] - keypoints[0, 0, 0])
        keypoints[1, :, 0] -= sign * pixels
        detections = Detections.from_keypoints([0, 1], keypoints, np.ones((2, 17)))
        values[name] = epipolar_distance(rig, detections)[0, 1], affinities(rig, detections)[0, 1]
    assert values["ahead"][0] < 1e-6
    assert values["ahead"][1] > 0.95
    # 240 of 1280 pixels beyond where parallel rays vanish, about 187 of 1000, and as much in the other view
    assert values["behind"][0] == pytest.approx(240 * 1000 / 1280, rel=0.15)
    assert values["behind"][1] == 0


def test_slightly_diverging_rays_still_match():
    """Rays to distant people diverge with noise: the distance then grows continuously."""
    rig = Rig([look_at([60, y, 1], [0, y, 1]) for y in (-0.1, 0.1)])
    keypoints = rig.project(STANDING)
    keypoints[0, :, 0] -= 4 * np.sign(keypoints[0, 0, 0] - keypoints[1, 0, 0])  # the disparity is 2.7
    detections = Detections.from_keypoints([0, 1], keypoints, np.ones((2, 17)))
    assert epipolar_distance(rig, detections)[0, 1] < 4
    assert affinities(rig, detections)[0, 1] > 0.9


def test_joints_at_the_epipole_are_left_out():
    """Cameras that face each other: an epipolar line has no defined direction near the epipole."""
    rig = Rig([look_at([5, 0, 1], [0, 0, 1]), look_at([-5, 0, 1], [0, 0, 1])])
    on_axis = np.tile([0.0, 0.0, 1.0], (17, 1)) + np.random.default_rng(0).normal(0, 0.02, (17, 3))
    off_axis = STANDING + [0, 0.8, 0]
    for body, expected in ((on_axis, 0), (off_axis, 1)):
        detections = Detections.from_keypoints([0, 1], rig.project(body), np.ones((2, 17)))
        assert epipolar_distance(rig, detections)[0, 1] < 1e-6
        assert affinities(rig, detections)[0, 1] == pytest.approx(expected, abs=0.05)
    mixed = np.concatenate([on_axis[:4], off_axis[4:]])  # the 13 others decide
    keypoints = rig.project(mixed)
    keypoints[1, :4] += np.random.default_rng(1).normal(0, 8, (4, 2))
    detections = Detections.from_keypoints([0, 1], keypoints, np.ones((2, 17)))
    clean = Detections.from_keypoints([0, 1], rig.project(mixed), np.tile(np.arange(17) >= 4, (2, 1)))
    assert affinities(rig, detections)[0, 1] == pytest.approx(affinities(rig, clean)[0, 1], abs=1e-9)
    exact = Detections.from_keypoints([0, 1], np.full((2, 17, 2), (639.5, 479.5)), np.ones((2, 17)))
    assert affinities(rig, exact, epipole=0.0)[0, 1] == 0  # on the epipole to the last digit: no line at all
    assert epipolar_distance(rig, exact)[0, 1] == np.inf


def test_two_cameras_in_one_point_compare_pixels():
    here = [4.0, 0, 2]
    rig = Rig([look_at(here, [0, 0, 1]), look_at(here, [0.5, 0.5, 1]), look_at([0, 4.0, 2], [0, 0, 1])])
    detections, person = detect(rig, np.array([STANDING, STANDING + [0, 1.2, 0]]))
    pair = (detections.view[:, None] == 0) & (detections.view == 1)
    same, other = pair & (person[:, None] == person), pair & (person[:, None] != person)
    distance, affinity = epipolar_distance(rig, detections), affinities(rig, detections)
    assert distance[same].max() < 1e-6
    assert distance[other].min() > 100
    assert affinity[same].min() > 0.95
    assert affinity[other].max() == 0


@given(st.integers(0, 100_000))
def test_any_detections_give_a_valid_affinity(seed):
    rng = np.random.default_rng(seed)
    size = (1280, 960)
    centers = rng.uniform(-2, 2, (4, 3))
    centers[3] = centers[2]
    rig = Rig([look_at(c, rng.uniform(-1, 1, 3), size=size) for c in centers])
    m = rng.integers(0, 9)
    view = rng.integers(0, 4, m)
    keypoints = rng.choice([1.0, 10.0, 1e6], (m, 17, 1)) * rng.uniform(-300, 900, (m, 17, 2))
    keypoints[rng.random((m, 17)) < 0.2] = rng.choice([np.nan, np.inf])
    detections = Detections.from_keypoints(view, keypoints, rng.choice([0.0, 1e-300, 0.5, 1.0], (m, 17)))
    matrix = affinities(rig, detections, least_joints=1)
    assert matrix.shape == (m, m)
    assert ((matrix >= 0) & (matrix <= 1)).all()
    np.testing.assert_array_equal(matrix, matrix.T)
    assert (matrix[view[:, None] == view] == 0).all()


def test_distances_are_normalised_by_the_width_of_each_view():
    """A 4K camera and one of 360 x 288: distances count as fractions of the width of each picture."""
    people = people_in_a_room(2)
    wide, narrow = rig_around(2), rig_around(2, size=(320, 240))
    mixed = Rig([wide[0], Camera(narrow[1].K, narrow[1].R, narrow[1].t, size=narrow[1].size)])
    detections, _ = noisy(wide, people)
    quarter = np.where(
        (detections.view == 1)[:, None, None], (detections.keypoints + 0.5) / 4 - 0.5, detections.keypoints
    )
    np.testing.assert_allclose(
        affinities(mixed, Detections.from_keypoints(detections.view, quarter, detections.scores)),
        affinities(wide, detections),
        atol=1e-9,
    )
