"""Lenses against OpenCV, on lenses of every shape; nothing here is computed by the code under test."""

import cv2
import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from people import ring

from mvpose import Camera, Detections, preset

CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 2000, 1e-14)


def camera_of(seed):
    """Return a camera in any pose with all five terms of the lens, of both signs, none too small to show."""
    rng = np.random.default_rng(seed)
    terms = rng.uniform(0.05, 1.0, 5) * rng.choice([-1.0, 1.0], 5) * [0.4, 0.2, 0.01, 0.01, 0.05]
    (fx, fy), cx, cy = rng.uniform(300, 2000, 2), rng.uniform(200, 440), rng.uniform(150, 330)
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Camera(K, cv2.Rodrigues(rng.uniform(-3, 3, 3))[0], rng.uniform(-5, 5, 3), terms, (640, 480))


cameras = st.integers(0, 2**32 - 1).map(camera_of)


def before_the_fold(camera):
    """Return directions (x, y, 1) in camera coordinates, (n, 3), up to three quarters of the way to any fold."""
    k1, k2, p1, p2, k3 = np.abs(camera.distortion)
    radius = np.linspace(0.0, 0.9, 200)
    # The least that the derivative can be, whatever the signs: no lens folds where it is positive.
    slope = 1 - radius**2 * (3 * k1 + radius**2 * (5 * k2 + radius**2 * 7 * k3)) - 6 * radius * np.hypot(p1, p2)
    most = 0.75 * radius[slope > 0].max()
    rng = np.random.default_rng(0)
    bearing, distance = rng.uniform(0, 2 * np.pi, 50), most * np.sqrt(rng.random(50))
    return np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), np.ones(50)])


def pixels_of(camera, local):
    """Project directions by OpenCV."""
    return cv2.projectPoints(local, np.zeros(3), np.zeros(3), camera.K, camera.distortion)[0][:, 0]


@given(cameras)
def test_projection_is_that_of_opencv(camera):
    points = (3.0 * before_the_fold(camera) - camera.t) @ camera.R
    turn = cv2.Rodrigues(camera.R)[0]
    expected = cv2.projectPoints(points, turn, camera.t, camera.K, camera.distortion)[0][:, 0]
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-8)


@given(cameras)
def test_undistortion_is_that_of_opencv(camera):
    local = before_the_fold(camera)
    pixels = pixels_of(camera, local)
    invert = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # one function from OpenCV 5 on
    expected = invert(pixels[:, None], camera.K, camera.distortion, R=None, P=camera.K, criteria=CRITERIA)[:, 0]
    straight = pixels_of(Camera(camera.K, np.eye(3), np.zeros(3), size=(640, 480)), local)
    converged = np.abs(expected - straight).max(axis=1) < 1e-7  # OpenCV's iteration does not for the strongest lenses
    assume(converged.mean() > 0.8)
    np.testing.assert_allclose(camera.undistort(pixels)[converged], expected[converged], atol=1e-6)
    np.testing.assert_allclose(camera.undistort(pixels), straight, atol=1e-6)


@given(cameras)
def test_rays_are_those_of_opencv(camera):
    local = before_the_fold(camera)
    rays = local / np.linalg.norm(local, axis=1, keepdims=True) @ camera.R
    np.testing.assert_allclose(camera.rays(pixels_of(camera, local)), rays, atol=1e-9)


def test_the_method_places_people_through_lenses_that_opencv_projects():
    lens = np.array([-0.25, 0.08, 0.004, -0.006, 0.0])
    rig = ring(4, distortion=lens)
    joints = np.random.default_rng(1).uniform([-0.4, -0.4, 0.1], [0.4, 0.4, 1.8], (17, 3))
    pixels = [cv2.projectPoints(joints, cv2.Rodrigues(each.R)[0], each.t, each.K, lens)[0][:, 0] for each in rig]
    seen = Detections.from_keypoints(np.arange(4), np.array(pixels), np.ones((4, 17)))
    (found,) = preset("fast").estimate(rig, seen).joints
    np.testing.assert_allclose(found, joints, atol=1e-4)
