import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import look_at, ring

from mvpose import Camera, Rig

LENSES = [np.zeros(5), [0.115, -0.219, 0.0012, 0.0086, 0.113], [-0.37, 0.15, 0.0, 0.0, 0.0]]


def points_before(camera, count, seed):
    """World points spread over the camera's image at 1 to 8 m."""
    rng = np.random.default_rng(seed)
    pixels = rng.uniform(0, 1, (count, 2)) * np.array(camera.size)
    xy = (pixels - camera.K[:2, 2]) / camera.K[[0, 1], [0, 1]]
    depth = rng.uniform(1, 8, (count, 1))
    return (np.column_stack([xy, np.ones(count)]) * depth - camera.t) @ camera.R


@pytest.mark.parametrize("distortion", LENSES)
def test_projection_agrees_with_opencv(distortion):
    camera = look_at([3, -2, 2.5], [0, 0, 1], distortion=distortion)
    points = points_before(camera, 200, 1)
    expected, _ = cv2.projectPoints(points, cv2.Rodrigues(camera.R)[0], camera.t, camera.K, camera.distortion)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-8)


@pytest.mark.parametrize("distortion", LENSES)
def test_rays_undo_projection(distortion):
    camera = look_at([3, -2, 2.5], [0, 0, 1], distortion=distortion)
    points = points_before(camera, 200, 2)
    rays = camera.rays(camera.project(points))
    offset = points - camera.center
    np.testing.assert_allclose(np.linalg.norm(np.cross(offset, rays), axis=1), 0, atol=1e-8)
    assert ((offset * rays).sum(axis=1) > 0).all()
    pinhole = Camera(camera.K, camera.R, camera.t, size=camera.size)
    np.testing.assert_allclose(camera.undistort(camera.project(points)), pinhole.project(points), atol=1e-6)


def test_world_up_is_image_up_and_right_is_right():
    camera = look_at([4, 0, 1], [0, 0, 1])  # looks along -x, so world +y is on its right
    middle, above, beside = camera.project([[0, 0, 1], [0, 0, 1.5], [0, 0.5, 1]])
    assert above[1] < middle[1]
    assert beside[0] > middle[0]
    np.testing.assert_allclose(middle, camera.K[:2, 2])


def test_points_not_in_front_have_no_pixel():
    camera = look_at([4, 0, 1], [0, 0, 1])
    assert np.isnan(camera.project([[5.0, 0, 1], [4.0, 0, 1]])).all()
    assert camera.depth([[5.0, 0, 1]])[0] == pytest.approx(-1)


def test_image_reaches_half_a_pixel_beyond_the_outer_centres():
    camera = look_at([4, 0, 1], [0, 0, 1], size=(100, 50))
    inside = camera.inside([[-0.5, 0], [-0.51, 0], [99.49, 49.49], [99.5, 0], [np.nan, 0]])
    assert inside.tolist() == [True, False, True, False, False]


@given(st.integers(0, 10_000))
def test_fundamental_matrices_vanish_on_true_points(seed):
    rng = np.random.default_rng(seed)
    centers, targets = rng.uniform([-5, -5, 0.5], [5, 5, 3], (3, 3)), rng.uniform(-0.5, 0.5, (3, 3)) + [0, 0, 1]
    rig = Rig([look_at(center, target) for center, target in zip(centers, targets, strict=True)])
    point = rng.uniform([-0.5, -0.5, 0.5], [0.5, 0.5, 1.5])
    pixels = np.column_stack([rig.project(point), np.ones(3)])
    seen = np.isfinite(pixels).all(axis=1)
    for i in range(3):
        for j in range(3):
            if i == j:
                assert (rig.F[i, j] == 0).all()
            elif seen[i] and seen[j]:
                line = rig.F[i, j] @ pixels[i]
                assert abs(pixels[j] @ line) / np.linalg.norm(line[:2]) < 1e-6


def test_fundamental_matrices_are_not_trivial():
    rig = ring(4)
    line = rig.F[0, 1] @ np.array([300.0, 200.0, 1.0])
    pixel = np.append(rig[1].project([0.0, 0.0, 1.0]), 1.0)
    assert abs(pixel @ line) / np.linalg.norm(line[:2]) > 10  # another point is far from the line


def test_rig_arrays_follow_the_cameras():
    rig = ring(3)
    point = np.array([0.3, -0.2, 1.1, 1.0])
    for view, camera in enumerate(rig):
        homogeneous = rig.P[view] @ point
        np.testing.assert_allclose(homogeneous[:2] / homogeneous[2], camera.project(point[:3]))
        np.testing.assert_allclose(camera.R @ rig.centers[view] + camera.t, 0, atol=1e-12)


def test_bad_calibrations_are_refused():
    good = look_at([4, 0, 1], [0, 0, 1])
    with pytest.raises(ValueError, match="at least 2 cameras"):
        Rig([good])
    with pytest.raises(ValueError, match="one point"):
        Rig([good, good])
    with pytest.raises(ValueError, match="millimetres"):
        Rig([good, look_at([-4000, 0, 1000], [0, 0, 1000])])
    with pytest.raises(ValueError, match=r"K must be \(3, 3\), got \(3, 4\)"):
        Camera(np.eye(3, 4), good.R, good.t, size=(10, 10))
    with pytest.raises(ValueError, match="not a rotation"):
        Camera(good.K, 2 * good.R, good.t, size=(10, 10))
    with pytest.raises(ValueError, match="not finite"):
        Camera(good.K, good.R, [np.nan, 0, 0], size=(10, 10))
    with pytest.raises(ValueError, match="size"):
        Camera(good.K, good.R, good.t)
