import numpy as np
import pytest
from gathering import noisy, people_in_a_room, rig_around
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, crowd, detect, look_at, ring
from scipy.optimize import minimize

from mvpose import Camera, Detections, Rig
from mvpose.affinity import GeometricAffinity, ray_distance, sigmoid
from mvpose.affinity.geometry import misfit
from mvpose.matching import match
from mvpose.rays import Rays, viewing_rays


def two_rays(origin, direction, other_origin, other_direction):
    directions = np.array([[direction], [other_direction]], float)
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return Rays(
        np.array([0, 1]), np.array([origin, other_origin], float), directions, np.ones((2, 1)), np.full(2, 1e-3)
    )


def affinities(rig, detections, affinity=None):
    return (affinity or GeometricAffinity())(rig, detections, viewing_rays(rig, detections))


@given(st.integers(0, 100_000), st.sampled_from([0.0, 0.5, 2.0]))
def test_ray_distance_is_the_least_distance_of_the_half_lines(seed, nearest):
    rng = np.random.default_rng(seed)
    rays = two_rays(*rng.standard_normal((4, 3)))
    (o, p), (u, v) = rays.origins, rays.directions[:, 0]

    def squared(s):
        return float(((o + s[0] * u - p - s[1] * v) ** 2).sum())

    starts = [(nearest, nearest), (nearest + 1, nearest + 1), (nearest + 5, nearest), (nearest, nearest + 5)]
    best = min(minimize(squared, s, bounds=[(nearest, None)] * 2, options={"ftol": 1e-15}).fun for s in starts)
    assert ray_distance(rays, nearest=nearest)[0][0, 1] == pytest.approx(np.sqrt(best), abs=1e-4)


def test_parallel_and_diverging_rays_are_defined():
    assert ray_distance(two_rays([0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 0, 0]))[0][0, 1] == pytest.approx(2)
    # They would meet behind both cameras; in front, they are nearest at the centres.
    assert ray_distance(two_rays([0, 0, 0], [1, -1, 0], [0, 2, 0], [1, 1, 0]))[0][0, 1] == pytest.approx(2)
    # Two cameras that face each other see along one line; back to back they see nothing in common.
    assert ray_distance(two_rays([0, 0, 0], [1, 0, 0], [5, 1, 0], [-1, 0, 0]))[0][0, 1] == pytest.approx(1)
    assert ray_distance(two_rays([5, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0]))[0][0, 1] == pytest.approx(26**0.5)


@given(st.integers(0, 100_000), st.sampled_from([0.0, 1e-12, 1e-9, 1e-7]))
def test_nearly_parallel_rays_are_parallel_ones(seed, angle):
    """Rounding must not make nearly parallel rays cross, in any direction."""
    rng = np.random.default_rng(seed)
    origin, direction, other, aside = rng.standard_normal((4, 3))
    direction /= np.linalg.norm(direction)
    offset = other - origin
    expected = np.linalg.norm(offset - (offset @ direction) * direction)
    rays = two_rays(origin, direction, other, direction + angle * aside)
    assert ray_distance(rays)[0][0, 1] == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("angle", [1e-1, 1e-2, 1e-3, 2e-4])
def test_rays_at_a_small_angle_still_cross(angle):
    """They cross at a distance of a thousand metres."""
    toward = [-np.sin(angle), 0.0, np.cos(angle)]
    assert ray_distance(two_rays([0, 0, 0], [0, 0, 1], [0.3, 0, 0], toward))[0][0, 1] == pytest.approx(0, abs=1e-6)
    away = [np.sin(angle), 0.0, np.cos(angle)]
    assert ray_distance(two_rays([0, 0, 0], [0, 0, 1], [0.3, 0, 0], away))[0][0, 1] == pytest.approx(0.3, abs=1e-6)


def test_true_matches_have_distance_0_and_others_do_not():
    rig, people = ring(5), crowd(4)
    detections, person = detect(rig, people)
    same = (person[:, None] == person) & (detections.view[:, None] != detections.view)
    distance, shared = ray_distance(viewing_rays(rig, detections))
    assert distance[same].max() < 1e-6
    assert (shared[same] == 17).all()
    assert np.isinf(distance[detections.view[:, None] == detections.view]).all()
    assert np.median(distance[(person[:, None] != person) & np.isfinite(distance)]) > 0.1


def test_missing_joints_are_left_out_and_confident_joints_weigh_more():
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


def by_hand(rays, *, midpoint, slope, threshold, saturation, least_joints, nearest, widest):
    """Affinity matrix computed joint by joint: the least distance of two half-lines is interior or on an edge."""
    m, joints = rays.weights.shape
    result, mean = np.zeros((m, m)), np.full((m, m), np.inf)
    for a, b in np.argwhere(rays.view[:, None] < rays.view):
        distances, weights = [], []
        for j in range(joints):
            u, v = rays.directions[a, j], rays.directions[b, j]
            weight = rays.weights[a, j] * rays.weights[b, j]
            if weight == 0:
                continue
            p, q = rays.origins[a] + nearest * u, rays.origins[b] + nearest * v
            s, t = np.linalg.lstsq(np.column_stack([u, -v]), q - p, rcond=None)[0]
            candidates = [(s, t)] if min(s, t) >= 0 else []
            candidates += [(0, max((p - q) @ v, 0)), (max((q - p) @ u, 0), 0)]
            nearby = min(np.linalg.norm(p + s * u - q - t * v) for s, t in candidates)
            distances.append(min(nearby, saturation))
            weights.append(weight)
        if len(weights) >= least_joints and (distance := np.average(distances, weights=weights)) <= widest * threshold:
            mean[a, b] = mean[b, a] = distance
    sure = mutually_nearest(rays.view, mean)
    factor = np.clip(sorted(sure)[int(0.35 * len(sure))] / 0.05, 1, widest) if len(sure) >= 12 else 1.0
    near = mean <= factor * threshold
    result[near] = 1 / (1 + np.exp((mean[near] / factor - midpoint) / slope))
    return result


def mutually_nearest(view, distance):
    """Distances of mutual nearest neighbours in pairs of views."""
    found = []
    for a, b in np.argwhere(np.isfinite(distance) & (view[:, None] < view)):
        if distance[a, b] == min(distance[a, view == view[b]].min(), distance[view == view[a], b].min()):
            found.append(distance[a, b])
    return found


@pytest.mark.parametrize("seed", range(4))
def test_the_kernel_agrees_with_the_definition(seed):
    rig = rig_around(4, seed=seed)
    detections, _ = noisy(rig, people_in_a_room(3, half=1.0, seed=seed), seed=seed, pixels=15, missed=0.5)
    rng = np.random.default_rng(seed)
    parameters = dict(
        midpoint=rng.uniform(0.1, 0.3),
        slope=rng.uniform(0.02, 0.1),
        threshold=rng.uniform(0.2, 0.4),
        saturation=rng.uniform(0.4, 0.8),
        least_joints=int(rng.integers(3, 6)),
        nearest=rng.uniform(0.0, 5.0),
        widest=rng.uniform(1.0, 3.0),
    )
    rays = viewing_rays(rig, detections)
    found = GeometricAffinity(**parameters)(rig, detections, rays)
    assert 0.1 < (found > 0).mean() < 0.7  # there is something of everything
    np.testing.assert_allclose(found, by_hand(rays, **parameters), atol=1e-9)


@given(st.integers(0, 100_000))
def test_misfit_is_a_quantile_of_mutual_nearest_distances(seed):
    rng = np.random.default_rng(seed)
    view = rng.permutation(np.repeat(np.arange(4), rng.integers(0, 5, 4)))
    distance = rng.choice([np.inf, 1.0], (len(view), len(view)), p=[0.2, 0.8]) * rng.random((len(view), len(view)))
    distance = np.minimum(distance, distance.T)
    distance[view[:, None] == view] = np.inf
    sure = sorted(mutually_nearest(view, distance))
    assert misfit(view, distance) == (sure[int(0.35 * len(sure))] if len(sure) >= 12 else 0.0)


def shifted(rig, metres, seed=0):
    """Believed rig with errors in all cameras."""
    rng = np.random.default_rng(seed)
    moved = []
    for camera in rig:
        aside = rng.standard_normal(3)
        center = camera.center + metres * aside / np.linalg.norm(aside)
        moved.append(Camera(camera.K, camera.R, -camera.R @ center, camera.distortion, camera.size, camera.name))
    return Rig(moved)


def test_the_default_scale_adapts_to_a_wrong_calibration():
    """Calibration errors of 20 cm: precision and recall of matched pairs are better than at a fixed scale."""
    rig, scales = ring(5), {"fixed": GeometricAffinity(widest=1.0), "default": GeometricAffinity()}
    found = {name: [] for name in scales}
    for seed in range(10):
        detections, person = detect(rig, crowd(4, spacing=1.2, seed=seed), noise=2.0, seed=seed)
        first, second = np.triu_indices(len(person), 1)
        true = person[first] == person[second]
        for name, f1 in found.items():
            affinity = affinities(shifted(rig, 0.2, seed), detections, scales[name])
            labels = match(affinity, detections.view).labels
            made = (labels[first] == labels[second]) & (labels[first] >= 0)
            f1.append(2 * (made & true).sum() / (made.sum() + true.sum()))
    assert np.mean(found["default"]) > np.mean(found["fixed"]) + 0.08
    assert np.mean(found["default"]) > 0.85


@pytest.mark.parametrize("count", [1, 4])
def test_a_correct_rig_keeps_the_fixed_scale(count):
    """Phantoms are a minority of the mutual nearest neighbours, or too few pairs remain."""
    rig = ring(5)
    detections, _ = detect(rig, crowd(count, spacing=1.2), noise=3.0)
    rng = np.random.default_rng(1)
    ghosts = Detections.from_keypoints(
        np.arange(5), rng.uniform(0, 900, (5, 1, 2)) + rng.uniform(0, 200, (5, 17, 2)), np.full((5, 17), 0.5)
    )
    both = Detections.from_keypoints(
        np.concatenate([detections.view, ghosts.view]),
        np.concatenate([detections.keypoints, ghosts.keypoints]),
        np.concatenate([detections.scores, ghosts.scores]),
    )
    for each in (detections, both):
        fixed = affinities(rig, each, GeometricAffinity(widest=1.0))
        np.testing.assert_allclose(affinities(rig, each), fixed, atol=1e-12)


@pytest.mark.parametrize("widest", [0.9, np.inf, np.nan])
def test_an_invalid_scale_is_refused(widest):
    with pytest.raises(ValueError, match="widest of the geometric affinity must be at least 1"):
        GeometricAffinity(widest=widest)


def test_ray_affinity_does_not_depend_on_resolution():
    people = crowd(3)
    matrices = []
    for scale in (0.25, 1.0, 4.0):
        rig = ring(4)
        cameras = [
            Camera(np.diag([scale, scale, 1]) @ c.K, c.R, c.t, size=(int(c.size[0] * scale), int(c.size[1] * scale)))
            for c in rig
        ]
        detections, _ = detect(Rig(cameras), people, noise=3.0 * scale)
        matrices.append(affinities(Rig(cameras), detections))
    np.testing.assert_allclose(matrices[0], matrices[1], atol=1e-9)
    np.testing.assert_allclose(matrices[2], matrices[1], atol=1e-9)


def test_pairs_of_one_view_and_distant_pairs_have_affinity_0():
    rig = ring(4)
    detections, person = detect(rig, crowd(3, spacing=1.5), noise=2.0)
    affinity = affinities(rig, detections)
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


def test_one_wrong_limb_does_not_separate_a_pair():
    rig = ring(2)
    pixels = rig.project(STANDING)
    pixels[1, [7, 9]] += 2000  # an arm far off the picture
    detections = Detections.from_keypoints([0, 1], pixels, np.ones((2, 17)))
    assert affinities(rig, detections)[0, 1] > 0.9
    assert affinities(rig, detections, GeometricAffinity(saturation=np.inf))[0, 1] < 0.5


@pytest.mark.parametrize("common", [0, 2, 3])
def test_poses_with_too_few_joints_in_common_are_not_compared(common):
    rig = ring(2)
    scores = np.ones((2, 17))
    scores[0, common:] = 0
    detections = Detections.from_keypoints([0, 1], rig.project(STANDING), scores)
    assert (affinities(rig, detections)[0, 1] > 0.9) == (common >= 3)
    assert affinities(rig, detections, GeometricAffinity(least_joints=0))[0, 1] > (0.9 if common else -1)


def test_two_cameras_in_one_point_still_separate_directions():
    """Rays start in front of the lens: from one point, people a metre apart differ and one person does not."""
    here = [4.0, 0, 2]
    rig = Rig([look_at(here, [0, 0, 1]), look_at(here, [0.5, 0.5, 1]), look_at([0, 4.0, 2], [0, 0, 1])])
    people = np.array([STANDING, STANDING + [0, 1.2, 0]])
    detections, person = detect(rig, people)
    for affinity, floor in ((GeometricAffinity(), 0.3), (GeometricAffinity(nearest=0.0), 0.0)):
        matrix = affinities(rig, detections, affinity)
        pair = (detections.view[:, None] == 0) & (detections.view == 1)
        same, other = matrix[pair & (person[:, None] == person)], matrix[pair & (person[:, None] != person)]
        assert same.min() > 0.95
        assert (same.min() - other.max() > floor) == (affinity.nearest > 0)


@given(st.integers(0, 100_000))
def test_any_detections_give_a_valid_affinity(seed):
    """The affinity is symmetric, 0 to 1, and 0 within a view for any detections; invalid joints count as missing."""
    rng = np.random.default_rng(seed)
    rig = rig_around(4, seed=seed)
    m = rng.integers(0, 9)
    view = rng.integers(0, 4, m)
    keypoints = rng.choice([1.0, 10.0, 1e6], (m, 17, 1)) * rng.uniform(-300, 900, (m, 17, 2))
    keypoints[rng.random((m, 17)) < 0.2] = rng.choice([np.nan, np.inf])
    detections = Detections.from_keypoints(view, keypoints, rng.choice([0.0, 1e-300, 0.5, 1.0], (m, 17)))
    matrix = affinities(rig, detections)
    assert matrix.shape == (m, m)
    assert ((matrix >= 0) & (matrix <= 1)).all()
    np.testing.assert_array_equal(matrix, matrix.T)
    assert (matrix[view[:, None] == view] == 0).all()


def test_a_ray_without_a_direction_is_a_missing_joint():
    rig = ring(3)
    rays = viewing_rays(rig, detect(rig, crowd(2))[0])
    expected = ray_distance(
        Rays(rays.view, rays.origins, rays.directions, rays.weights * (np.arange(17) > 1), rays.pixel)
    )
    directions = rays.directions.copy()
    directions[:, 0], directions[:, 1] = 0.0, np.nan
    found = ray_distance(Rays(rays.view, rays.origins, directions, rays.weights, rays.pixel))
    np.testing.assert_array_equal(found, expected)
