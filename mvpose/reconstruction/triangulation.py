"""From matched rays to points, every joint by itself: the paper's reconstruction without a pictorial structure.

A triangulated point minimises the weighted squared distance to its viewing rays: linear triangulation (the DLT) in
metres. One wrong view spoils it, so the default goes on: residuals are down-weighted by the error model of
:mod:`mvpose.reconstruction.likelihood`, from a wide one to the real one (graduated non-convexity: Yang et al., IEEE
RA-L 2020), and where no majority of the views agrees every pair of views gets its say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import joint_scales, person_scale
from mvpose.reconstruction.likelihood import (
    NO_RAYS,
    Noise,
    accumulate,
    add_ray,
    add_sums,
    log_likelihood,
    look,
    solve,
    tie,
)
from mvpose.reconstruction.poses import NOBODY, Poses, clear, gather
from mvpose.skeleton import Skeleton

Method = Literal["robust", "dlt", "best-pair"]
_METHODS: tuple[Method, ...] = ("robust", "dlt", "best-pair")


@dataclass(frozen=True)
class Triangulation:
    """Reconstruction without a pictorial structure (the paper's "No 3DPS").

    Joints seen by fewer than two views are missing, not invented.

    Attributes:
        method: ``"robust"`` finds the views that are wrong and leaves them out; ``"dlt"`` averages all views, weighted
            by score; ``"best-pair"`` takes the pair of views with the least reprojection error over all views, as
            the code released with the paper does.
        noise: the error model of keypoints.

    Raises:
        ValueError: a method that is none of these.
    """

    method: Method = "robust"
    noise: Noise = Noise()

    def __post_init__(self) -> None:
        if self.method not in _METHODS:
            raise ValueError(f"method of triangulation must be one of {', '.join(_METHODS)}, got {self.method!r}")

    def __call__(self, rays: Rays, labels: NDArray[np.int64], skeleton: Skeleton) -> Poses:
        """The joints of everyone: labels (m,) from 0, -1 for a detection of nobody."""
        poses = Poses.empty(labels, len(skeleton))
        _triangulate(
            poses,
            labels,
            rays.origins,
            rays.directions[:, :, None],
            rays.weights[:, :, None],
            self.noise.pixels * rays.pixel,
            self.noise.sigmas(skeleton),
            self.noise.floor,
            _METHODS.index(self.method),
        )
        return poses


@njit(cache=True)
def _triangulate(poses, labels, origins, directions, weights, pixel, sigmas, floor, method):
    joints = len(sigmas)
    misfit, rights = np.empty(joints), np.empty(joints)
    scratch = np.empty((8, 3))
    for person in range(len(poses.joints)):
        mine, towards, weight, angle = gather(labels, person, origins, directions, weights, pixel)
        point, scores, covariance = poses.joints[person], poses.scores[person], poses.covariance[person]
        clear(point, scores, covariance)
        own, steps = 1.0, 0
        for j in range(joints):
            rights[j] = misfit[j] = 0.0
            view = mine, towards[j], weight[j], angle, sigmas[j], floor
            if method == 0:
                _, rights[j], misfit[j] = consensus(point[j], view, scratch)
            elif method == 1:
                _all_views(point[j], view, scratch)
            else:
                _best_pair(point[j], view)
        if method == 0:  # what is wrong by this person's measure, not the model's
            own, steps = np.sqrt(person_scale(misfit, rights)), _MOST_STEPS
        for j in range(joints):
            support = 0.0
            if not np.isnan(point[j, 0]):
                view = mine, towards[j], weight[j], angle, own * sigmas[j], floor
                support, rights[j], misfit[j] = settle(point[j], view, scratch, 1.0, steps)
            _note(point[j], support / len(angle), scratch, j, scores, covariance)
        scale = joint_scales(misfit, rights)
        for j in range(joints):
            for r in range(3):
                for c in range(3):
                    covariance[j, r, c] *= scale[j]


@njit(cache=True)
def _note(point, score, scratch, j, scores, covariance):
    """Enter a joint of one person; where no view vouches for it, there is none."""
    scores[j] = score if score > NOBODY else 0.0
    for r in range(3):
        if score <= NOBODY:
            point[r] = np.nan
        for c in range(3):
            covariance[j, r, c] = scratch[r, c] if score > NOBODY else np.nan


_MOST_STEPS = 12
_HOT = 4.0  # variances: with no view further off than two deviations, all agree
_COOLING = 4.0  # of the temper, a step
_STILL = 2.5e-5  # m^2: a step of less than 5 mm is far below the scatter of any detector, and the step is still taken
_MAJORITY = 0.5  # of the score
_NEARLY_ALL = 0.8
_BEYOND_CHANCE = 3.5  # views


@njit(cache=True)
def consensus(point, view, scratch):
    """Write the most likely point of one joint, and say who vouches for it, as :func:`settle` does.

    Nobody does, and the support is 0, where fewer than two views see it.

    Where nearly all views agree, or four and more that are the majority (rays that pass one point by chance are
    rarely more than three), cooling has led to the point. Otherwise all pairs of views are tried and the likeliest
    point is refined.

    Args:
        point: where to write, (3,).
        view: origins, directions, weights and angles of a pixel as in :mod:`mvpose.reconstruction.likelihood`, the
            deviation of the joint and the floor.
        scratch: (8, 3).
    """
    origins, directions, weights, pixel, sigma, floor = view
    if not _all_views(point, view, scratch):
        return 0.0, 0.0, 0.0
    total = 0.0
    for v in range(len(weights)):
        total += weights[v, 0]
    support, rights, misfit, worst = look(point, origins, directions, weights, pixel, sigma, floor)
    if worst > _HOT * sigma * sigma:
        temper = min(worst / (_HOT * sigma * sigma), 1e4)
        support, rights, misfit = settle(point, view, scratch, temper, _MOST_STEPS)
    if support > (_MAJORITY if rights > _BEYOND_CHANCE else _NEARLY_ALL) * total:
        return support, rights, misfit
    best = log_likelihood(point, origins, directions, weights, pixel, sigma, floor)
    trial = np.empty(3)
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


@njit(cache=True)
def settle(point, view, scratch, temper, steps):
    """Move a point to the nearby maximum of its likelihood by expectation maximisation.

    Hot, with a temper above 1, the error model starts wider, so that the maximum need not be near.

    Returns:
        Support, responsibilities and misfit as :func:`mvpose.reconstruction.likelihood.accumulate`, at the last step;
        the first three rows of the scratch are the covariance there.
    """
    origins, directions, weights, pixel, sigma, floor = view
    inverse, A, b, target = scratch[:3], scratch[3:6], scratch[6], scratch[7]
    for step in range(max(steps, 1)):
        tie(point, A, b)
        vouched = accumulate(point, origins, directions, weights, pixel, sigma, floor, temper, A, b)
        solve(A, b, inverse, target)
        if step == steps:  # only to look
            break
        moved = 0.0
        for r in range(3):
            moved += (target[r] - point[r]) ** 2
            point[r] = target[r]
        if temper == 1.0 and moved < _STILL:
            break
        temper = max(temper / _COOLING, 1.0)
    return vouched


@njit(cache=True)
def _all_views(point, view, scratch):
    """Write the point nearest to all rays, weighted by score; False where fewer than two views see the joint."""
    origins, directions, weights = view[:3]
    sums, views = NO_RAYS, 0
    for v in range(len(weights)):
        if weights[v, 0] > 0.0:
            views += 1
            # Squared: in the DLT the rows are weighted by score, and a row is a residual.
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
    """Write the point of the pair of views with the least mean reprojection error over all views; False if none."""
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


_LEAST_SINE2 = 1e-10  # of the angle between two rays, squared; below, they are parallel


@njit(cache=True)
def pair_point(origin, direction, weight, other_origin, other_direction, other_weight, point):
    """Write the point nearest to two rays, weighted by score; how well they pin it down, 0 where they have no point.

    Rays that are parallel, or that come nearest to each other behind a camera, have none.

    Returns:
        Product of the scores and of the squared sine between the rays.
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
        here, there = origin[r] + s * direction[r], other_origin[r] + t * other_direction[r]
        point[r] = there + share * (here - there)
    return weight * other_weight * sine2
