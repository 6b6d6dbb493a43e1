"""Bundle adjustment: derivatives, an oracle, recovery of known errors, the prior, and errors about one person."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import disturbed, film, walk
from people import look_at, ring
from scipy.optimize import least_squares

from mvpose import Rig
from mvpose.calibration.adjustment import (
    CORRELATION,
    LIFETIME,
    adjust,
    importance_over_time,
    lasting_effect,
    shared_effect,
    shared_joints,
)
from mvpose.calibration.calibration_prior import Prior, PriorWeights
from mvpose.calibration.cameras import fit
from mvpose.calibration.normal_equations import (
    CLOCK,
    FREEDOM,
    POSE,
    _much_farther,
    changed,
    difference,
    joint_views,
    normal_equations,
    with_errors,
)
from mvpose.calibration.sightings import Sightings, gather, match_over_time, sightings_of
from mvpose.calibration.tracklets import link
from mvpose.skeleton import COCO17

BENT = [-0.12, 0.02, 0.001, -0.001, 0.0]


_PLACES = ((4.0, 0.3, 2.1), (1.0, 3.8, 1.6), (-3.3, 2.4, 2.6), (-2.6, -3.2, 1.9), (1.6, -4.1, 2.4))
_VIEW = 1


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


def solved(rig, change, sightings, **options):
    return normal_equations(with_errors(rig.packed, np.asarray(change, float).ravel()), sightings, scale=1.0, **options)


def test_changes_of_cameras_are_found_again():
    rng = np.random.default_rng(0)
    camera = ring(3, distortion=BENT)[1]
    change = rng.normal(size=11) * [0.1, 0.1, 0.1, 0.3, 0.3, 0.3, 0.05, 9, 9, 0.02, 0.0]
    np.testing.assert_allclose(difference(camera, changed(camera, change)), change, atol=1e-9)


def test_packed_cameras_change_as_cameras_do():
    rng = np.random.default_rng(0)
    rig = ring(3, distortion=BENT)
    change = rng.normal(size=(3, 11)) * [0.1, 0.1, 0.1, 0.3, 0.3, 0.3, 0.05, 9, 9, 0.02, 0.03]
    packed = with_errors(rig.packed, change.ravel())[0]
    other = Rig([changed(camera, each) for camera, each in zip(rig, change, strict=True)])
    np.testing.assert_allclose(packed[:, :22], other.packed, atol=1e-9)
    np.testing.assert_array_equal(packed[:, 22], change[:, CLOCK].ravel())


@pytest.mark.parametrize("distortion", [None, BENT])
def test_gradients_are_the_slopes_of_the_likelihood(distortion):
    """All eleven parameters of all cameras, against central differences of the cost with every joint solved again."""
    rig = disturbed(ring(3, distortion=distortion), 0.3, 0.01)
    joints, _ = shared_joints(sightings_of_points(ring(3, distortion=distortion), clouds(), noise=4.0, velocity=50.0))
    at = np.zeros((3, 11))
    at[:, CLOCK.start] = 0.004, -0.01, 0.0
    found = solved(rig, at, joints)
    for _ in range(5):
        found = solved(rig, at, joints, joints=found.joints)
    steps = np.array([1e-5] * 3 + [1e-4] * 3 + [1e-5, 1e-2, 1e-2, 1e-4, 1e-4])
    slopes = np.empty((3, 11))
    for place in np.ndindex(3, 11):
        costs = []
        for sign in (1.0, -1.0):
            change = at.copy()
            change[place] += sign * steps[place[1]]
            costs.append(solved(rig, change, joints, joints=found.joints).cost)
        slopes[place] = (costs[0] - costs[1]) / (2 * steps[place[1]])
    gradient = found.g.sum(axis=0).reshape(3, 11)
    scale = np.sqrt(np.diag(found.H[0])).reshape(3, 11)
    np.testing.assert_allclose(gradient / scale, slopes / scale, atol=0.01)


def test_clusters_share_the_gradient_among_them():
    rig = ring(4)
    joints, _ = shared_joints(sightings_of_points(rig, clouds(), noise=4.0))
    one = solved(rig, np.zeros((4, 11)), replace(joints, cluster=np.zeros(len(clouds()), int)))
    cluster = np.random.default_rng(0).integers(0, 7, len(clouds()))
    some = solved(rig, np.zeros((4, 11)), replace(joints, cluster=cluster))
    assert len(some.g) == 7
    np.testing.assert_allclose(some.g.sum(axis=0), one.g[0], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(some.H, one.H)


def test_a_joint_of_importance_two_counts_as_two_joints():
    rig, twice = ring(3), np.append(np.arange(10), 0)
    joints, _ = shared_joints(sightings_of_points(rig, clouds(10), noise=0.0))
    repeated, _ = shared_joints(sightings_of_points(rig, clouds(10)[twice], noise=0.0))
    weighted = replace(joints, importance=np.append(2.0, np.ones(9)))
    one, other = (solved(rig, np.zeros((3, 11)), each) for each in (weighted, repeated))
    np.testing.assert_allclose(one.H, other.H, rtol=1e-6, atol=1e-6 * other.H.max())


def test_the_information_is_that_of_all_unknowns_with_the_joints_eliminated():
    """Against the dense Schur complement of a numerical Jacobian of cameras and joints together."""
    rig, points = ring(3), clouds(12)
    joints, _ = shared_joints(sightings_of_points(rig, points, noise=0.0))
    at = solved(rig, np.zeros((3, 11)), joints)

    def residuals(unknowns):
        cameras, places = unknowns[:18].reshape(3, 6), unknowns[18:].reshape(-1, 3)
        moved = [changed(c, np.append(each, np.zeros(5))) for c, each in zip(rig, cameras, strict=True)]
        pixels = np.stack([camera.project(places) for camera in moved])[joints.view, joints.joint]
        return ((pixels - joints.pixels) / 4.0).ravel()

    start = np.append(np.zeros(18), at.joints.ravel())
    jacobian = np.stack(
        [(residuals(start + 1e-6 * e) - residuals(start - 1e-6 * e)) / 2e-6 for e in np.eye(len(start))], axis=1
    )
    full = jacobian.T @ jacobian * (FREEDOM + 2) / FREEDOM  # the weight of a residual of 0
    dense = full[:18, :18] - full[:18, 18:] @ np.linalg.solve(full[18:, 18:], full[18:, :18])
    of_poses = (11 * np.arange(3)[:, None] + np.arange(6)).ravel()
    got = at.H[0][np.ix_(of_poses, of_poses)]
    np.testing.assert_allclose(got, dense, atol=1e-4 * np.abs(dense).max())


def test_least_squares_finds_the_same_camera():
    """SciPy over the camera and all joints together, without a prior, with residuals whose squares are the cost."""
    rig, points = ring(3), clouds(15)
    wrong = disturbed(rig, 0.4, 0.02, seed=5)
    free = np.zeros((3, 11), bool)
    free[2, POSE] = True
    found = adjust(wrong, sightings_of_points(rig, points, noise=0.4), free=free, prior=Prior(1e3, 1e3))
    seen = found.joints

    def residuals(unknowns):
        cameras = [*list(wrong)[:2], changed(wrong[2], np.append(unknowns[:6], np.zeros(5)))]
        places = unknowns[6:].reshape(-1, 3)
        errors = np.stack([c.project(places) for c in cameras])[seen.view, seen.joint] - seen.pixels
        square = (errors**2).sum(axis=1, keepdims=True) / (4.0 * found.equations.scale) ** 2
        return (errors * np.sqrt(np.log1p(square / FREEDOM) / square)).ravel()

    solution = least_squares(residuals, np.append(np.zeros(6), found.equations.joints.ravel()), x_scale="jac")
    np.testing.assert_allclose(found.parameters[2, POSE], solution.x[:6], atol=1e-4)


@pytest.mark.parametrize("n", [1, 2, 30])
def test_effect_of_lasting_errors_is_the_variance_of_their_sum(n):
    """Against the sum of the whole covariance matrix of errors at irregular times."""
    times = np.sort(np.random.default_rng(n).uniform(0, 8, n))
    covariance = CORRELATION * np.exp(-np.abs(times[:, None] - times) / LIFETIME)
    np.fill_diagonal(covariance, 1.0)
    assert lasting_effect(times) == pytest.approx(covariance.sum() / n)


def test_people_seen_for_longer_count_less_in_each_frame():
    person, times = np.repeat([4, 7], [60, 5]), np.append(np.repeat(0.2 * np.arange(30), 2), 0.2 * np.arange(5))
    weight = importance_over_time(person, times)
    np.testing.assert_allclose(weight[:60], 1 / lasting_effect(0.2 * np.arange(30)))
    np.testing.assert_allclose(weight[60:], 1 / lasting_effect(0.2 * np.arange(5)))
    assert weight[0] < weight[-1]


def test_effect_of_shared_errors_is_that_of_repeated_joints():
    """Seven joints of a body with one and the same error have the evidence of one."""
    rng = np.random.default_rng(0)
    slopes = rng.standard_normal((400, 3))
    own = slopes * rng.standard_normal((400, 1))
    information = slopes.T @ slopes
    assert shared_effect(own, np.ones(400), information) == pytest.approx(1.0, abs=0.2)
    assert shared_effect(7 * own, np.ones(400), 7 * information) == pytest.approx(7.0, rel=0.15)
    weighted = shared_effect(0.1 * 7 * own, np.full(400, 0.1), 0.1 * 7 * information)
    assert weighted == pytest.approx(shared_effect(7 * own, np.ones(400), 7 * information))


def test_the_width_of_the_prior_is_that_of_the_errors():
    """Many cameras whose errors are known exactly: the scales of their Student distribution are found."""
    rng, prior = np.random.default_rng(0), Prior()
    free, true = np.ones((2000, 11), bool), np.array([3.0] * 3 + [0.5] * 3 + [1.0] * 5)
    errors = true * prior.sigmas() * rng.standard_normal((2000, 11)) / np.sqrt(rng.gamma(2.0, 0.5, (2000, 1)))
    weights = PriorWeights.wide(prior, 2000)
    for _ in range(50):
        weights = weights.updated(prior, errors, np.zeros_like(errors), free)
    np.testing.assert_allclose(weights.width, true, rtol=0.1)


def test_intervals_with_an_estimated_width_hold_what_they_promise():
    """Five errors of unknown width, known exactly, and a sixth that the data leave open: 90 % of its interval."""
    rng, prior = np.random.default_rng(0), Prior()
    free = np.zeros((6, 11), bool)
    free[:, CLOCK] = True
    inside = []
    for _ in range(600):
        errors = np.zeros((6, 11))
        errors[:, CLOCK] = 0.01 * rng.standard_normal((6, 1))
        known, weights = errors * (np.arange(6) < 5)[:, None], PriorWeights.wide(prior, 6)
        for _ in range(20):
            variances = np.zeros((6, 11))
            variances[5] = 1.0 / weights.information[5]
            weights = weights.updated(prior, known, variances, free)
        sigma = weights.widened(variances, free).information[5, CLOCK] ** -0.5
        inside.append(abs(errors[5, CLOCK]) < 1.645 * sigma)
    assert np.mean(inside) == pytest.approx(0.9, abs=0.04)


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
    free = np.zeros((5, 11), bool)
    free[:, POSE] = True
    found = adjust(rig, spoilt, free=free)
    assert np.abs(found.parameters[:, :3]).max() < np.radians(0.05)
    assert found.equations.weights[np.isin(found.rows, bad)].mean() < 0.15


@pytest.fixture(scope="module")
def filmed():
    return film(ring(5), walk(3, frames=60, seed=2), noise=4.0)[0]


def test_the_camera_that_moved_takes_the_whole_correction(filmed):
    """All cameras are free; four agree with each other and stay."""
    rig = ring(5)
    wrong = disturbed(rig, 2, 0.2, seed=4, views=[3])
    free = np.zeros((5, 11), bool)
    free[:, POSE] = True
    found = adjust(wrong, gather(wrong, filmed, period=0.1), free=free)
    error = np.stack([difference(a, b) for a, b in zip(rig, found.rig, strict=True)])
    assert np.degrees(np.linalg.norm(error[:, :3], axis=1)).max() < 0.2
    assert np.linalg.norm(error[:, 3:6], axis=1).max() < 0.02


@pytest.mark.slow
def test_what_is_held_stays(filmed):
    rig = ring(5)
    wrong = disturbed(rig, 1, 0.1, seed=4)
    free = np.zeros((5, 11), bool)
    free[3, POSE] = True
    found = adjust(wrong, gather(wrong, filmed, period=0.1), free=free)
    assert not found.parameters[~free].any()
    assert not found.covariance[~free.ravel()].any()
    for view in (0, 1, 2, 4):
        np.testing.assert_array_equal(found.rig[view].P, wrong[view].P)


def test_one_person_far_off_is_wrong_and_all_people_far_off_are_not():
    off = np.array([[0.9, 12.0, np.nan], [1.1, 10.0, 20.0], [9.0, 14.0, np.nan]])
    expected = np.zeros((3, 3), bool)
    expected[2, 0] = True
    np.testing.assert_array_equal(_much_farther(off), expected)


def test_noise_is_not_wrong():
    assert not _much_farther(np.array([[0.5], [3.9]])).any()


@pytest.fixture(scope="module")
def matched():
    rig = Rig([look_at(np.array(place), np.array([0.1 * v, 0.0, 1.0])) for v, place in enumerate(_PLACES)])
    frames, _ = film(rig, walk(3, frames=60, period=0.1), noise=3.0)
    tracklets = link(rig, frames, period=0.1)
    return rig, sightings_of(tracklets, match_over_time(rig, tracklets).person)


@pytest.mark.parametrize(("affected", "found"), [("one person", []), ("everybody", [_VIEW])])
def test_a_fault_is_one_for_everybody(matched, affected, found):
    rig, sightings = matched
    rows = sightings.view == _VIEW
    if affected == "one person":
        people, counts = np.unique(sightings.person[rows & sightings.shared], return_counts=True)
        assert len(people) > 1
        rows &= sightings.person == people[np.argmax(counts)]
    joints, _ = joint_views(replace(sightings, pixels=sightings.pixels + 30.0 * rows[:, None]))
    assert [each.fault.view for each in fit(rig.packed, joints).faults] == found
