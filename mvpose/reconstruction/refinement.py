"""Local refinement of one person's pose, and the covariance of every joint.

Expectation maximisation alternates between the responsibilities of the keypoints given the joints, and the joints
given the responsibilities; each joint is a 3 x 3 solve with the bones to its neighbours linearised. No step lowers the
posterior. The covariances are the marginals of the Gaussian at the maximum, by belief propagation along the tree, with
the error scale estimated from the person's residuals.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import joint_scales, person_scale
from mvpose.reconstruction.likelihood import ANCHOR, Noise, accumulate, anchor, log_likelihood, solve
from mvpose.reconstruction.limb_direction_prior import direction_log_likelihood
from mvpose.reconstruction.poses import MISSING_SCORE, gather
from mvpose.skeleton import Skeleton


class Tree(NamedTuple):
    """Kinematic tree of a skeleton as arrays for the kernels.

    Attributes:
        parents: parent of each joint, (J,), -1 for the root.
        order: joints in an order with leaves first, (J,).
        neighbours: joints at the other ends of each joint's bones, (J, D), -1 where there are fewer.
        bones: child joint of each of these bones, which identifies the bone, (J, D).
    """

    parents: Integers
    order: Integers
    neighbours: Integers
    bones: Integers


@cache
def tree(skeleton: Skeleton) -> Tree:
    """Return the kinematic tree of a skeleton."""
    ends: list[list[tuple[int, int]]] = [[] for _ in skeleton.joints]
    for parent, child in skeleton.edges:
        ends[child].insert(0, (parent, child))  # the parent first
        ends[parent].append((child, child))
    shape = len(ends), max(map(len, ends))
    neighbours, bones = np.full(shape, -1), np.full(shape, -1)
    for joint, joint_ends in enumerate(ends):
        for slot, (other, child) in enumerate(joint_ends):
            neighbours[joint, slot], bones[joint, slot] = other, child
    parents = np.array(skeleton.parents, np.int64)
    return Tree(parents, leaves_first(parents), neighbours, bones)


def leaves_first(parents: Integers) -> Integers:
    """Return an order of the joints, (J,), in which every child comes before its parent."""
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
    """Move a pose of one person to the nearby maximum of likelihood times bone-length prior.

    Args:
        joints: initial pose, (J, 3), metres; NaN for a joint to leave out.
        rays: rays of the person's n detections.
        skeleton: the J joints.
        noise: error model of keypoints.
        length: mean length of the bone to the parent, (J,), metres.
        deviation: standard deviation of that length, (J,), metres; infinite for no constraint.

    Returns:
        Joints (J, 3), scores (J,) and covariances (J, 3, 3), as :class:`mvpose.reconstruction.poses.Poses`.
    """
    views = gather(
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
    climb(refined, *views, noise.sigmas(skeleton), noise.floor, *skeletal)
    write_uncertainty(
        scores,
        covariance,
        refined,
        *views,
        noise.sigmas(skeleton),
        noise.floor,
        *skeletal,
        np.zeros(len(joints)),
        np.zeros(3),
    )
    return refined, scores, covariance


_SWEEPS = 8
_HALVINGS = 4
_CONVERGED = 1e-6  # m^2
_LONG = 4e-4  # m^2; a step below 2 cm turns no bone by much, so it cannot overshoot


@njit(cache=True)
def climb(
    joints, origins, directions, weights, pixel, sigmas, floor, parents, order, neighbours, bones, length, precision
):
    """Move the joints (J, 3) to a maximum of the posterior, in place; joints that are NaN are skipped."""
    A, b, inverse = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    target, trial = np.empty(3), np.empty(3)
    for _ in range(_SWEEPS):
        furthest = 0.0
        for j in order:
            if np.isnan(joints[j, 0]):
                continue
            anchor(joints[j], A, b)
            accumulate(joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, A, b)
            _add_bones(A, b, j, joints, neighbours, bones, length, precision)
            if not solve(A, b, inverse, target):
                continue
            moved = 0.0
            for r in range(3):
                moved += (target[r] - joints[j, r]) ** 2
            if moved > _LONG:
                # The bones are linearised, so a long step can overshoot: it is taken only if the posterior rises.
                current = _local_posterior(
                    joints[j], j, joints, origins, directions, weights, pixel, sigmas, floor, neighbours, bones,
                    length, precision,
                )  # fmt: skip
                step, climbs = 1.0, False
                for _ in range(_HALVINGS):
                    for r in range(3):
                        trial[r] = joints[j, r] + step * (target[r] - joints[j, r])
                    proposed = _local_posterior(
                        trial, j, joints, origins, directions, weights, pixel, sigmas, floor, neighbours, bones,
                        length, precision,
                    )  # fmt: skip
                    climbs = proposed >= current
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
        if furthest < _CONVERGED:
            break


@njit(cache=True)
def fit_scale(joints, origins, directions, weights, pixel, sigmas, floor):
    """Return the ratio of the person's squared errors to those of the error model, at a pose (J, 3).

    Scaling the variances of the likelihood by this ratio has the same maximum as scaling the precision of the prior
    by it. See :func:`mvpose.reconstruction.error_scale.person_scale`.
    """
    count = len(joints)
    misfit, responsibilities = np.zeros(count), np.zeros(count)
    A, b = np.empty((3, 3)), np.empty(3)
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            A[:] = 0.0
            b[:] = 0.0
            _, responsibilities[j], misfit[j] = accumulate(
                joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, A, b
            )
    return person_scale(misfit, responsibilities)


@njit(cache=True)
def _add_bones(A, b, j, joints, neighbours, bones, length, precision):
    """Add the bones that end in joint j to its normal equations, linearised along their current directions."""
    for slot in range(neighbours.shape[1]):
        other, bone = neighbours[j, slot], bones[j, slot]
        if other < 0 or precision[bone] == 0.0 or np.isnan(joints[other, 0]):
            continue
        x, y, z = joints[j, 0] - joints[other, 0], joints[j, 1] - joints[other, 1], joints[j, 2] - joints[other, 2]
        current = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        x, y, z = x / current, y / current, z / current
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
    """Return the terms of the log-posterior that change when joint j moves to ``point``."""
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
def write_uncertainty(
    scores, covariance, joints, origins, directions, weights, pixel, sigmas, floor, parents, order, neighbours, bones,
    length, precision, concentrations, trunk,
):  # fmt: skip
    """Write scores (J,) and covariances (J, 3, 3) of a pose at the maximum of its posterior.

    A joint that is NaN is skipped, and one that no view supports becomes NaN.
    """
    n, count = len(pixel), len(joints)
    misfit, responsibilities = np.zeros(count), np.zeros(count)
    information, b = np.zeros((count, 3, 3)), np.empty(3)
    for j in range(count):
        if not np.isnan(joints[j, 0]):
            support, responsibilities[j], misfit[j] = accumulate(
                joints[j], origins, directions[j], weights[j], pixel, sigmas[j], floor, 1.0, information[j], b
            )
            if support / n > MISSING_SCORE:
                scores[j] = support / n
            else:  # no view supports it: placed by the prior alone
                for r in range(3):
                    joints[j, r] = np.nan
    scale = joint_scales(misfit, responsibilities)
    for j in range(count):
        for r in range(3):
            for c in range(3):
                information[j, r, c] /= scale[j]
            information[j, r, r] += ANCHOR
    _marginalize(joints, information, covariance, parents, order, precision)
    _add_ambiguity(
        covariance, joints, origins, directions, weights, parents, order, neighbours, precision, concentrations, trunk
    )


@njit(cache=True)
def _marginalize(joints, information, covariance, parents, order, precision):
    """Gaussian belief propagation from the information of each joint (J, 3, 3) to the marginal covariances.

    A bone measures one length, so its message has rank one: along the bone, with the variance of the bone plus that of
    the joint at its other end. Messages go up from the leaves, then down; each leaves out the message that the
    receiver sent.
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
    """Return the information along a bone about the joint at one end, from everything beyond the other end."""
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
def _add_ambiguity(
    covariance, joints, origins, directions, weights, parents, order, neighbours, precision, concentrations, trunk
):
    """Add the depth ambiguity of joints that only one view sees, whose bone also fits at a second depth.

    The second moment around the chosen depth grows by the squared distance between the two depths times the
    probability of the other one (:mod:`mvpose.reconstruction.limb_direction_prior`). Single-view children of such a
    joint inherit its ambiguity. A joint whose child is seen by several views has none.
    """
    count = len(joints)
    mirrored = np.empty(3)
    view, ambiguity = np.full(count, -1), np.zeros(count)  # the only view that sees a joint, and the added variance
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
        depth, parent_depth = 0.0, 0.0
        for r in range(3):
            depth += (joints[j, r] - origins[only, r]) * directions[j, only, 0, r]
            parent_depth += (joints[parent, r] - origins[only, r]) * directions[j, only, 0, r]
        ambiguity[j] = ambiguity[parent]
        if 2.0 * parent_depth - depth > 0.0:  # the other depth, in front of the camera
            for r in range(3):
                mirrored[r] = joints[j, r] + 2.0 * (parent_depth - depth) * directions[j, only, 0, r]
            odds = np.exp(
                direction_log_likelihood(joints[j], joints[parent], True, concentrations[j], trunk)
                - direction_log_likelihood(mirrored, joints[parent], True, concentrations[j], trunk)
            )
            ambiguity[j] += 4.0 * (parent_depth - depth) ** 2 / (1.0 + odds)
        _add_outer(covariance[j], directions[j, only, 0], ambiguity[j])
