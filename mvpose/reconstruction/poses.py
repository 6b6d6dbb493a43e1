"""Result type of every reconstruction, and the layout of one person's rays for the kernels."""

from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats
from mvpose.kernels import njit

MISSING_SCORE = 1e-9
"""Score at or below which no view supports a joint: it is reported as missing, even if a prior places it."""


class Poses(NamedTuple):
    """Joints of n people."""

    joints: Floats
    """Positions, (n, J, 3), metres; NaN where a joint could not be placed."""
    scores: Floats
    """Mean over the person's views of the keypoint score times the posterior probability that the keypoint is right,
    (n, J); 0 where a joint could not be placed."""
    covariance: Floats
    """Covariance of each position, (n, J, 3, 3), square metres; NaN where a joint could not be placed."""
    freedom: Floats
    """Degrees of freedom of the multivariate t distribution of its error, (n, J), above 2; NaN where a joint could not
    be placed."""


@njit(cache=True)
def empty_poses(labels, joints):
    """Return uninitialised arrays of :class:`Poses`, in its order, for the people in labels (m,)."""
    people = 0
    for d in range(len(labels)):
        people = max(people, labels[d] + 1)
    shape = (people, joints)
    return np.empty((people, joints, 3)), np.empty(shape), np.empty((people, joints, 3, 3)), np.empty(shape)


@njit(cache=True, borrows=True)
def clear(joints, scores, covariance, freedom):
    """Mark all joints of one person as missing."""
    for j in range(len(scores)):
        scores[j] = 0.0
        freedom[j] = np.nan
        for r in range(3):
            joints[j, r] = np.nan
            for c in range(3):
                covariance[j, r, c] = np.nan


@njit(cache=True)
def gather(labels, person, origins, directions, weights, pixel):
    """Select the n detections of one person and order their rays by joint.

    Returns:
        Origins (n, 3), directions (J, n, K, 3), weights (J, n, K) and angle of a pixel (n,), from arrays whose first
        axes are (m, J, K).
    """
    m, joints, modes = weights.shape
    n = 0
    for d in range(m):
        n += labels[d] == person
    centers, angles = np.empty((n, 3)), np.empty(n)
    rays, scores_2d = np.empty((joints, n, modes, 3)), np.empty((joints, n, modes))
    v = 0
    for d in range(m):
        if labels[d] == person:
            angles[v] = pixel[d]
            for r in range(3):
                centers[v, r] = origins[d, r]
            for j in range(joints):
                for k in range(modes):
                    scores_2d[j, v, k] = weights[d, j, k]
                    for r in range(3):
                        rays[j, v, k, r] = directions[d, j, k, r]
            v += 1
    return centers, rays, scores_2d, angles
