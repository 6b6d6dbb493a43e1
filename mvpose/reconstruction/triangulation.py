"""Triangulation of every joint independently: the paper's reconstruction without a pictorial structure.

A triangulated point minimises the weighted squared distance to its viewing rays: linear triangulation (DLT) in metres.
One wrong view spoils this point, so the default method is robust: residuals are down-weighted by the error model of
:mod:`mvpose.reconstruction.likelihood`, starting from inflated variances (graduated non-convexity: Yang et al., IEEE
RA-L 2020), and where no majority of the views agrees, every pair of views is tried.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import add_shared, fit_variances, observe, person_scale
from mvpose.reconstruction.likelihood import (
    NO_RAYS,
    Noise,
    accumulate,
    add_ray,
    add_sums,
    anchor,
    evaluate_strongest_modes,
    log_likelihood,
    solve,
)
from mvpose.reconstruction.poses import MISSING_SCORE, Poses, clear, empty_poses, gather
from mvpose.skeleton import Skeleton

Method = Literal["robust", "dlt", "best-pair"]
_METHODS: tuple[Method, ...] = ("robust", "dlt", "best-pair")


@dataclass(frozen=True)
class Triangulation:
    """Reconstruction without a pictorial structure (the paper's "No 3DPS").

    Joints seen by fewer than two views are missing.

    Raises:
        ValueError: an unknown method.
    """

    method: Method = "robust"
    """``"robust"`` finds wrong views and leaves them out; ``"dlt"`` averages all views, weighted by score;
    ``"best-pair"`` takes the pair of views with the least reprojection error over all views, as the code released with
    the paper does."""
    noise: Noise = Noise()
    """Error model of keypoints."""

    def __post_init__(self) -> None:
        if self.method not in _METHODS:
            raise ValueError(f"method of triangulation must be one of {', '.join(_METHODS)}, got {self.method!r}")

    def __call__(self, rays: Rays, labels: NDArray[np.int64], skeleton: Skeleton) -> Poses:
        """Return the joints of all people; labels (m,) count from 0, -1 for a detection of no person."""
        poses = _triangulate(
            labels,
            rays.origins,
            rays.directions[:, :, None],
            rays.weights[:, :, None],
            self.noise.pixels * rays.pixel,
            self.noise.sigmas(skeleton),
            self.noise.floor,
            _METHODS.index(self.method),
        )
        return Poses(*poses)


@njit(cache=True)
def _triangulate(labels, origins, directions, weights, pixel, sigmas, floor, method):
    joints = len(sigmas)
    poses = empty_poses(labels, joints)
    misfit, responsibilities, supports = np.empty(joints), np.empty(joints), np.empty(joints)
    scratch, information, b, unused = np.empty((8, 3)), np.empty((3, 3)), np.zeros(3), np.empty(3)
    for person in range(len(poses[0])):
        centers, person_rays, scores_2d, angles = gather(labels, person, origins, directions, weights, pixel)
        point, scores, covariance, freedom = poses[0][person], poses[1][person], poses[2][person], poses[3][person]
        clear(point, scores, covariance, freedom)
        error_scale, steps = 1.0, 0
        for j in range(joints):
            view = centers, person_rays[j], scores_2d[j], angles, sigmas[j], floor
            if method == 0:
                sums = consensus(point[j], view, scratch)
            else:
                found = _all_views(point[j], view, scratch) if method == 1 else _best_pair(point[j], view)
                sums = settle(point[j], view, scratch, 1.0, 0) if found else (0.0, 0.0, 0.0)
            supports[j], responsibilities[j], misfit[j] = sums
        if method == 0:  # which keypoints are wrong is decided by the error scale of this person, not of the model
            error_scale, steps = np.sqrt(person_scale(misfit, responsibilities)), _MOST_STEPS
        relative, absolute = fit_variances(misfit, responsibilities, supports, sigmas)
        for j in range(joints):
            if np.isnan(point[j, 0]):
                continue
            place, rays, seen = point[j], person_rays[j], scores_2d[j]
            if steps > 0:
                view = centers, rays, seen, angles, error_scale * sigmas[j], floor
                supports[j], _, _ = settle(place, view, scratch, 1.0, steps)
            if supports[j] / len(angles) > MISSING_SCORE:
                scores[j] = supports[j] / len(angles)
                view = centers, rays, seen, angles, sigmas[j], floor
                freedom[j], _ = observe(place, view, relative, absolute, information)
                solve(information, b, covariance[j], unused)
                add_shared(covariance[j], sigmas[j])
            else:
                place[:] = np.nan
    return poses


_MOST_STEPS = 12
_HOT = 4.0  # variances; all views agree if no squared error exceeds two standard deviations
_COOLING = 4.0  # factor by which the temper falls per step
_CONVERGED = 2.5e-5  # m^2; the last step, shorter than 5 mm, is still taken and is far below any detector's accuracy
_MAJORITY = 0.5  # of the total score
_NEARLY_ALL = 0.8  # of the total score
_BEYOND_CHANCE = 3.5  # views; three rays may pass one point by chance


@njit(cache=True, borrows=True)
def consensus(point, view, scratch):
    """Write the most likely point of one joint and return its support as :func:`settle` does.

    The support is 0 where fewer than two views see the joint.

    Where nearly all views agree, or a majority of four views or more (rarely do more than three rays pass one point
    by chance), the point found by cooling is taken. Otherwise all pairs of views are tried and the likeliest point is
    refined.

    Args:
        point: output, (3,).
        view: origins, directions, weights and angles of a pixel as in :mod:`mvpose.reconstruction.likelihood`, the
            standard deviation of the joint, and the floor.
        scratch: working memory, (8, 3).
    """
    origins, directions, weights, pixel, sigma, floor = view
    if not _all_views(point, view, scratch):
        return 0.0, 0.0, 0.0
    total = 0.0
    for v in range(len(weights)):
        total += weights[v, 0]
    support, responsibilities, misfit, worst = evaluate_strongest_modes(
        point, origins, directions, weights, pixel, sigma, floor
    )
    if worst > _HOT * sigma * sigma:
        temper = min(worst / (_HOT * sigma * sigma), 1e4)
        support, responsibilities, misfit = settle(point, view, scratch, temper, _MOST_STEPS)
    if support > (_MAJORITY if responsibilities > _BEYOND_CHANCE else _NEARLY_ALL) * total:
        return support, responsibilities, misfit
    best = log_likelihood(point, origins, directions, weights, pixel, sigma, floor)
    trial = scratch[7]
    for first in range(len(weights)):
        for second in range(first + 1, len(weights)):
            if pair_point(
                origins[first], directions[first, 0], weights[first, 0],
                origins[second], directions[second, 0], weights[second, 0], trial,
            ):  # fmt: skip
                value = log_likelihood(trial, origins, directions, weights, pixel, sigma, floor)
                if value > best:
                    best = value
                    for r in range(3):
                        point[r] = trial[r]
    return settle(point, view, scratch, 1.0, _MOST_STEPS)


@njit(cache=True, borrows=True)
def settle(point, view, scratch, temper, steps):
    """Move a point to the nearby maximum of its likelihood by expectation maximisation.

    A ``temper`` above 1 starts with inflated variances, so that a more distant maximum is found.

    Returns:
        Support, responsibilities and misfit as :func:`mvpose.reconstruction.likelihood.accumulate`, at the last step.
        The first three rows of ``scratch`` hold the covariance there.
    """
    origins, directions, weights, pixel, sigma, floor = view
    inverse, A, b, move = scratch[:3], scratch[3:6], scratch[6], scratch[7]
    for step in range(max(steps, 1)):
        anchor(A, b)
        sums = accumulate(point, origins, directions, weights, pixel, sigma, floor, temper, A, b)
        solve(A, b, inverse, move)
        if step == steps:  # zero steps requested: evaluate only
            break
        moved = 0.0
        for r in range(3):
            moved += move[r] ** 2
            point[r] += move[r]
        if temper == 1.0 and moved < _CONVERGED:
            break
        temper = max(temper / _COOLING, 1.0)
    return sums


@njit(cache=True, borrows=True)
def _all_views(point, view, scratch):
    """Write the point nearest to all rays, weighted by score; return False if fewer than two views see the joint."""
    origins, directions, weights = view[:3]
    sums, views = NO_RAYS, 0
    for v in range(len(weights)):
        if weights[v, 0] > 0.0:
            views += 1
            # Squared because the DLT weights its rows by score, and a row is a residual.
            sums = add_ray(sums, weights[v, 0] ** 2, directions[v, 0], origins[v])
    if views < 2:
        return False
    inverse, A, b = scratch[:3], scratch[3:6], scratch[6]
    for r in range(3):
        b[r] = 0.0
        for c in range(3):
            A[r, c] = 0.0
    add_sums(sums, A, b)
    return solve(A, b, inverse, point)


@njit(cache=True)
def _best_pair(point, view):
    """Write the point of the pair of views with the least mean reprojection error; return False if there is none."""
    origins, directions, weights, pixel = view[:4]
    best, trial = np.inf, np.empty(3)
    for first in range(len(weights)):
        for second in range(first + 1, len(weights)):
            if pair_point(
                origins[first], directions[first, 0], weights[first, 0],
                origins[second], directions[second, 0], weights[second, 0], trial,
            ):  # fmt: skip
                error, mass = 0.0, 0.0
                for v in range(len(weights)):
                    if weights[v, 0] > 0.0:
                        x, y, z = trial[0] - origins[v, 0], trial[1] - origins[v, 1], trial[2] - origins[v, 2]
                        along = x * directions[v, 0, 0] + y * directions[v, 0, 1] + z * directions[v, 0, 2]
                        across = np.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
                        error += weights[v, 0] * np.arctan2(across, along) / pixel[v]
                        mass += weights[v, 0]
                if error / mass < best:
                    best = error / mass
                    for r in range(3):
                        point[r] = trial[r]
    return best < np.inf


_LEAST_SINE2 = 1e-10  # squared sine of the angle between two rays; below it they count as parallel


@njit(cache=True, borrows=True)
def pair_point(origin, direction, weight, other_origin, other_direction, other_weight, point):
    """Write the point nearest to two rays, weighted by score, and return a measure of how well they determine it.

    Rays that are parallel, or whose nearest points lie behind a camera, determine no point.

    Returns:
        Product of the scores and of the squared sine of the angle between the rays; 0 where there is no point.
    """
    if weight <= 0.0 or other_weight <= 0.0:
        return 0.0
    cosine, along, other_along = 0.0, 0.0, 0.0
    for r in range(3):
        baseline = other_origin[r] - origin[r]
        cosine += direction[r] * other_direction[r]
        along += baseline * direction[r]
        other_along += baseline * other_direction[r]
    sine2 = 1.0 - cosine * cosine
    s, t = along - other_along * cosine, along * cosine - other_along  # both times sine2
    if not (sine2 > _LEAST_SINE2 and s > 0.0 and t > 0.0):
        return 0.0
    s, t = s / sine2, t / sine2
    share = weight * weight / (weight * weight + other_weight * other_weight)
    for r in range(3):
        near, other_near = origin[r] + s * direction[r], other_origin[r] + t * other_direction[r]
        point[r] = other_near + share * (near - other_near)
    return weight * other_weight * sine2
