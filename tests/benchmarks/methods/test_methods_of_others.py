"""Methods of others: exact on exact detections, nothing from nothing, and what each claims."""

from importlib import import_module

import numpy as np
import pytest
from scipy.optimize import least_squares

import simharness
from benchmarks.method.scenes import Conditions, film, ring
from benchmarks.methods.points import nearest_point, pixel_error, ray_distance
from benchmarks.methods.voxels import SAME, peaks
from mvpose import COCO17, Detections, Rig
from mvpose.rays import viewing_rays
from simharness.trial.run_trial import run_trial

EXACT = Conditions(noise=0.0, joints_missing=0.0, people_missed=0.0)
NOISY = Conditions(noise=4.0, joints_missing=0.0, people_missed=0.0)
WRITTEN = ("dong2019", "ransac", "voxels", "pairwise", "limbs")
PACKAGES = {"pose2sim": "Pose2Sim", "anipose": "aniposelib"}


@pytest.fixture(params=[*WRITTEN, *PACKAGES])
def method(request):
    if request.param in PACKAGES:
        pytest.importorskip(PACKAGES[request.param])
    estimator = import_module(f"benchmarks.methods.{request.param}").estimator
    return estimator() if isinstance(estimator, type) else estimator


def written(name):
    return import_module(f"benchmarks.methods.{name}").estimator


def in_order(people):
    """Return people (n, J, 3) in an order that only their places decide."""
    return people[np.argsort(np.nanmean(people, axis=1)[:, 0])] if len(people) else people


def changed(detections, keypoints):
    return Detections.from_keypoints(detections.view, keypoints, detections.scores)


def test_exact_detections_give_exact_joints_and_people(method):
    for seed in range(3):
        scene = film(ring(4, 2), 2, seed=seed, conditions=EXACT)
        estimate = method.estimate(scene.rig, scene.detections)
        np.testing.assert_allclose(in_order(estimate.joints), in_order(scene.joints), atol=2e-3)
        labels = estimate.matching.labels_of(len(scene.detections))
        assert ((labels[:, None] == labels) == (scene.person[:, None] == scene.person)).all()
        assert (labels >= 0).all()


def test_frames_without_two_views_have_nobody(method):
    scene = film(ring(4, 2), 2, conditions=EXACT)
    assert len(method.estimate(scene.rig, Detections.empty())) == 0
    alone = scene.detections.select(scene.detections.view == 2)
    assert len(method.estimate(scene.rig, alone)) == 0
    blank = Detections.from_keypoints(alone.view, alone.keypoints, np.zeros_like(alone.scores))
    assert len(method.estimate(scene.rig, blank)) == 0


def test_a_camera_that_sees_nobody_changes_nothing(method):
    scene = film(ring(5, 3), 3, conditions=NOISY)
    seen = scene.detections.select(scene.detections.view != 4)
    without = method.estimate(Rig(scene.rig.cameras[:4]), seen)
    np.testing.assert_allclose(method.estimate(scene.rig, seen).joints, without.joints, atol=1e-9)


def test_the_order_of_detections_does_not_matter(method):
    scene = film(ring(5, 3), 3, conditions=NOISY)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(scene.detections))
        mixed = method.estimate(scene.rig, scene.detections.select(order))
        given = method.estimate(scene.rig, scene.detections)
        np.testing.assert_allclose(in_order(mixed.joints), in_order(given.joints), atol=1e-3)


@pytest.mark.parametrize("name", ["dong2019", "voxels", "pairwise", "limbs"])
def test_the_order_of_cameras_does_not_matter_but_to_the_baseline(name):
    scene = film(ring(5, 3), 3, conditions=NOISY)
    order = np.array([3, 0, 4, 2, 1])
    rig = Rig([scene.rig[view] for view in order])
    detections = scene.detections
    moved = Detections.from_keypoints(np.argsort(order)[detections.view], detections.keypoints, detections.scores)
    estimates = [written(name).estimate(scene.rig, detections), written(name).estimate(rig, moved)]
    np.testing.assert_allclose(*(in_order(each.joints) for each in estimates), atol=1e-3)


@pytest.mark.parametrize("name", ["ransac", "voxels", "pairwise"])
def test_one_wrong_keypoint_is_left_out(name):
    scene = film(ring(5, 1), 1, conditions=EXACT)
    wrist = COCO17.index("left_wrist")
    keypoints = scene.detections.keypoints.copy()
    keypoints[1, wrist] += [120.0, -90.0]
    estimate = written(name).estimate(scene.rig, changed(scene.detections, keypoints))
    assert np.linalg.norm(estimate.joints[0, wrist] - scene.joints[0, wrist]) < 5e-3


def test_a_limb_far_from_the_rays_of_others_is_another_persons():
    scene = film(ring(5, 1), 1, conditions=EXACT)
    keypoints = scene.detections.keypoints.copy()
    keypoints[1] += [300.0, 0.0]  # the pose of one view is somewhere else as a whole
    estimate = written("limbs").estimate(scene.rig, changed(scene.detections, keypoints))
    np.testing.assert_allclose(estimate.joints, scene.joints, atol=1e-6)
    assert estimate.matching.labels[1] == -1


@pytest.mark.parametrize("people", [1, 3])
def test_peaks_of_a_joint_are_apart_and_as_high_as_the_scores_of_keypoints(people):
    scene = film(ring(5, people), people, conditions=EXACT)
    joint, places, heights, supports = peaks(scene.rig, scene.detections)
    for j in range(len(COCO17)):
        of_joint = places[joint == j]
        apart = np.linalg.norm(of_joint[:, None] - of_joint, axis=2) + np.eye(len(of_joint))
        assert apart.min() >= SAME
        if people == 1:
            np.testing.assert_allclose(of_joint, scene.joints[:, j], atol=1e-4)
            np.testing.assert_allclose(heights[joint == j], scene.detections.scores[:, j].mean(), rtol=1e-3)
    assert ((supports > 0).sum(axis=1) >= 2).all()
    assert (supports <= scene.detections.scores[:, joint].T + 1e-12).all()


@pytest.mark.slow
def test_an_easy_scene_is_solved():
    overrides = [f'method.estimators.{name}="benchmarks.methods.{name}:estimator"' for name in WRITTEN]
    overrides += [
        f"variants={list(WRITTEN)}".replace("'", '"'),
        "clutter.boxes=0",
        "clutter.shelves=0",
        "duration=1.0",
        "rate=5.0",
        'rendering.renderer="rays"',
        'detector.profile="excellent"',
    ]
    results = run_trial(simharness.load_scenario("quickstart", overrides=overrides, seed=910), until="classify").results
    for name in WRITTEN:
        assert results[name].scores["pcp"] >= 97, name
        assert results[name].scores["recall"] == 100, name


def test_points_minimise_residuals_in_pictures():
    scene = film(ring(4, 1), 1, conditions=NOISY)
    rays = viewing_rays(scene.rig, scene.detections)
    for j in range(len(COCO17)):
        point = np.empty(3)
        assert nearest_point(rays.origins, rays.directions[:, j], np.ones(4), point)
        errors = [pixel_error(rays.origins[d], rays.directions[d, j], rays.pixel[d], point) for d in range(4)]

        def residuals(at, j=j):
            pixels = np.stack([scene.rig[view].project(at) for view in scene.detections.view])
            return (pixels - scene.detections.keypoints[:, j]).ravel()

        best = least_squares(residuals, point).x
        assert np.linalg.norm(best - point) < 5e-3
        shown = np.linalg.norm(residuals(point).reshape(-1, 2), axis=1)
        np.testing.assert_allclose(errors, shown, rtol=0.3, atol=0.3)  # of pixels at the image centre


def test_distances_of_rays_are_those_of_their_nearest_points():
    rng = np.random.default_rng(0)
    for _ in range(50):
        (a, b), (u, v) = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
        u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
        (s, t), *_ = np.linalg.lstsq(np.stack([u, -v], axis=1), b - a, rcond=None)
        assert ray_distance(a, u, b, v) == pytest.approx(np.linalg.norm(a + s * u - b - t * v), abs=1e-9)
        assert ray_distance(a, u, b, u) == pytest.approx(np.linalg.norm(np.cross(b - a, u)))


def test_rays_without_a_crossing_give_no_point():
    along = np.array([0.0, 0.0, 1.0])
    origins, directions = np.array([[0.0, 0, 0], [1, 0, 0]]), np.stack([along, along])
    assert not nearest_point(origins, directions, np.ones(2), np.empty(3))
    assert not nearest_point(origins, directions, np.zeros(2), np.empty(3))
    assert pixel_error(origins[0], along, 1e-3, np.array([0.0, 0.0, -1.0])) > 1e8
