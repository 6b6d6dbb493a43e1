"""Rounding of a relaxed permutation matrix to people: the paper's threshold of 1/2, made cycle-consistent."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import seal
from mvpose.kernels import njit
from mvpose.ordering import rank_views


def round_to_people(P: NDArray[np.float64], view: NDArray[np.int64], *, threshold: float = 0.5) -> NDArray[np.int64]:
    """Group detections whose P exceeds the threshold, with at most one detection per view in a group.

    Pairs are joined in order of decreasing P; a pair that would put two detections of one view into a group is
    skipped. Where P is cycle-consistent the result is exactly P > threshold; elsewhere the weakest links are dropped.

    Args:
        P: relaxed permutation matrix, (m, m), symmetric.
        view: camera of each row, (m,).
        threshold: value that P of a match must exceed.

    Returns:
        Person of each detection, (m,), numbered by first detection; -1 for a detection that matches no other.
    """
    first, second, value = _pairs_above(read_only(P, np.float64), float(threshold))
    descending = np.argsort(-value, kind="stable")
    return number_people(_join_pairs(first[descending], second[descending], read_only(view, np.int64)))


def number_people(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """Renumber groups, (m,) with values 0 to m - 1, as 0, 1, ... by first member; groups of one become -1."""
    labels = _number_people(read_only(group, np.int64))
    seal(labels)
    return labels


def read_only(array: ArrayLike, dtype: type[np.generic]) -> NDArray:
    """Return a read-only C-contiguous array, so that numba does not compile kernels again for other array types."""
    result = np.ascontiguousarray(array, dtype)
    if result.flags.writeable:
        result = result.view()
        result.flags.writeable = False
    return result


@njit(cache=True)
def _pairs_above(P, threshold):
    """Return the rows and columns of the upper triangle with a value above the threshold, and the values, (k,) each."""
    m, count = len(P), 0
    first, second, value = np.empty(m * m // 2, np.int64), np.empty(m * m // 2, np.int64), np.empty(m * m // 2)
    for i in range(m):
        for j in range(i + 1, m):
            if P[i, j] > threshold:
                first[count], second[count], value[count] = i, j, P[i, j]
                count += 1
    return first[:count], second[:count], value[:count]


@njit(cache=True)
def _join_pairs(first, second, view):
    m = len(view)
    rank, views = rank_views(view)
    group = np.arange(m)
    seen = np.zeros((m, views), np.bool_)
    for i in range(m):
        seen[i, rank[i]] = True
    for k in range(len(first)):
        kept, absorbed = group[first[k]], group[second[k]]
        fits = kept != absorbed
        for r in range(views):
            fits = fits and not (seen[kept, r] and seen[absorbed, r])
        if fits:
            for r in range(views):
                seen[kept, r] = seen[kept, r] or seen[absorbed, r]
            for i in range(m):
                if group[i] == absorbed:
                    group[i] = kept
    return group


@njit(cache=True)
def _number_people(group):
    m = len(group)
    size, number, people = np.zeros(m, np.int64), np.full(m, -1, np.int64), 0
    for i in range(m):
        size[group[i]] += 1
    labels = np.empty(m, np.int64)
    for i in range(m):
        if size[group[i]] > 1 and number[group[i]] < 0:
            number[group[i]] = people
            people += 1
        labels[i] = number[group[i]]
    return labels
