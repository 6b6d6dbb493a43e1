"""Compiled conditional means of joint places: private, on plain arrays, single-threaded."""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit


@njit(cache=True)
def fill_in(
    places: np.ndarray,
    localised: np.ndarray,
    low: np.ndarray,
    share: np.ndarray,
    means: np.ndarray,
    covariances: np.ndarray,
    place_variance: float,
    joint_variance: float,
) -> None:
    """Replace the places of joints that are not localised by their mean given the others, in place.

    The equations of the localised joints are solved by the decomposition of Cholesky, row by row of its upper factor:
    all inner loops run along rows, so that the compiler vectorises them without reordering sums.

    Args:
        places: joints of n people, (n, J, 2), metres from the centre of each person.
        localised: which of them are given, (n, J).
        low: bearing before that of each person, (n,), as index of ``means``; the next follows after the last.
        share: weight of the next bearing, (n,).
        means: mean of x and y of all joints, for each bearing, (B, 2 J).
        covariances: their covariance, (B, 2 J, 2 J).
        place_variance: variance of the centre, added to that of all x and of all y.
        joint_variance: variance of localised joints about their true places.
    """
    count, joints = localised.shape
    factor, solved = np.zeros((2 * joints, 2 * joints)), np.zeros(2 * joints)
    given = np.zeros(2 * joints, np.int64)
    for n in range(count):
        size = 0
        for j in range(joints):
            if localised[n, j]:
                given[size], given[size + 1] = 2 * j, 2 * j + 1
                size += 2
        if size == 2 * joints:
            continue
        one, other, weight = low[n], (low[n] + 1) % len(means), share[n]
        mean, mean_step, before, after = means[one], means[other], covariances[one], covariances[other]
        for i in range(size):
            a = given[i]
            solved[i] = places[n, a // 2, a % 2] - (mean[a] + weight * (mean_step[a] - mean[a]))
            for k in range(i, size):
                b = given[k]
                factor[i, k] = before[a, b] + weight * (after[a, b] - before[a, b])
                factor[i, k] += place_variance if (a - b) % 2 == 0 else 0.0
            factor[i, i] += joint_variance
        for i in range(size):
            scale = 1.0 / math.sqrt(factor[i, i])
            for k in range(i, size):
                factor[i, k] *= scale
            for k in range(i + 1, size):
                lead = factor[i, k]
                for m in range(k, size):
                    factor[k, m] -= lead * factor[i, m]
            solved[i] *= scale
            lead = solved[i]
            for k in range(i + 1, size):
                solved[k] -= lead * factor[i, k]
        for i in range(size - 1, -1, -1):
            total = solved[i]
            for k in range(i + 1, size):
                total -= factor[i, k] * solved[k]
            solved[i] = total / factor[i, i]
        for j in range(joints):
            if localised[n, j]:
                continue
            for axis in range(2):
                a = 2 * j + axis
                total = mean[a] + weight * (mean_step[a] - mean[a])
                for k in range(size):
                    b = given[k]
                    value = before[a, b] + weight * (after[a, b] - before[a, b])
                    total += (value + (place_variance if (a - b) % 2 == 0 else 0.0)) * solved[k]
                places[n, j, axis] = total
