from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.capture.ray_visibility import CameraArrays
from simharness.types.random_streams import stream
from simharness.world.rigs.layouts import intrinsics, look_at
from simharness.world.rigs.projection import project_to_image

SIZE = (640, 480)


def camera(distortion=(0.0, 0, 0, 0, 0)):
    plain = look_at((3.0, 1, 2), (0, 0, 1), K=intrinsics(80, SIZE), size=SIZE)
    return replace(plain, distortion=np.array(distortion))


@given(distortion=st.sampled_from([(0.0,) * 5, (-0.1, 0.01, 0.001, -0.002, 0.0), (-0.37, 0.15, 0.0, 0.0, 0.0)]))
def test_projection_agrees_with_opencv(distortion):
    eye = camera(distortion)
    points = stream(0, "points").uniform([-1, -1, 0], [1, 1, 2], (200, 3))
    expected, _ = cv2.projectPoints(points, cv2.Rodrigues(eye.R)[0], eye.t, eye.K, eye.distortion)
    np.testing.assert_allclose(project_to_image(eye, points), expected[:, 0], atol=1e-6)


def test_points_behind_or_too_near_are_not_imaged():
    eye = camera()
    forward = eye.R[2]
    points = eye.center + np.array([-1.0, 0.04, 0.06])[:, None] * forward
    assert np.isnan(project_to_image(eye, points, near=0.05)).any(axis=-1).tolist() == [True, True, False]


def test_points_beyond_the_fold_are_not_imaged():
    """With k1 = -0.4 the radius r (1 - 0.4 r²) has its maximum at r = 0.91: points beyond are not imaged."""
    eye = camera((-0.4, 0.0, 0.0, 0.0, 0.0))
    right, _, forward = eye.R
    radius = np.array([0.3, 0.85, 0.97, 1.4])
    points = eye.center + 2 * (forward + radius[:, None] * right)
    folded = eye.project(points)
    assert eye.inside(folded)[2:].any()  # otherwise the test is void
    assert np.isfinite(project_to_image(eye, points)).all(axis=-1).tolist() == [True, True, False, False]


def test_cameras_together_image_the_same_bits_as_one_by_one():
    eyes = [camera(), camera((-0.4, 0.0, 0.0, 0.0, 0.0)), replace(camera(), name="other", size=(200, 100))]
    points = stream(1, "points").uniform([-6, -6, 0], [6, 6, 2], (1, 4, 50, 3))
    points[0, 0, 0] = np.nan
    arrays = CameraArrays.of_cameras(eyes)
    pixels, inside = arrays.pixels_of(points)
    for eye, seen, within in zip(eyes, pixels, inside, strict=True):
        expected = project_to_image(eye, points[0])
        np.testing.assert_array_equal(seen, expected)
        np.testing.assert_array_equal(within, eye.inside(expected))
    assert CameraArrays.of_cameras(eyes, arrays) is arrays
    assert CameraArrays.of_cameras(eyes[::-1], arrays) is not arrays


def test_shapes_are_kept():
    assert project_to_image(camera(), np.zeros((3, 17, 3))).shape == (3, 17, 2)
    assert project_to_image(camera((0.1, 0, 0, 0, 0)), np.zeros((0, 17, 3))).shape == (0, 17, 2)


@pytest.mark.parametrize("where", [(np.nan, 0, 0), (np.inf, 0, 0)])
def test_non_finite_points_are_not_imaged(where):
    assert np.isnan(project_to_image(camera(), where)).all()
