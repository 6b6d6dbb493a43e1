"""Projection of the truth against OpenCV, and against the method, which must not share its faults."""

from __future__ import annotations

import ast
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import simharness
from mvpose import Camera
from simharness.types.random_streams import stream
from simharness.world.rigs.projection import (
    fold_radius2,
    project_to_image,
    projection_matrix,
    undistorted,
    viewing_rays,
)

SIZE = (640, 480)


def camera_of(seed):
    """Return a camera in any pose, with every term of the lens, within and beyond what real lenses have."""
    rng = stream(seed, "test", "camera")
    terms = rng.uniform(-1, 1, 5) * [0.4, 0.2, 0.01, 0.01, 0.05] * (rng.random(5) < 0.8)
    (fx, fy), cx, cy = rng.uniform(300, 2000, 2), rng.uniform(200, 440), rng.uniform(150, 330)
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Camera(K, cv2.Rodrigues(rng.uniform(-3, 3, 3))[0], rng.uniform(-5, 5, 3), terms, SIZE)


cameras = st.integers(0, 10_000).map(camera_of)


def directions(camera, *, within=0.9):
    """Return directions (x, y, 1) in camera coordinates, (n, 3), short of the fold of the lens."""
    most = min(0.9, within * np.sqrt(fold_radius2(camera.distortion)))
    rng = stream(0, "test", "directions")
    bearing, radius = rng.uniform(0, 2 * np.pi, 100), most * np.sqrt(rng.random(100))
    return np.column_stack([radius * np.cos(bearing), radius * np.sin(bearing), np.ones(100)])


def in_world(camera, local, depth=3.0):
    return (depth * local - camera.t) @ camera.R


def by_opencv(camera, points):
    return cv2.projectPoints(points, cv2.Rodrigues(camera.R)[0], camera.t, camera.K, camera.distortion)[0][:, 0]


@given(camera=cameras)
def test_truth_is_projected_as_by_opencv(camera):
    points = in_world(camera, directions(camera))
    found = project_to_image(camera, points)
    imaged = np.isfinite(found).all(axis=-1)
    assert imaged.mean() > 0.5
    np.testing.assert_allclose(found[imaged], by_opencv(camera, points)[imaged], atol=1e-8)


@given(camera=cameras)
def test_undistortion_inverts_the_projection_of_opencv(camera):
    local = directions(camera)
    points = in_world(camera, local)
    imaged = np.isfinite(project_to_image(camera, points)).all(axis=-1)
    pixels = by_opencv(camera, points)
    straight = local[:, :2] * camera.K[[0, 1], [0, 1]] + camera.K[:2, 2]
    np.testing.assert_allclose(undistorted(camera, pixels)[imaged], straight[imaged], atol=1e-5)
    rays = (points - projection_center(camera))[imaged] / np.linalg.norm(3.0 * local[imaged], axis=-1, keepdims=True)
    np.testing.assert_allclose(viewing_rays(camera, pixels)[imaged], rays, atol=1e-8)


def projection_center(camera):
    return -camera.R.T @ camera.t


@given(camera=cameras)
def test_what_the_lens_does_not_image_is_nan(camera):
    """Beyond the radial fold; and a pixel has at most the direction that is projected to it."""
    fold = fold_radius2(camera.distortion)
    assume(fold < 100)
    beyond = directions(camera)
    beyond[:, :2] *= 1.001 * np.sqrt(fold) / np.linalg.norm(beyond[:, :2], axis=1, keepdims=True)
    assert np.isnan(project_to_image(camera, in_world(camera, beyond))).all()
    pixels = stream(1, "test", "pixels").uniform(-200, 840, (200, 2))
    rays = viewing_rays(camera, pixels)
    seen = np.isfinite(rays).all(axis=-1)
    there = project_to_image(camera, projection_center(camera) + rays[seen])
    np.testing.assert_allclose(there, pixels[seen], atol=1e-5)


def test_a_skewed_camera():
    """OpenCV knows no skew: the projection is that of homogeneous coordinates."""
    K = np.array([[500.0, 20.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]])
    camera = Camera(K, np.eye(3), np.zeros(3), size=SIZE)
    points = np.array([[0.3, -0.2, 2.0], [1.0, 0.5, 3.0]])
    homogeneous = points @ projection_matrix(camera)[:, :3].T
    expected = homogeneous[:, :2] / homogeneous[:, 2:]
    np.testing.assert_allclose(project_to_image(camera, points), expected, atol=1e-10)
    bent = Camera(K, np.eye(3), np.zeros(3), [-0.1, 0.01, 0.001, 0.002, 0.0], SIZE)
    np.testing.assert_allclose(undistorted(bent, project_to_image(bent, points)), expected, atol=1e-6)


@given(camera=cameras)
def test_the_method_agrees_with_the_truth(camera):
    points = in_world(camera, directions(camera))
    true = project_to_image(camera, points)
    imaged = np.isfinite(true).all(axis=-1)
    np.testing.assert_allclose(camera.project(points)[imaged], true[imaged], atol=1e-8)
    rays = (points - projection_center(camera)) / np.linalg.norm(points - projection_center(camera), axis=1)[:, None]
    np.testing.assert_allclose(camera.rays(true)[imaged], rays[imaged], atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["rays", "raster"])
def test_a_simulation_never_asks_the_method_where_a_point_is(monkeypatch, renderer):
    changes = ["duration=0.2", "people.count=3", "cameras.count=3", "cameras.size=[160, 120]", "clutter.boxes=2"]
    changes += [f'rendering.renderer="{renderer}"', "cameras.distortion=[-0.2, 0.05, 0.004, -0.003, 0.0]"]
    scenario = simharness.load_scenario("quickstart", overrides=changes, seed=1)
    before = simharness.simulate(scenario)

    def asked(*arguments, **more):
        raise AssertionError("the simulation uses the projection of the method")

    for name in ("project", "undistort", "rays"):
        monkeypatch.setattr(Camera, name, asked)
    for after, detections in zip(simharness.simulate(scenario).detections, before.detections, strict=True):
        np.testing.assert_array_equal(after.keypoints, detections.keypoints)
    assert sum(map(len, before.detections)) > 0


@pytest.mark.slow
def test_the_simulation_does_not_use_the_projection_of_the_method():
    """World, capture and detector take numbers from cameras; what these compute would share the method's faults."""
    folder = Path(simharness.__file__).parent
    forbidden = {"project", "undistort", "rays", "P", "F", "packed"}
    seen = []
    for file in sorted(each for part in ("world", "capture", "detector") for each in (folder / part).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and node.attr in forbidden:
                seen.append(f"{file.relative_to(folder)}: {ast.unparse(node)}")
            if isinstance(node, ast.ImportFrom) and node.module in ("mvpose.lens", "mvpose.rays"):
                seen.append(f"{file.relative_to(folder)}: {ast.unparse(node)}")
    assert [each for each in seen if "shadow" not in each] == []
