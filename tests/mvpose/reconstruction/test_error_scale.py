"""Distribution of joints' errors: variances from residuals, observed information, coverage, widening."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import STANDING, look_at, ring
from scipy.spatial.transform import Rotation

from mvpose import COCO17, Camera, Detections, Estimate, Matching, Rig
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Noise, PictorialStructure, Triangulation
from mvpose.reconstruction.error_scale import PRIOR_FREEDOM, SHARED, fit_variances, observe
from mvpose.reconstruction.likelihood import ANCHOR, accumulate, evaluate_strongest_modes, log_likelihood

SIGMAS = Noise().sigmas(COCO17)
METHODS = [Triangulation(), PictorialStructure()]


def estimate_of(rig, pixels, scores=0.9, *, believed=None, method=None):
    """Estimate of one person who is detected once in each view; ``believed`` are wrong cameras."""
    rig = believed or rig
    scores = np.broadcast_to(scores, pixels.shape[:2])
    rays = viewing_rays(rig, Detections.from_keypoints(np.arange(len(rig)), pixels, scores))
    poses = (method or Triangulation())(rays, np.zeros(len(rays), int), COCO17)
    return Estimate(poses.joints, poses.scores, Matching([]), poses.covariance, freedom=poses.freedom)


def scattered(rig, body, rng, *, scale=1.0, shared=SHARED):
    """Pixels with errors of the model across the rays, times ``scale`` (J,), and of one that all views share."""
    seen = body + shared * SIGMAS[:, None] * rng.standard_normal(body.shape)
    depth = np.linalg.norm(body - rig.centers[:, None], axis=2)
    across = np.broadcast_to(scale, 17) * SIGMAS / 0.9 * 800 / depth
    return rig.project(seen) + rng.standard_normal((len(rig), 17, 2)) * across[..., None]


def turned(rig, degrees, rng):
    """The rig with every camera turned about its centre by normal angles about each axis."""
    cameras = []
    for camera, center in zip(rig, rig.centers, strict=True):
        R = Rotation.from_rotvec(np.radians(degrees) * rng.standard_normal(3)).as_matrix() @ camera.R
        cameras.append(Camera(camera.K, R, -R @ center, camera.distortion, camera.size, camera.name))
    return Rig(cameras)


def size(estimate):
    """Median standard deviation of the joints of an estimate, metres."""
    return np.median(np.sqrt(np.trace(estimate.covariance, axis1=-2, axis2=-1)))


@pytest.mark.parametrize("relative", [0.2, 1.0])
@pytest.mark.parametrize("absolute", [0.0, 0.05**2])
def test_both_variances_are_found_in_the_residuals(relative, absolute):
    """Many views: the misfit over the variance of the model is chi-square times relative + absolute / variance."""
    rng, views, found = np.random.default_rng(0), 40.0, []
    for _ in range(50):
        expected = relative + absolute / SIGMAS**2
        misfit = expected * rng.chisquare(2 * views - 3, 17) * 0.9  # the tail is not seen
        found.append(fit_variances(misfit, np.full(17, views), np.full(17, views), SIGMAS))
    median = np.median(found, axis=0)
    assert median[0] == pytest.approx(relative, rel=0.1)
    assert median[1] == pytest.approx(absolute, rel=0.2, abs=0.008**2)


def test_without_residuals_the_variances_are_those_of_the_model():
    relative, absolute = fit_variances(np.zeros(17), np.zeros(17), np.zeros(17), SIGMAS)
    assert (relative, absolute) == (1.0, 0.0)


@given(st.integers(0, 999))
@settings(max_examples=40, deadline=None)
def test_the_information_is_the_curvature_of_the_log_likelihood(seed):
    """Against finite differences, where no view has a negative curvature: errors below the standard deviation."""
    rng, rig, sigma = np.random.default_rng(seed), ring(5), 0.05
    point = rng.uniform([-1, -1, 0.5], [1, 1, 1.8])
    directions = point + rng.normal(0, 0.01, (5, 3)) - rig.centers
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    view = rig.centers, directions[:, None], rng.uniform(0.4, 1.0, (5, 1)), np.zeros(5)
    information = np.empty((3, 3))
    freedom, share = observe(point, (*view, sigma, 0.1), 1.0, 0.0, information)
    assert freedom == pytest.approx(PRIOR_FREEDOM + 0.9 * 7)
    assert share == 0.0
    step, curvature = 1e-4, np.empty((3, 3))
    for r in range(3):
        for c in range(3):
            values = [
                signs[0] * signs[1] * log_likelihood(
                    point + step * (signs[0] * np.eye(3)[r] + signs[1] * np.eye(3)[c]), *view, sigma, 0.1
                )
                for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1))
            ]  # fmt: skip
            curvature[r, c] = -sum(values) / (4 * step * step)
    # The misfit scales the whole; the anchor adds 1 / m^2.
    scaled = (information - ANCHOR * np.eye(3)) / np.trace(information - ANCHOR * np.eye(3))
    np.testing.assert_allclose(scaled, curvature / np.trace(curvature), atol=2e-3)


@pytest.mark.parametrize("distance", [0.5, 3.0, 12.0])
def test_keypoints_are_as_certain_as_the_joint_and_the_pixel_at_its_distance(distance):
    """Information across a ray is score squared over the sum of both variances, if the keypoint is right."""
    sigma, pixel, score, floor = 0.04, 0.02, 0.8, 0.1
    origins, directions = np.zeros((1, 3)), np.array([[[1.0, 0.0, 0.0]]])
    weights, angle, point = np.array([[score]]), np.array([pixel]), np.array([distance, 0.03, 0.0])
    variance = (sigma**2 + (pixel * distance) ** 2) / score**2
    value = score * np.exp(-0.5 * 0.03**2 / variance)
    right = value / (value + floor)
    A, b = np.zeros((3, 3)), np.zeros(3)
    support, responsibility, misfit = accumulate(point, origins, directions, weights, angle, sigma, floor, 1.0, A, b)
    np.testing.assert_allclose(A, np.diag([0.0, right / variance, right / variance]), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(b, [0.0, -0.03 * right / variance, 0.0], rtol=1e-9, atol=1e-9)
    assert (support, responsibility) == pytest.approx((score * right, right))
    assert misfit == pytest.approx(right * 0.03**2 / variance)
    strongest = evaluate_strongest_modes(point, origins, directions, weights, angle, sigma, floor)
    assert strongest == pytest.approx((support, responsibility, misfit, 0.03**2))
    assert log_likelihood(point, origins, directions, weights, angle, sigma, floor) == pytest.approx(
        np.log(value + floor)
    )


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
def test_errors_of_the_model_have_the_claimed_coverage(share):
    """Scales of joints drawn from the prior, random rigs of 3 to 8 cameras: the hierarchy from which the t follows.

    3400 joints have a standard deviation of 0.9 points at 50 %; persons share their scale, and it is estimated.
    """
    rng, inside = np.random.default_rng(1), []
    for _ in range(200):
        rig, body = ring(int(rng.integers(3, 9))), STANDING + rng.uniform(-0.5, 0.5, 3) * [1, 1, 0]
        # inverse-gamma of mean 1 with the freedom of the prior, times the scale of the person
        scale = np.sqrt(rng.uniform(0.1, 0.3) * (PRIOR_FREEDOM - 2) / rng.chisquare(PRIOR_FREEDOM, 17))
        estimate = estimate_of(rig, scattered(rig, body, rng, scale=np.minimum(scale, 1.0)))
        off = estimate.joints[0] - body
        distance = np.einsum("ji,ji->j", off, np.linalg.solve(estimate.ellipsoids(share)[0], off[..., None])[..., 0])
        inside += (distance <= 1.0).tolist()
    assert np.mean(inside) == pytest.approx(share, abs={0.5: 0.07, 0.9: 0.03, 0.99: 0.01}[share])


@pytest.mark.parametrize("method", METHODS)
def test_the_worse_the_calibration_the_wider(method):
    rng, sizes = np.random.default_rng(2), []
    draws = [(ring(5), rng.integers(1 << 30)) for _ in range(25)]
    for degrees in (0.0, 0.3, 0.6, 1.2):
        widths = []
        for rig, seed in draws:
            own = np.random.default_rng(seed)
            pixels = scattered(rig, STANDING, own, scale=0.4)
            widths.append(size(estimate_of(rig, pixels, believed=turned(rig, degrees, own), method=method)))
        sizes.append(np.median(widths))
    assert (np.diff(sizes) > 0).all()
    assert sizes[-1] > 2 * sizes[0]


@pytest.mark.parametrize("method", METHODS)
def test_one_person_and_two_cameras_are_honestly_uncertain(method):
    """One residual per joint: tails are the heaviest. Coverage holds; half of the errors of calibration are seen."""
    rng, share, widths = np.random.default_rng(3), {}, {}
    for degrees in (0.0, 0.5):
        inside, sizes = [], []
        for _ in range(80):
            rig = Rig([look_at([4, y, 1.6], [0, 0, 1]) for y in (-2.0, 2.0)])
            believed = turned(rig, degrees, rng)
            estimate = estimate_of(rig, scattered(rig, STANDING, rng, scale=0.5), believed=believed, method=method)
            assert (estimate.freedom < PRIOR_FREEDOM + 1).all()
            off = estimate.joints[0] - STANDING
            distance = np.einsum("ji,ji->j", off, np.linalg.solve(estimate.ellipsoids(0.9)[0], off[..., None])[..., 0])
            inside += (distance <= 1.0).tolist()
            sizes.append(size(estimate))
        share[degrees], widths[degrees] = np.mean(inside), np.median(sizes)
    assert 0.85 < share[0.0] < 0.98
    assert share[0.5] > 0.7
    assert widths[0.5] > 1.2 * widths[0.0]


@pytest.mark.parametrize("method", METHODS)
def test_the_covariance_turns_with_the_world(method):
    rng, rig = np.random.default_rng(4), ring(4)
    pixels = scattered(rig, STANDING, rng, scale=0.5)
    turn, shift = Rotation.from_rotvec([0.3, -0.8, 1.9]).as_matrix(), np.array([3.0, -2.0, 0.5])
    cameras = []
    for camera in rig:
        R = camera.R @ turn.T
        cameras.append(Camera(camera.K, R, camera.t - R @ shift, camera.distortion, camera.size, camera.name))
    before, after = estimate_of(rig, pixels, method=method), estimate_of(Rig(cameras), pixels, method=method)
    np.testing.assert_allclose(after.covariance, turn @ before.covariance @ turn.T, rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(after.freedom, before.freedom)


def test_a_view_that_dissents_makes_a_joint_less_certain_than_one_that_does_not_see_it():
    rig, rng = ring(5), np.random.default_rng(5)
    pixels = scattered(rig, STANDING, rng, scale=0.4)
    wrong, scores = pixels.copy(), np.full((5, 17), 0.9)
    wrong[0, 9] += 200
    scores[0, 9] = 0.0
    agreed, dissent, unseen = estimate_of(rig, pixels), estimate_of(rig, wrong), estimate_of(rig, pixels, scores)
    width = [np.trace(each.covariance[0, 9]) for each in (agreed, unseen, dissent)]
    assert width[0] < width[1] < width[2]
    np.testing.assert_allclose(dissent.joints[0, 9], unseen.joints[0, 9], atol=2e-3)


def test_the_shared_error_remains_with_any_number_of_views():
    rig = ring(40)
    estimate = estimate_of(rig, rig.project(STANDING))
    least = np.linalg.eigvalsh(estimate.covariance[0])[:, 0]
    assert (least > (SHARED * SIGMAS) ** 2).all()
    np.testing.assert_allclose(least, (SHARED * SIGMAS) ** 2, rtol=0.6)
