"""Multi-way matching as constrained correlation clustering: the integer problem itself, fast.

Where P is consistent its nuclear norm is m whatever the grouping, so in the limit of a large lambda the paper's problem
is to partition the detections, at most one of a view in a part, so that the affinities less alpha within parts sum to
the most. Greedy edge contraction (Keuper et al., "Efficient decomposition of image and mesh graphs by lifted
multicuts", ICCV 2015) joins the best two parts while that gains. Then one view after another is taken out and put back
by the best assignment of its detections to the parts of the others, and parts are joined, until nothing gains; with two
views this is the Hungarian algorithm.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

_LEAST_GAIN = 1e-9  # less is rounding, and could go round in circles
_MOST_PASSES = 50


def cluster(affinity: NDArray[np.float64], view: NDArray[np.int64], *, alpha: float = 0.5) -> NDArray[np.int64]:
    """Partition the detections.

    Args:
        affinity: (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        alpha: what a match must earn.

    Returns:
        A part for every detection, (m,): arbitrary names, at most one detection of a view in a part.
    """
    same_view = view[:, None] == view[None, :]
    gain = np.where(same_view, 0.0, affinity - alpha)
    part = _join(np.arange(len(view)), gain, same_view)
    value = _value(part, gain)
    for _ in range(_MOST_PASSES):
        moved = part
        for one in np.unique(view):
            moved = _put_back(moved, gain, view == one)
        moved = _join(moved, gain, same_view)
        before, value = value, _value(moved, gain)
        if value < before + _LEAST_GAIN:
            break
        part = moved
    return part


def _value(part: NDArray[np.int64], gain: NDArray[np.float64]) -> float:
    return float(gain[part[:, None] == part[None, :]].sum())


def _put_back(part: NDArray[np.int64], gain: NDArray[np.float64], mine: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Assign the detections of one view to the parts of the others, at most one to each, for the greatest gain."""
    names = np.unique(part[~mine])
    members = (part[:, None] == names) & ~mine[:, None]
    gains = gain[mine] @ members
    rows, columns = linear_sum_assignment(np.maximum(gains, 0.0), maximize=True)
    taken = gains[rows, columns] > 0
    result, index = part.copy(), np.flatnonzero(mine)
    result[index] = len(part) + index  # alone, unless assigned
    result[index[rows[taken]]] = names[columns[taken]]
    return result


def _join(part: NDArray[np.int64], gain: NDArray[np.float64], same_view: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Contract parts as long as that gains."""
    names, index = np.unique(part, return_inverse=True)
    members = (index[:, None] == np.arange(len(names))).astype(float)
    return _contract(members.T @ gain @ members, members.T @ same_view @ members > 0)[index]


@njit(cache=True)
def _contract(between, conflict):  # type: ignore[no-untyped-def]
    """Join the two parts with the greatest positive gain until there are none; both matrices are used up.

    Each part remembers its best partner, so a contraction costs one row and not the whole matrix.
    """
    m = len(between)
    part = np.arange(m)
    alive = np.ones(m, np.bool_)
    partner = np.full(m, -1, np.int64)
    for i in range(m):
        partner[i] = _best(i, between, conflict, alive)
    while True:
        best, keep = _LEAST_GAIN, -1
        for i in range(m):
            if alive[i] and partner[i] >= 0 and between[i, partner[i]] > best:
                best, keep = between[i, partner[i]], i
        if keep < 0:
            return part
        gone = partner[keep]
        alive[gone] = False
        for k in range(m):
            if part[k] == gone:
                part[k] = keep
            between[keep, k] += between[gone, k]
            between[k, keep] = between[keep, k]
            conflict[keep, k] = conflict[keep, k] or conflict[gone, k]
            conflict[k, keep] = conflict[keep, k]
        for i in range(m):
            if not alive[i]:
                continue
            if i == keep or partner[i] == keep or partner[i] == gone:
                partner[i] = _best(i, between, conflict, alive)
            elif not conflict[i, keep] and (partner[i] < 0 or between[i, keep] > between[i, partner[i]]):
                partner[i] = keep


@njit(cache=True)
def _best(i, between, conflict, alive):  # type: ignore[no-untyped-def]
    partner = -1
    for j in range(len(between)):
        if j != i and alive[j] and not conflict[i, j] and (partner < 0 or between[i, j] > between[i, partner]):
            partner = j
    return partner
