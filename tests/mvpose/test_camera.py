import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import look_at, ring

from mvpose import Camera, Rig

LENSES = [np.zeros(5), [0.115, -0.219, 0.0012, 0.0086, 0.113], [-0.37, 0.15, 0.0, 0.0, 0.0]]


def points_before(camera, count, seed):
    """World points spread over the image of the camera at 1 to 8 m."""
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
def test_rays_invert_projection(distortion):
    camera = look_at([3, -2, 2.5], [0, 0, 1], distortion=distortion)
    points = points_before(camera, 200, 2)
    rays = camera.rays(camera.project(points))
    offset = points - camera.center
    np.testing.assert_allclose(np.linalg.norm(np.cross(offset, rays), axis=1), 0, atol=1e-8)
    assert ((offset * rays).sum(axis=1) > 0).all()
    pinhole = Camera(camera.K, camera.R, camera.t, size=camera.size)
    np.testing.assert_allclose(camera.undistort(camera.project(points)), pinhole.project(points), atol=1e-6)


def straight_to_the_centre(camera, xy, *, slack=0.0):
    """Return whether the lens does not fold between its centre and normalised points (n, 2)."""
    k1, k2, p1, p2, k3 = camera.distortion
    x, y = (np.linspace(0, 1, 500)[:, None] * axis for axis in np.moveaxis(xy, -1, 0))
    r2 = x * x + y * y
    radial, slope = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 2 * k1 + r2 * (4 * k2 + 6 * r2 * k3)
    xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
    xy = x * y * slope + 2 * p1 * x + 2 * p2 * y
    return ((xx * yy - xy * xy > -slack) & (xx + yy > 0)).all(axis=0)


@given(st.integers(0, 10_000))
def test_undistortion_is_exact_inside_the_fold_and_nan_outside(seed):
    """Includes lenses much stronger than real ones, and points far outside any image."""
    rng = np.random.default_rng(seed)
    terms = rng.normal(size=5) * [0.3, 0.2, 0.003, 0.003, 0.1] * (rng.random(5) < 0.8)
    camera = Camera(np.eye(3), np.eye(3), np.zeros(3), terms, (2, 2))
    bearing, radius = rng.uniform(0, 2 * np.pi, 100), rng.uniform(0, 1.2, 100)
    xy = np.column_stack([radius * np.cos(bearing), radius * np.sin(bearing)])
    xy = xy[straight_to_the_centre(camera, xy)]
    there = camera.project(np.column_stack([xy, np.ones(len(xy))]))
    np.testing.assert_allclose(camera.undistort(there), xy, atol=1e-7)
    found = camera.undistort(rng.uniform(-1.5, 1.5, (100, 2)))
    found = found[np.isfinite(found).all(axis=1)]
    assert straight_to_the_centre(camera, found, slack=0.01).all()


@pytest.mark.parametrize("distortion", LENSES)
def test_pixels_beyond_the_lens_have_no_ray_and_do_not_affect_others(distortion):
    camera = look_at([3, -2, 2.5], [0, 0, 1], distortion=distortion)
    points = points_before(camera, 50, 3)
    pixels = camera.project(points)
    wild = [[np.nan, 5], [np.inf, 5], [5, -np.inf], [1e300, 1e300], [-1e308, 3], [1e12, 0]]
    mixed = camera.rays(np.concatenate([wild, pixels]))
    assert np.isnan(mixed[: len(wild)]).all()
    np.testing.assert_array_equal(mixed[len(wild) :], camera.rays(pixels))
    assert np.isnan(camera.undistort(wild)).all()
    far = camera.rays([1e6, 0.0])
    assert np.isfinite(far).all() == (not np.any(distortion))  # a pinhole images every direction before it


def test_points_at_infinity_have_no_pixel():
    camera = look_at([3, -2, 2.5], [0, 0, 1], distortion=LENSES[1])
    points = [[np.inf, 0, 0], [np.nan, 0, 0], [1e308, -1e308, 1e308], [-1.7e308, 1.7e308, -1.7e308]]
    assert not np.isfinite(camera.project(points)).any()
    assert camera.depth(points).shape == (4,)


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
    rig = ring(3, distortion=LENSES[1])
    point = np.array([0.3, -0.2, 1.1, 1.0])
    for view, camera in enumerate(rig):
        homogeneous = rig.P[view] @ point
        np.testing.assert_allclose(camera.undistort(camera.project(point[:3])), homogeneous[:2] / homogeneous[2])
        np.testing.assert_allclose(camera.R @ rig.centers[view] + camera.t, 0, atol=1e-12)
        fx, skew, cx, fy, cy, *rest = rig.packed[view]
        np.testing.assert_array_equal([[fx, skew, cx], [0, fy, cy], [0, 0, 1]], camera.K)
        np.testing.assert_array_equal(rest, [*camera.R.ravel(), *rig.centers[view], *camera.distortion])
    assert rig.packed.shape == (3, 22)
    assert rig.packed.flags.c_contiguous


GOOD = look_at([4, 0, 1], [0, 0, 1])
SKEWED = [[800, 3, 1e7], [0, 780, -1e7], [0, 0, 1]]  # odd, but a camera

# What is wrong, and what the message says of it.
BAD_CAMERAS = {
    "K of another shape": ({"K": np.eye(3, 4)}, r"K must be \(3, 3\), got \(3, 4\)"),
    "K in words": ({"K": [["a"] * 3] * 3}, r"K must be numbers of shape \(3, 3\): got values of type"),
    "K not finite": ({"K": [[np.nan, 0, 5], [0, 9, 5], [0, 0, 1]]}, "K has values that are not finite"),
    "K transposed": ({"K": GOOD.K.T}, r"K is transposed, .*: pass K\.T"),
    "K scaled": ({"K": 2 * GOOD.K}, r"K\[2, 2\] must be 1, .*: divide K by 2"),
    "K singular": ({"K": np.diag([800.0, 800, 0])}, "the last row of K must be 0 0 1"),
    "K projective": ({"K": GOOD.K + [[0, 0, 0], [0, 0, 0], [0.1, 0, 0]]}, "the last row of K must be 0 0 1"),
    "K with a lower skew": ({"K": GOOD.K + [[0, 0, 0], [2, 0, 0], [0, 0, 0]]}, r"K\[1, 0\] must be 0.*in K\[0, 1\]"),
    "focal length zero": ({"K": [[0, 0, 5], [0, 9, 5], [0, 0, 1]]}, "focal lengths must be positive, got 0 and 9"),
    "focal length flipped": (
        {"K": [[9, 0, 5], [0, -9, 5], [0, 0, 1]]},
        "positive, got 9 and -9; put a flipped image axis",
    ),
    "R scaled": ({"R": 2 * GOOD.R}, "R is not a rotation .* rows of unit length"),
    "R sheared": ({"R": GOOD.R + [[0, 0.01, 0], [0, 0, 0], [0, 0, 0]]}, "R is not a rotation"),
    "R zero": ({"R": np.zeros((3, 3))}, "R is not a rotation"),
    "R huge": ({"R": np.full((3, 3), 1e300)}, "R is not a rotation"),
    "R mirrored": ({"R": -GOOD.R}, "a reflection .*: flip one"),
    "R as a vector": ({"R": [0.1, 0.2, 0.3]}, r"R must be \(3, 3\), got \(3,\)"),
    "t a column": ({"t": GOOD.t[:, None]}, r"t must be \(3,\), got \(3, 1\)"),
    "t not finite": ({"t": [np.nan, 0, 0]}, "t has values that are not finite"),
    "four terms": ({"distortion": np.zeros(4)}, r"distortion \(k1 k2 p1 p2 k3, .*\) must be \(5,\), got \(4,\)"),
    "distortion not finite": ({"distortion": [0, 0, np.inf, 0, 0]}, "distortion has values that are not finite"),
    "no size": ({"size": (0, 0)}, r"size must be the image's width and height, .* got \(0, 0\)"),
    "half a pixel": ({"size": (640.5, 480)}, r"size \(width, height\) must be numbers .* got 640\.5"),
    "one size": ({"size": 640}, r"size \(width, height\) must be \(2,\), got \(\)"),
    "size of a colour image": ({"size": (480, 640, 3)}, r"size \(width, height\) must be \(2,\), got \(3,\)"),
}


@pytest.mark.parametrize("name", BAD_CAMERAS)
def test_an_invalid_calibration_is_refused(name):
    changes, message = BAD_CAMERAS[name]
    fields = {"K": GOOD.K, "R": GOOD.R, "t": GOOD.t, "size": (640, 480), **changes}
    with pytest.raises(ValueError, match=message) as error:
        Camera(**fields, name="left")
    assert "camera 'left'" in str(error.value)


def test_unusual_calibrations_are_accepted():
    for K in (SKEWED, GOOD.K.astype(np.float32), GOOD.K + 1e-9, np.asfortranarray(GOOD.K)):
        camera = Camera(K, np.round(GOOD.R, 5), GOOD.t, size=np.array([640.0, 480.0]))
        assert camera.size == (640, 480)
        assert camera.K.flags.c_contiguous
    camera = Camera(SKEWED, GOOD.R, GOOD.t, LENSES[1], size=(640, 480))
    points = points_before(GOOD, 50, 0)
    rays = camera.rays(camera.project(points))
    np.testing.assert_allclose(np.linalg.norm(np.cross(points - camera.center, rays), axis=1), 0, atol=1e-6)


def test_invalid_rigs_are_refused():
    elsewhere = look_at([-4, 0, 1], [0, 0, 1])
    turned = Camera(GOOD.K, elsewhere.R, -elsewhere.R @ GOOD.center, size=(640, 480))
    with pytest.raises(ValueError, match="at least 2 cameras to triangulate, got 1"):
        Rig([GOOD])
    with pytest.raises(ValueError, match="all 3 cameras of the rig stand in one point"):
        Rig([GOOD, GOOD, turned])
    with pytest.raises(ValueError, match=r"stand up to 4004 apart, .* in millimetres"):
        Rig([GOOD, look_at([-4000, 0, 1000], [0, 0, 1000])])
    with pytest.raises(ValueError, match=r"stand within 8 mm, .* probably in kilometres"):
        Rig([look_at([0.004, 0, 1], [0, 9, 1]), look_at([-0.004, 0, 1], [0, 9, 1])])
    with pytest.raises(ValueError, match="cannot be metres"):
        Rig([GOOD, Camera(GOOD.K, GOOD.R, [1e9, -1e9, 1e9], size=(640, 480))])
    with pytest.raises(ValueError, match=r"t must have values of at most 1e\+09, got 1.7e\+308"):
        Camera(GOOD.K, GOOD.R, [1.7e308, -1.7e308, 1.7e308], size=(640, 480))
    with pytest.raises(ValueError, match=r"entry 1 is ndarray; pass mvpose\.Camera"):
        Rig([GOOD, GOOD.P])
    with pytest.raises(ValueError, match="sequence of cameras, got Camera"):
        Rig(GOOD)


def test_some_cameras_of_a_rig_may_stand_in_one_point():
    other = look_at([0, 4, 1], [0, 0, 1])
    twin = Camera(GOOD.K, GOOD.R, GOOD.t + 1e-13, size=GOOD.size)
    rig = Rig([GOOD, twin, other])
    assert (rig.F[0, 1] == 0).all()
    assert (rig.F[0, 2] != 0).any()


@pytest.mark.parametrize("method", ["project", "depth", "undistort", "rays", "inside"])
def test_arrays_of_another_shape_are_refused(method):
    size = 3 if method in ("project", "depth") else 2
    with pytest.raises(ValueError, match=rf"must be \(\.\.\., {size}\), got \(7, 4\)"):
        getattr(GOOD, method)(np.zeros((7, 4)))
    with pytest.raises(ValueError, match=rf"must be \(\.\.\., {size}\), got \(\)"):
        getattr(GOOD, method)(5.0)
    assert len(getattr(GOOD, method)(np.zeros((0, size)))) == 0
