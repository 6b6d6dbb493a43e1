"""Bundle adjustment: derivatives, an oracle, recovery of known errors, and what the prior decides."""

import numpy as np
import pytest
from moving_people import disturbed, film, walk
from people import ring
from scipy.optimize import least_squares

from mvpose import Rig
from mvpose.calibration.adjustment import Prior, adjust
from mvpose.calibration.bundle import FLOOR, changed, difference, observations, reduce
from mvpose.calibration.sightings import Sightings, gather
from mvpose.skeleton import COCO17

BENT = [-0.12, 0.02, 0.001, -0.001, 0.0]


def sightings_of_points(rig, points, *, noise=1.0, sigma=4.0, seed=0, velocity=0.0):
    """Points (n, 3), each a joint of a person of its own, seen by all views of a rig."""
    rng = np.random.default_rng(seed)
    pixels = rig.project(points)
    view, point = (each.ravel() for each in np.indices(pixels.shape[:2]))
    count = len(view)
    return Sightings(
        np.zeros(count, int),
        view,
        point,
        np.zeros(count, int),
        pixels[view, point] + noise * rng.standard_normal((count, 2)),
        np.full(count, sigma),
        np.zeros((1, len(rig))),
        COCO17,
        velocity * rng.standard_normal((count, 2)),
    )


def clouds(count=40, seed=0):
    return np.random.default_rng(seed).uniform([-1.5, -1.5, 0.1], [1.5, 1.5, 1.8], (count, 3))


def test_changes_of_cameras_are_found_again():
    rng = np.random.default_rng(0)
    camera = ring(3, distortion=BENT)[1]
    change = rng.normal(size=10) * [0.1, 0.1, 0.1, 0.3, 0.3, 0.3, 0.0, 0.05, 9, 9]
    np.testing.assert_allclose(difference(camera, changed(camera, change)), change, atol=1e-9)


@pytest.mark.parametrize("distortion", [None, BENT])
def test_gradients_are_the_slopes_of_the_likelihood(distortion):
    """All ten parameters of all cameras, against central differences of the cost with every joint solved for again."""
    rig = ring(3, distortion=distortion)
    off = disturbed(rig, 0.3, 0.01)
    seen = observations(rig, sightings_of_points(rig, clouds(), noise=4.0, velocity=50.0))
    offsets = np.array([0.004, -0.01, 0.0])
    at = reduce(off, offsets, seen)
    for _ in range(5):
        at = reduce(off, offsets, seen, points=at.points)
    steps = np.array([1e-5] * 3 + [1e-4] * 3 + [1e-4, 1e-5, 1e-2, 1e-2])
    slopes = np.empty((3, 10))
    for view, parameter in np.ndindex(3, 10):
        costs = []
        for sign in (1.0, -1.0):
            change = np.zeros((3, 10))
            change[view, parameter] = sign * steps[parameter]
            other = Rig([changed(camera, each) for camera, each in zip(off, change, strict=True)])
            costs.append(reduce(other, offsets + change[:, 6], seen, points=at.points).cost)
        slopes[view, parameter] = (costs[0] - costs[1]) / (2 * steps[parameter])
    gradient = at.gradients.sum(axis=0).reshape(3, 10)
    scale = np.sqrt(np.diag(at.information)).reshape(3, 10)
    np.testing.assert_allclose(gradient / scale, slopes / scale, atol=0.01)


def test_clusters_share_the_gradient_among_them():
    rig = ring(4)
    seen = observations(rig, sightings_of_points(rig, clouds(), noise=4.0))
    one = reduce(rig, np.zeros(4), seen)
    some = reduce(rig, np.zeros(4), seen, clusters=np.random.default_rng(0).integers(0, 7, len(seen)))
    np.testing.assert_allclose(some.gradients.sum(axis=0), one.gradients.sum(axis=0), rtol=1e-9, atol=1e-6)


def test_the_information_is_that_of_all_unknowns_with_the_joints_eliminated():
    """Against the dense Schur complement of a numerical Jacobian of cameras and joints together."""
    rig, points = ring(3), clouds(12)
    seen = observations(rig, sightings_of_points(rig, points, noise=0.0))
    at = reduce(rig, np.zeros(3), seen)

    def residuals(unknowns):
        cameras, joints = unknowns[:18].reshape(3, 6), unknowns[18:].reshape(-1, 3)
        moved = [changed(c, np.append(each, np.zeros(4))) for c, each in zip(rig, cameras, strict=True)]
        pixels = np.stack([camera.project(joints) for camera in moved])[seen.view, seen.point]
        return ((pixels - seen.pixels) / 4.0).ravel()

    start = np.append(np.zeros(18), at.points.ravel())
    jacobian = np.stack(
        [(residuals(start + 1e-6 * e) - residuals(start - 1e-6 * e)) / 2e-6 for e in np.eye(len(start))], axis=1
    )
    full = jacobian.T @ jacobian / (1 + FLOOR)  # the weight of a residual of 0
    dense = full[:18, :18] - full[:18, 18:] @ np.linalg.solve(full[18:, 18:], full[18:, :18])
    of_poses = (10 * np.arange(3)[:, None] + np.arange(6)).ravel()
    got = at.information[np.ix_(of_poses, of_poses)]
    np.testing.assert_allclose(got, dense, atol=1e-4 * np.abs(dense).max())


def test_least_squares_finds_the_same_cameras():
    """SciPy over cameras and joints together, with the same Gaussian prior and errors small enough to be Gaussian."""
    rig, points = ring(3), clouds(15)
    wrong = disturbed(rig, 0.4, 0.02, seed=5)
    sightings = sightings_of_points(rig, points, noise=0.4)
    free = np.zeros((3, 10), bool)
    free[2, :6] = True
    found = adjust(wrong, sightings, free=free, prior=Prior(rotation=1e3, translation=1e3))
    sigma = 4.0

    def residuals(unknowns):
        cameras = [*list(wrong)[:2], changed(wrong[2], np.append(unknowns[:6], np.zeros(4)))]
        joints = unknowns[6:].reshape(-1, 3)
        seen = found.observations
        return ((np.stack([c.project(joints) for c in cameras])[seen.view, seen.point] - seen.pixels) / sigma).ravel()

    solved = least_squares(residuals, np.append(np.zeros(6), found.points.ravel()), x_scale="jac", method="trf")
    np.testing.assert_allclose(found.parameters[2, :6], solved.x[:6], atol=4e-4)


def test_gross_errors_do_not_move_the_cameras():
    rig, points = ring(5), clouds(60)
    clean = sightings_of_points(rig, points, noise=0.5)
    pixels = clean.pixels.copy()
    rng = np.random.default_rng(1)
    bad = rng.permutation(len(pixels))[: len(pixels) // 10]
    pixels[bad] += rng.uniform(-200, 200, (len(bad), 2))
    spoilt = Sightings(
        clean.frame, clean.view, clean.person, clean.joint, pixels, clean.sigma, clean.times, COCO17, clean.velocity
    )
    free = np.zeros((5, 10), bool)
    free[:, :6] = True
    found = adjust(rig, spoilt, free=free)
    assert np.abs(found.parameters[:, :3]).max() < np.radians(0.05)
    assert found.weights[np.isin(found.observations.row, bad)].mean() < 0.15


@pytest.fixture(scope="module")
def filmed():
    return film(ring(5), walk(3, frames=60, seed=2), noise=4.0)[0]


def test_the_camera_that_moved_takes_the_whole_correction(filmed):
    """All cameras are free; four agree with each other and stay."""
    rig = ring(5)
    wrong = disturbed(rig, 2, 0.2, seed=4, views=[3])
    free = np.zeros((5, 10), bool)
    free[:, :6] = True
    found = adjust(wrong, gather(wrong, filmed, period=0.1), free=free)
    error = np.stack([difference(a, b) for a, b in zip(rig, found.rig, strict=True)])
    assert np.degrees(np.linalg.norm(error[:, :3], axis=1)).max() < 0.2
    assert np.linalg.norm(error[:, 3:6], axis=1).max() < 0.02


def test_what_is_held_stays(filmed):
    rig = ring(5)
    wrong = disturbed(rig, 1, 0.1, seed=4)
    free = np.zeros((5, 10), bool)
    free[3, :6] = True
    found = adjust(wrong, gather(wrong, filmed, period=0.1), free=free)
    assert not found.parameters[~free].any()
    assert not found.covariance[~free.ravel()].any()
    for view in (0, 1, 2, 4):
        np.testing.assert_array_equal(found.rig[view].P, wrong[view].P)
