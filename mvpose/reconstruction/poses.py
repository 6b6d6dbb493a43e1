"""What every reconstruction answers with, and how the rays of one person are laid out for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.arrays import Floats

NOBODY = 1e-9
"""Score up to which no view vouches for a joint: it is missing, whatever a prior says of it."""


class Poses(NamedTuple):
    """The joints of n people.

    Attributes:
        joints: (n, J, 3), metres; NaN where a joint could not be placed.
        scores: (n, J): mean over the person's views of score times the posterior that the keypoint is right; 0
            where a joint could not be placed.
        covariance: (n, J, 3, 3), square metres; NaN where a joint could not be placed.
    """

    joints: Floats
    scores: Floats
    covariance: Floats

    @classmethod
    def empty(cls, labels: NDArray[np.int64], joints: int) -> Poses:
        """Room for the people that labels (m,) name, all of it still to be written."""
        people = int(labels.max()) + 1 if len(labels) else 0
        return cls(np.empty((people, joints, 3)), np.empty((people, joints)), np.empty((people, joints, 3, 3)))


@njit(cache=True)
def clear(joints, scores, covariance):
    """Mark all joints of one person as missing."""
    for j in range(len(scores)):
        scores[j] = 0.0
        for r in range(3):
            joints[j, r] = np.nan
            for c in range(3):
                covariance[j, r, c] = np.nan


@njit(cache=True)
def gather(labels, person, origins, directions, weights, pixel):
    """The n detections of one person, joint by joint.

    Returns:
        Origins (n, 3), directions (J, n, K, 3), weights (J, n, K), angle of a pixel (n,); of (m, J, K, ...) given.
    """
    m, joints, modes = weights.shape
    n = 0
    for d in range(m):
        n += labels[d] == person
    mine, angle = np.empty((n, 3)), np.empty(n)
    towards, weight = np.empty((joints, n, modes, 3)), np.empty((joints, n, modes))
    v = 0
    for d in range(m):
        if labels[d] == person:
            angle[v] = pixel[d]
            for r in range(3):
                mine[v, r] = origins[d, r]
            for j in range(joints):
                for k in range(modes):
                    weight[j, v, k] = weights[d, j, k]
                    for r in range(3):
                        towards[j, v, k, r] = directions[d, j, k, r]
            v += 1
    return mine, towards, weight, angle
