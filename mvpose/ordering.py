"""Canonical order of the detections of a frame, so that results do not depend on the order in which they are given.

Ties, local optima and the last digits of sums depend on the order in which detections and views are visited. So the
pipeline sorts the detections by what they show before any other stage, and visits the views in the order of their first
detections. The order follows from pixels and scores alone. It is the same for any order of detections or cameras, for
any world frame, and for a mirrored scene or skeleton, because it starts from the height in the picture.
"""

import numpy as np

from mvpose.arrays import Integers
from mvpose.kernels import njit


def number_views(view: Integers) -> Integers:
    """Number views 0, 1, ... by first detection; return the number of the view of each detection, (m,)."""
    return rank_views(view)[0]


@njit(cache=True)
def chosen_pairs(pairs, chosen):
    """Return the rows and columns of a matrix (m, m) for chosen detections (k,), in their order, (k, k)."""
    result = np.empty((len(chosen), len(chosen)))
    for i in range(len(chosen)):
        for j in range(len(chosen)):
            result[i, j] = pairs[chosen[i], chosen[j]]
    return result


@njit(cache=True)
def restored_pairs(pairs, chosen, count):
    """Return a matrix of chosen detections (k, k) as one of all detections (count, count), 1 on the diagonal."""
    result = np.eye(count)
    for i in range(len(chosen)):
        for j in range(len(chosen)):
            result[chosen[i], chosen[j]] = pairs[i, j]
    return result


@njit(cache=True)
def rank_views(view):
    """Number the views 0, 1, ... by first detection; return the number for each detection, (m,), and the count."""
    m = len(view)
    rank, seen, views = np.empty(m, np.int64), np.empty(m, np.int64), 0
    for i in range(m):
        r = 0
        while r < views and seen[r] != view[i]:
            r += 1
        if r == views:
            seen[r] = view[i]
            views += 1
        rank[i] = r
    return rank, views


@njit(cache=True)
def canonical_order(keypoints, weights, box_scores):
    """Return the indices of the detections with a keypoint, from the top to the bottom of their pictures.

    Detections of equal mean height are ordered by score, then by column. Those that agree in all of this are taken to
    be copies of each other.

    Args:
        keypoints: pixels, (m, J, 2).
        weights: scores of the keypoints that have a viewing ray, (m, J).
        box_scores: confidence of each box, (m,).
    """
    m, joints = weights.shape
    keys, order, filled = np.empty((m, 4)), np.empty(m, np.int64), 0
    for d in range(m):
        column, row, score, count = 0.0, 0.0, 0.0, 0.0
        for j in range(joints):
            if weights[d, j] > 0.0:
                column += keypoints[d, j, 0]
                row += keypoints[d, j, 1]
                score += weights[d, j]
                count += 1.0
        if count > 0.0:
            keys[d, 0], keys[d, 1], keys[d, 2], keys[d, 3] = row / count, -score, -box_scores[d], column / count
            low, high = 0, filled  # the place after all detections that do not come later
            while low < high:
                middle = (low + high) // 2
                low, high = (low, middle) if _precedes(keys, d, order[middle]) else (middle + 1, high)
            for place in range(filled, low, -1):
                order[place] = order[place - 1]
            order[low] = d
            filled += 1
    return order[:filled].copy()


@njit(cache=True, borrows=True)
def _precedes(keys, one, other):
    """Return whether one row of the keys (m, 4) comes before another in lexicographic order."""
    for k in range(4):
        if keys[one, k] != keys[other, k]:
            return keys[one, k] < keys[other, k]
    return False
