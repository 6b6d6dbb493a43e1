"""From a good pose of one person to the nearby best one, and how well every joint of it is known.

Expectation maximisation: which keypoints are right given the joints, then the joints given those, each a 3 x 3 solve
with the bones to its neighbours linearised. No step lowers the posterior. The covariances are the marginals of the
Gaussian there, by belief propagation along the tree, with the errors' scale estimated from the person's residuals.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from mvpose.arrays import Floats, Integers
from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import joint_scales, person_scale
from mvpose.reconstruction.likelihood import LEASH, Noise, accumulate, log_likelihood, solve, tie
from mvpose.reconstruction.limb_direction_prior import how_it_hangs
from mvpose.reconstruction.poses import NOBODY, gather
from mvpose.skeleton import Skeleton


class Tree(NamedTuple):
    """A skeleton for the kernels.

    Attributes:
        parents: (J,), -1 for the root.
        order: the joints, leaves first, (J,).
        neighbours: joints at the other ends of every joint's bones, (J, D), -1 where there are fewer.
        bones: the child of each of these bones, which names it, (J, D).
    """

    parents: Integers
    order: Integers
    neighbours: Integers
    bones: Integers


@cache
def tree(skeleton: Skeleton) -> Tree:
    """Lay a skeleton out for the kernels."""
    ends: list[list[tuple[int, int]]] = [[] for _ in skeleton.joints]
    for parent, child in skeleton.edges:
        ends[child].insert(0, (parent, child))  # the parent first
        ends[parent].append((child, child))
    shape = len(ends), max(map(len, ends))
    neighbours, bones = np.full(shape, -1), np.full(shape, -1)
    for joint, mine in enumerate(ends):
        for slot, (other, child) in enumerate(mine):
            neighbours[joint, slot], bones[joint, slot] = other, child
    parents = np.array(skeleton.parents, np.int64)
    return Tree(parents, leaves_first(parents), neighbours, bones)


def leaves_first(parents: Integers) -> Integers:
    """An order of the joints, (J,), in which every child comes before its parent."""
    depth = np.zeros(len(parents), np.int64)
    for joint in range(len(parents)):
        ancestor = parents[joint]
        while ancestor >= 0:
            depth[joint] += 1
            ancestor = parents[ancestor]
    return np.argsort(-depth, kind="stable")


def refine(
    joints: Floats, rays: Rays, skeleton: Skeleton, *, noise: Noise, length: Floats, deviation: Floats
) -> tuple[Floats, Floats, Floats]:
    """Climb from a pose of one person to the nearby maximum of likelihood times bone-length prior.

    Args:
        joints: where to start, (J, 3), metres; NaN for a joint to leave out.
        rays: the person's, (n, J).
        skeleton: its tree.
        noise: the error model.
        length: mean length of the bone to the parent, (J,), metres.
        deviation: its deviation, (J,), metres; infinite for no constraint.

    Returns:
        Joints (J, 3), scores (J,) and covariances (J, 3, 3), as :class:`mvpose.reconstruction.poses.Poses`.
    """
    mine = gather(
        np.zeros(len(rays), np.int64),
        0,
        rays.origins,
        rays.directions[:, :, None],
        rays.weights[:, :, None],
        noise.pixels * rays.pixel,
    )
    refined, scores = np.array(joints, float), np.zeros(len(joints))
    covariance = np.full((len(joints), 3, 3), np.nan)
    skeletal = (*tree(skeleton), length, 1.0 / deviation**2)
    climb(refined, *mine, noise.sigmas(skeleton), noise.floor, *skeletal)
    judge(
        scores,
        covariance,
        refined,
        *mine,
        noise.sigmas(skeleton),
        noise.floor,
        *skeletal,
        np.zeros(len(joints)),
        np.zeros(3),
    )
    return refined, scores, covariance


_SWEEPS = 8
_HALVINGS = 4
_STILL = 1e-6  # m^2
_LONG = 4e-4  # m^2: a step of 2 cm turns no bone by much, so that it cannot overshoot


@njit(cache=True)
def climb(
    joints, origins, directions, weights, pixel, sigmas, floor, parents, order, neighbours, bones, length, precision
):
    """Move the joints (J, 3) to a maximum of the posterior, in place; NaN is left alone."""
    A, b, inverse = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    target, trial = np.empty(3), np.empty(3)
    for _ in range(_SWEEPS):
        furthest = 0.0
        for j in order:
            if np.isnan(joints[j, 0]):
                continue
            tie(joints[j], A, b)
            accumulate(joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, A, b)
            _add_bones(A, b, j, joints, neighbours, bones, length, precision)
            if not solve(A, b, inverse, target):
                continue
            moved = 0.0
            for r in range(3):
                moved += (target[r] - joints[j, r]) ** 2
            if moved > _LONG:
                # The bones are linearised, so a long step can overshoot: it is taken only if it climbs.
                here = _local_posterior(
                    joints[j], j, joints, origins, directions, weights, pixel, sigmas, floor, neighbours, bones,
                    length, precision,
                )  # fmt: skip
                step, climbs = 1.0, False
                for _ in range(_HALVINGS):
                    for r in range(3):
                        trial[r] = joints[j, r] + step * (target[r] - joints[j, r])
                    there = _local_posterior(
                        trial, j, joints, origins, directions, weights, pixel, sigmas, floor, neighbours, bones,
                        length, precision,
                    )  # fmt: skip
                    climbs = there >= here
                    if climbs:
                        break
                    step *= 0.5
                if not climbs:
                    continue
                for r in range(3):
                    target[r] = trial[r]
            for r in range(3):
                joints[j, r] = target[r]
            furthest = max(furthest, moved)
        if furthest < _STILL:
            break


@njit(cache=True)
def fit_scale(joints, origins, directions, weights, pixel, sigmas, floor):
    """How much larger the person's squared errors are than the model's, at a pose (J, 3).

    Likelihoods with errors so scaled, times the prior, have their maximum where the model's likelihoods have it with a
    prior of so scaled precision. See :func:`mvpose.reconstruction.error_scale.person_scale`.
    """
    count = len(joints)
    misfit, rights = np.zeros(count), np.zeros(count)
    A, b = np.empty((3, 3)), np.empty(3)
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            A[:] = 0.0
            b[:] = 0.0
            _, rights[j], misfit[j] = accumulate(
                joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, A, b
            )
    return person_scale(misfit, rights)


@njit(cache=True)
def _add_bones(A, b, j, joints, neighbours, bones, length, precision):
    """Add the bones that end in joint j to its normal equations, linearised in the direction they have now."""
    for slot in range(neighbours.shape[1]):
        other, bone = neighbours[j, slot], bones[j, slot]
        if other < 0 or precision[bone] == 0.0 or np.isnan(joints[other, 0]):
            continue
        x, y, z = joints[j, 0] - joints[other, 0], joints[j, 1] - joints[other, 1], joints[j, 2] - joints[other, 2]
        now = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        x, y, z = x / now, y / now, z / now
        along = x * joints[other, 0] + y * joints[other, 1] + z * joints[other, 2] + length[bone]
        weight = precision[bone]
        A[0, 0] += weight * x * x
        A[1, 1] += weight * y * y
        A[2, 2] += weight * z * z
        A[0, 1] += weight * x * y
        A[1, 0] += weight * x * y
        A[0, 2] += weight * x * z
        A[2, 0] += weight * x * z
        A[1, 2] += weight * y * z
        A[2, 1] += weight * y * z
        b[0] += weight * x * along
        b[1] += weight * y * along
        b[2] += weight * z * along


@njit(cache=True)
def _local_posterior(
    point, j, joints, origins, directions, weights, pixel, sigmas, floor, neighbours, bones, length, precision
):
    """The terms of the log-posterior that change when joint j moves to ``point``."""
    value = log_likelihood(point, origins, directions[j], weights[j], pixel, sigmas[j], floor)
    for slot in range(neighbours.shape[1]):
        other, bone = neighbours[j, slot], bones[j, slot]
        if other >= 0 and precision[bone] > 0.0 and not np.isnan(joints[other, 0]):
            value -= 0.5 * precision[bone] * (_distance(point, joints[other]) - length[bone]) ** 2
    return value


@njit(cache=True)
def _distance(a, b):
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def judge(
    scores, covariance, joints, origins, directions, weights, pixel, sigmas, floor, parents, order, neighbours, bones,
    length, precision, hang, down,
):  # fmt: skip
    """Write scores (J,) and covariances (J, 3, 3) of a pose at its maximum.

    A joint that is NaN is left alone, and one that no view vouches for becomes NaN.
    """
    n, count = len(pixel), len(joints)
    misfit, rights = np.zeros(count), np.zeros(count)
    information, b = np.zeros((count, 3, 3)), np.empty(3)
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            support, rights[j], misfit[j] = accumulate(
                joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, information[j], b
            )
            if support / n > NOBODY:
                scores[j] = support / n
            else:  # no view vouches for it: invented by the prior
                for r in range(3):
                    joints[j, r] = np.nan
    scale = joint_scales(misfit, rights)
    for j in range(count):
        for r in range(3):
            for c in range(3):
                information[j, r, c] /= scale[j]
            information[j, r, r] += LEASH
    _marginalize(joints, information, covariance, parents, order, precision)
    _add_ambiguity(covariance, joints, origins, directions, weights, parents, order, neighbours, precision, hang, down)


@njit(cache=True)
def _marginalize(joints, information, covariance, parents, order, precision):
    """Gaussian belief propagation: each joint's own information (J, 3, 3) to everybody's covariance.

    A bone measures one length, so its message has rank one: along it, the variance of the bone plus that of what is
    beyond it. Upwards from the leaves, then down, each time without what the receiver itself has said.
    """
    count = len(joints)
    along, upward = np.zeros((count, 3)), np.zeros(count)  # of the bone to the parent
    inverse, b, unused = np.empty((3, 3)), np.zeros(3), np.empty(3)
    for j in order:
        parent = parents[j]
        if parent < 0 or precision[j] == 0.0 or np.isnan(joints[j, 0]) or np.isnan(joints[parent, 0]):
            continue
        reach = max(_distance(joints[j], joints[parent]), 1e-9)
        for r in range(3):
            along[j, r] = (joints[j, r] - joints[parent, r]) / reach
        upward[j] = _message(information[j], along[j], precision[j], inverse, b, unused)
        _add_outer(information[parent], along[j], upward[j])
    for j in order[::-1]:
        if upward[j] > 0.0:
            parent = parents[j]
            _add_outer(information[parent], along[j], -upward[j])
            downward = _message(information[parent], along[j], precision[j], inverse, b, unused)
            _add_outer(information[parent], along[j], upward[j])
            _add_outer(information[j], along[j], downward)
        if not np.isnan(joints[j, 0]) and solve(information[j], b, inverse, unused):
            for r in range(3):
                for c in range(3):
                    covariance[j, r, c] = inverse[r, c]


@njit(cache=True)
def _message(information, along, precision, inverse, b, unused):
    """Information along a bone about the joint at its one end, from all that is beyond its other."""
    if not solve(information, b, inverse, unused):
        return 0.0
    variance = 1.0 / precision
    for r in range(3):
        for c in range(3):
            variance += along[r] * inverse[r, c] * along[c]
    return 1.0 / variance


@njit(cache=True)
def _add_outer(matrix, vector, weight):
    for r in range(3):
        for c in range(3):
            matrix[r, c] += weight * vector[r] * vector[c]


@njit(cache=True)
def _add_ambiguity(covariance, joints, origins, directions, weights, parents, order, neighbours, precision, hang, down):
    """Count in that a joint which one view alone sees may as well be at the other depth where its bone fits.

    The second moment about the chosen depth grows by the squared distance of the two times how likely the other is
    (:mod:`mvpose.reconstruction.limb_direction_prior`). Joints that hang on such a joint inherit its doubt; one that holds a better
    seen joint at its other end has none.
    """
    count = len(joints)
    mirrored = np.empty(3)
    view, doubt = np.full(count, -1), np.zeros(count)  # the only view of a joint
    for j in range(count):
        views = 0
        for v in range(weights.shape[1]):
            if weights[j, v, 0] > 0.0:
                views, view[j] = views + 1, v
        if views != 1 or np.isnan(joints[j, 0]):
            view[j] = -1
    for j in order[::-1]:
        parent, only = parents[j], view[j]
        if only < 0 or parent < 0 or precision[j] == 0.0 or np.isnan(joints[parent, 0]):
            continue
        held = False
        for slot in range(neighbours.shape[1]):
            other = neighbours[j, slot]
            held = held or (other >= 0 and other != parent and view[other] < 0 and not np.isnan(joints[other, 0]))
        if held:
            continue
        here, anchor = 0.0, 0.0
        for r in range(3):
            here += (joints[j, r] - origins[only, r]) * directions[j, only, 0, r]
            anchor += (joints[parent, r] - origins[only, r]) * directions[j, only, 0, r]
        doubt[j] = doubt[parent]
        if 2.0 * anchor - here > 0.0:  # the other depth, in front of the camera
            for r in range(3):
                mirrored[r] = joints[j, r] + 2.0 * (anchor - here) * directions[j, only, 0, r]
            odds = np.exp(
                how_it_hangs(joints[j], joints[parent], True, hang[j], down)
                - how_it_hangs(mirrored, joints[parent], True, hang[j], down)
            )
            doubt[j] += 4.0 * (anchor - here) ** 2 / (1.0 + odds)
        _add_outer(covariance[j], directions[j, only, 0], doubt[j])
