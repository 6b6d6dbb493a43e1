"""Bone lengths of one tracked person: learned over time, and applied to the joints of a moment.

Bones of a person have constant lengths, whatever the population's are, so a track learns them from its own joints; the
published lengths (:mod:`mvpose.reconstruction.bone_length_prior`) are where it starts. The lengths are one piece of
knowledge, not a new one in every frame: they shape the joints that are reported, but not the state that is carried on,
or they would count once for every frame.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.checks import seal
from mvpose.kernels import njit
from mvpose.reconstruction.bone_length_prior import bone_lengths
from mvpose.reconstruction.likelihood import solve
from mvpose.skeleton import Skeleton

_DEFINITION2 = 0.02**2  # m²: variance of the distance of two joints as detectors define them, in one pose
_INDEPENDENT = 1.0  # seconds: poses that are apart as long show the definition of the joints from another side
_LEAST_VARIANCE = 0.01**2  # m²: joints are not points of the body, so no bone is known better
_LEAST_BONES = 5  # whose median ratio is the size of a person
_SIZES = (0.5, 1.25)  # sizes of people by that of the mean adult: from two years of age to 2.1 m
_SWEEPS = 6
_CONVERGED = 1e-6  # m²


class BonePrior(NamedTuple):
    """Bones of a skeleton with published lengths."""

    ends: Integers
    """Joints at both ends, (B, 2); with every bone its mirror image, so that no side is favoured."""
    length: Floats
    """Mean length over adults, (B,), metres."""
    variance: Floats
    """Variance of that length, (B,), square metres."""


@cache
def bone_prior(skeleton: Skeleton) -> BonePrior:
    """Return the bones of a skeleton."""
    length, deviation = bone_lengths(skeleton)
    bones: dict[tuple[int, int], tuple[float, float]] = {}
    for parent, child in skeleton.edges:
        if np.isfinite(deviation[child]):
            for pair in ((parent, child), (skeleton.mirror[parent], skeleton.mirror[child])):
                bones[min(pair), max(pair)] = length[child], deviation[child] ** 2
    ends = np.array(sorted(bones), np.int64).reshape(-1, 2)
    values = np.array([bones[pair] for pair in sorted(bones)]).reshape(-1, 2)
    prior = BonePrior(ends, values[:, 0].copy(), values[:, 1].copy())
    seal(*prior)
    return prior


def scaled_lengths(joints: Floats, prior: BonePrior) -> Floats:
    """Return the lengths, (n, B), metres, from which tracks start: those of adults, scaled to the size of each person.

    The size is the median over the bones of what is measured by what is published, so that children are not stretched.

    Args:
        joints: joints of n people, (n, J, 3), metres; NaN for an unknown joint.
        prior: bones.
    """
    result = np.tile(prior.length, (len(joints), 1))
    if prior.length.size:
        measured = np.linalg.norm(joints[:, prior.ends[:, 0]] - joints[:, prior.ends[:, 1]], axis=2)
        for person, ratio in enumerate(measured / prior.length):
            known = ratio[np.isfinite(ratio)]
            if len(known) >= _LEAST_BONES:
                result[person] *= np.clip(np.median(known), *_SIZES)
    return result


@njit(cache=True, borrows=True)
def learn_lengths(length, variance, state, covariance, ends, dt):
    """Update the bone lengths (B,) and their variances (B,) of one person by its joints, in place.

    Args:
        length: metres.
        variance: square metres.
        state: positions and velocities, (J, 6).
        covariance: their covariances, (J, 6, 6).
        ends: joints at the ends of the bones, (B, 2).
        dt: seconds since the previous update.
    """
    share = min(dt / _INDEPENDENT, 1.0)
    for k in range(len(ends)):
        a, b = ends[k, 0], ends[k, 1]
        if np.isnan(state[a, 0]) or np.isnan(state[b, 0]) or share <= 0.0:
            continue
        x, y, z = state[a, 0] - state[b, 0], state[a, 1] - state[b, 1], state[a, 2] - state[b, 2]
        reach = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        noise = _DEFINITION2 + _along(covariance[a], x / reach, y / reach, z / reach)
        noise = (noise + _along(covariance[b], x / reach, y / reach, z / reach)) / share
        gain = variance[k] / (variance[k] + noise)
        length[k] += gain * (reach - length[k])
        variance[k] = max((1.0 - gain) * variance[k], _LEAST_VARIANCE)


@njit(cache=True)
def constrain(joints, covariance, state, state_covariance, ends, length, variance):
    """Write the joints of one person that are likeliest given their Gaussians and the bone lengths.

    Args:
        joints: output, (J, 3), metres; NaN for an unknown joint.
        covariance: output, their covariances, (J, 3, 3).
        state: positions and velocities, (J, 6).
        state_covariance: their covariances, (J, 6, 6).
        ends: joints at the ends of the bones, (B, 2).
        length: metres, (B,).
        variance: square metres, (B,).
    """
    count = len(state)
    inverses, along, work = np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((9, 3))
    _constrain(joints, covariance, state, state_covariance, ends, length, variance, inverses, along, work)


@njit(cache=True, borrows=True)
def _constrain(joints, covariance, state, state_covariance, ends, length, variance, inverses, along, work):
    """Constrain joints as :func:`constrain`, with working memory."""
    count = len(state)
    A, inverse, b, target, zero = work[:3], work[3:6], work[6], work[7], work[8]
    for j in range(count):
        for r in range(3):
            joints[j, r] = state[j, r]
            for c in range(3):
                covariance[j, r, c] = state_covariance[j, r, c] if not np.isnan(state[j, 0]) else np.nan
    for j in range(count):
        if np.isnan(state[j, 0]):
            continue
        if not solve(state_covariance[j, :3, :3], zero, inverses[j], target):
            return
        for r in range(3):
            for c in range(3):
                along[j, r] += inverses[j, r, c] * state[j, c]
    for sweep in range(_SWEEPS):
        furthest, last = 0.0, sweep == _SWEEPS - 1
        for j in range(count):
            if np.isnan(state[j, 0]):
                continue
            for r in range(3):
                b[r] = along[j, r]
                for c in range(3):
                    A[r, c] = inverses[j, r, c]
            _add_bones(A, b, j, joints, state_covariance, ends, length, variance)
            if not solve(A, b, inverse, target):
                continue
            moved = 0.0
            for r in range(3):
                moved += (target[r] - joints[j, r]) ** 2
                joints[j, r] = target[r]
                for c in range(3):
                    covariance[j, r, c] = inverse[r, c]
            furthest = max(furthest, moved)
        if furthest < _CONVERGED or last:
            break


@njit(cache=True, borrows=True)
def _add_bones(A, b, j, joints, covariance, ends, length, variance):
    """Add the bones that end in a joint, linearised; the uncertainty of the other end adds to that of the length."""
    for k in range(len(ends)):
        if ends[k, 0] != j and ends[k, 1] != j:
            continue
        other = ends[k, 0] + ends[k, 1] - j
        if np.isnan(joints[other, 0]):
            continue
        x, y, z = joints[j, 0] - joints[other, 0], joints[j, 1] - joints[other, 1], joints[j, 2] - joints[other, 2]
        reach = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        x, y, z = x / reach, y / reach, z / reach
        weight = 1.0 / (variance[k] + _DEFINITION2 + _along(covariance[other], x, y, z))
        at = x * joints[other, 0] + y * joints[other, 1] + z * joints[other, 2] + length[k]
        way = x, y, z
        for r in range(3):
            b[r] += weight * way[r] * at
            for c in range(3):
                A[r, c] += weight * way[min(r, c)] * way[max(r, c)]


@njit(cache=True, borrows=True)
def _along(P, x, y, z):
    """Return the variance of a position along a unit vector."""
    return max(
        x * x * P[0, 0]
        + y * y * P[1, 1]
        + z * z * P[2, 2]
        + 2.0 * (x * y * P[0, 1] + x * z * P[0, 2] + y * z * P[1, 2]),
        0.0,
    )
