"""From matched rays to points: proposals from every pair of views, and robust triangulation over all of them.

A triangulated point minimises the weighted squared distance to its viewing rays; the weights are the scores and the
inverse variances of :mod:`mvpose.reconstruction.likelihood`, so this is score-weighted triangulation in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.rays import Rays
from mvpose.reconstruction.likelihood import Noise, add_ray, log_likelihood, solve, view_terms
from mvpose.skeleton import Skeleton

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Proposals:
    """Candidate positions of every joint of one person.

    Attributes:
        states: (J, S, 3), metres; the first ``count[j]`` are valid.
        unary: log-likelihood of each, (J, S); -inf beyond the count.
        count: (J,).
    """

    states: Floats
    unary: Floats
    count: NDArray[np.int64]


def propose(rays: Rays, sigmas: Floats, noise: Noise) -> Proposals:
    """Triangulate every joint from every pair of views, and from all views at once (paper, section 3.3).

    As long as a joint is right in two views, its position is among the proposals; the all-view point adds accuracy
    where more are right. Pairs whose rays are parallel or meet behind a camera propose nothing.

    Args:
        rays: one person's, at most one detection a view, (n, J).
        sigmas: deviation of each joint, (J,), metres.
        noise: the rest of the error model.
    """
    states, unary, count = _propose(rays.origins, rays.directions, rays.weights, rays.pixel, sigmas, noise.floor)
    return Proposals(states, unary, count)


@dataclass(frozen=True)
class Triangulation:
    """Reconstruction without a pictorial structure: every joint by itself (the paper's "No 3DPS").

    The most likely proposal, refined over all views that agree with it; views that do not are found and left out,
    not averaged in. Joints seen by fewer than two views are missing, not invented.
    """

    noise: Noise = Noise()

    def __call__(self, rays: Rays, skeleton: Skeleton) -> tuple[Floats, Floats, Floats]:
        """Joints (J, 3), scores (J,) and covariances (J, 3, 3) of one person; NaN and score 0 where missing."""
        proposals = propose(rays, self.noise.sigmas(skeleton), self.noise)
        best = np.argmax(proposals.unary, axis=1)
        free = np.full(len(skeleton), np.inf)
        return refine(rays, skeleton, proposals, best, self.noise, length=np.zeros(len(skeleton)), deviation=free)


def refine(
    rays: Rays,
    skeleton: Skeleton,
    proposals: Proposals,
    chosen: NDArray[np.int64],
    noise: Noise,
    *,
    length: Floats,
    deviation: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Climb from the chosen states to the nearby maximum of likelihood times bone-length prior.

    Expectation maximisation: which keypoints are right given the joints, then the joints given those, each a 3 x 3
    solve with the bones to its neighbours linearised. No step lowers the posterior.

    Args:
        rays: one person's, (n, J).
        skeleton: its tree.
        proposals: the states.
        chosen: index of the state of every joint, (J,).
        noise: the error model.
        length: mean length of the bone to the parent, (J,), metres.
        deviation: its deviation, (J,), metres; infinite for no constraint.

    Returns:
        Joints (J, 3), scores (J,): mean over the person's views of score times responsibility, and covariances
        (J, 3, 3), the inverse information of rays and bones.
    """
    joints = np.take_along_axis(proposals.states, chosen[:, None, None], axis=1)[:, 0]
    joints[proposals.count == 0] = np.nan
    parents = np.asarray(skeleton.parents, np.int64)
    precision = 1.0 / deviation**2
    scores, covariance = _refine(
        joints,
        rays.origins,
        rays.directions,
        rays.weights,
        rays.pixel,
        noise.sigmas(skeleton),
        noise.floor,
        parents,
        length,
        precision,
    )
    return joints, scores, covariance


@njit(cache=True)
def _propose(origins, directions, weights, pixel, sigmas, floor):  # type: ignore[no-untyped-def]
    n, joints = weights.shape
    most = n * (n - 1) // 2 + 1
    states = np.zeros((joints, most, 3))
    unary = np.full((joints, most), -np.inf)
    count = np.zeros(joints, np.int64)
    A, b, inverse, point = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    for j in range(joints):
        for first in range(n):
            for second in range(first, n):
                # (0, 0) stands for all views at once; the other pairs of one view with itself are no pairs.
                together = first == 0 and second == 0
                if (first == second and not together) or (
                    not together and (weights[first, j] <= 0.0 or weights[second, j] <= 0.0)
                ):
                    continue
                A[:, :] = 0.0
                b[:] = 0.0
                used = 0
                for k in range(n):
                    if weights[k, j] > 0.0 and (together or k == first or k == second):
                        add_ray(A, b, origins[k], directions[k, j], weights[k, j])
                        used += 1
                if used < (3 if together else 2) or not solve(A, b, inverse, point):
                    continue
                ahead = True
                for k in range(n):
                    if weights[k, j] > 0.0 and (together or k == first or k == second):
                        along = 0.0
                        for r in range(3):
                            along += (point[r] - origins[k, r]) * directions[k, j, r]
                        ahead = ahead and along > 0.0
                if ahead:
                    for r in range(3):
                        states[j, count[j], r] = point[r]
                    unary[j, count[j]] = log_likelihood(
                        point, origins, directions[:, j], weights[:, j], pixel, sigmas[j], floor
                    )
                    count[j] += 1
    return states, unary, count


_SWEEPS = 8
_HALVINGS = 4
_LEASH = 1.0  # 1/m^2: information that ties a joint to where it is; it matters only where no view agrees


@njit(cache=True)
def _refine(  # type: ignore[no-untyped-def]
    joints, origins, directions, weights, pixel, sigmas, floor, parents, length, precision
):
    n, count = weights.shape
    scores = np.zeros(count)
    covariance = np.full((count, 3, 3), np.nan)
    A, b, target, trial = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    for _ in range(_SWEEPS):
        for j in range(count):
            if np.isnan(joints[j, 0]):
                continue
            A[:, :] = 0.0
            for r in range(3):
                A[r, r] = _LEASH
                b[r] = _LEASH * joints[j, r]
            score = 0.0
            for k in range(n):
                if weights[k, j] > 0.0:
                    right, variance, _ = view_terms(
                        joints[j], origins[k], directions[k, j], weights[k, j], pixel[k], sigmas[j], floor
                    )
                    add_ray(A, b, origins[k], directions[k, j], right / variance)
                    score += right * weights[k, j]
            _add_bones(A, b, j, joints, parents, length, precision)
            if not solve(A, b, covariance[j], target):
                continue
            scores[j] = score / n
            # The bones are linearised, so a long step can overshoot; a step is taken only if it climbs.
            here = _local_posterior(
                joints[j], j, joints, origins, directions, weights, pixel, sigmas, floor, parents, length, precision
            )
            step = 1.0
            for _ in range(_HALVINGS):
                for r in range(3):
                    trial[r] = joints[j, r] + step * (target[r] - joints[j, r])
                there = _local_posterior(
                    trial, j, joints, origins, directions, weights, pixel, sigmas, floor, parents, length, precision
                )
                if there >= here:
                    for r in range(3):
                        joints[j, r] = trial[r]
                    break
                step *= 0.5
    return scores, covariance


@njit(cache=True)
def _add_bones(A, b, j, joints, parents, length, precision):  # type: ignore[no-untyped-def]
    """Add the bones that end in joint j to its normal equations, linearised in the direction they have now."""
    bone = np.empty(3)
    for other in range(len(parents)):
        child = _bone_between(j, other, parents)
        if child < 0 or precision[child] == 0.0 or np.isnan(joints[other, 0]):
            continue
        now, along = max(_distance(joints[j], joints[other]), 1e-9), 0.0
        for r in range(3):
            bone[r] = (joints[j, r] - joints[other, r]) / now
            along += bone[r] * joints[other, r]
        for r in range(3):
            for c in range(3):
                A[r, c] += precision[child] * bone[r] * bone[c]
            b[r] += precision[child] * bone[r] * (along + length[child])


@njit(cache=True)
def _local_posterior(  # type: ignore[no-untyped-def]
    point, j, joints, origins, directions, weights, pixel, sigmas, floor, parents, length, precision
):
    """The terms of the log-posterior that change when joint j moves to ``point``."""
    value = log_likelihood(point, origins, directions[:, j], weights[:, j], pixel, sigmas[j], floor)
    for other in range(len(parents)):
        child = _bone_between(j, other, parents)
        if child >= 0 and precision[child] > 0.0 and not np.isnan(joints[other, 0]):
            value -= 0.5 * precision[child] * (_distance(point, joints[other]) - length[child]) ** 2
    return value


@njit(cache=True)
def _bone_between(j, other, parents):  # type: ignore[no-untyped-def]
    """The child of the two where one is the other's parent, which names the bone; -1 where there is none."""
    if parents[j] == other:
        return j
    return other if parents[other] == j else -1


@njit(cache=True)
def _distance(a, b):  # type: ignore[no-untyped-def]
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
