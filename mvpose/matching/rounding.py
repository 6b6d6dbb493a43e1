"""From a relaxed permutation matrix to people: the paper's threshold at 1/2, made consistent."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import seal


def round_to_people(P: NDArray[np.float64], view: NDArray[np.int64], *, threshold: float = 0.5) -> NDArray[np.int64]:
    """Group detections whose P exceeds the threshold, at most one detection of a view in a group.

    Pairs are joined from the surest down; a pair that would put two detections of one view into a group is
    refused. Where P is cycle-consistent this is exactly P > threshold; where it is not, the weakest links break.

    Args:
        P: (m, m), symmetric.
        view: camera of each row, (m,).
        threshold: the least P of a match.

    Returns:
        Person of each detection, numbered by their first detection, -1 where a detection matches no other, (m,).
    """
    first, second = np.nonzero(np.triu(threshold < P, k=1))
    surest = np.argsort(-P[first, second], kind="stable")
    return number_people(_join_pairs(first[surest], second[surest], read_only(view, np.int64)))


def number_people(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """Renumber group names 0 to m - 1, (m,), as 0, 1, ... by first member; groups of one become -1."""
    labels = _number_people(read_only(group, np.int64))
    seal(labels)
    return labels


def read_only(array: ArrayLike, dtype: type[np.generic]) -> NDArray:
    """The same numbers as a read-only C-contiguous array: numba compiles a kernel anew for any other kind."""
    result = np.ascontiguousarray(array, dtype)
    if result.flags.writeable:
        result = result.view()
        result.flags.writeable = False
    return result


@njit(cache=True)
def rank_views(view):
    """Number the views 0, 1, ... by their first detection: the number of each detection's view, and how many."""
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
def _join_pairs(first, second, view):
    m = len(view)
    rank, views = rank_views(view)
    group = np.arange(m)
    seen = np.zeros((m, views), np.bool_)
    for i in range(m):
        seen[i, rank[i]] = True
    for k in range(len(first)):
        keep, gone = group[first[k]], group[second[k]]
        fits = keep != gone
        for r in range(views):
            fits = fits and not (seen[keep, r] and seen[gone, r])
        if fits:
            for r in range(views):
                seen[keep, r] = seen[keep, r] or seen[gone, r]
            for i in range(m):
                if group[i] == gone:
                    group[i] = keep
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
