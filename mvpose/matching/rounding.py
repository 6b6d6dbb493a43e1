"""From a relaxed permutation matrix to people: the paper's threshold at 1/2, made consistent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
    m = len(view)
    group = np.arange(m)
    first, second = np.nonzero(np.triu(threshold < P, k=1))
    for k in np.argsort(-P[first, second], kind="stable"):
        mine, other = group[first[k]], group[second[k]]
        if mine != other:
            views = np.concatenate([view[group == mine], view[group == other]])
            if len(np.unique(views)) == len(views):
                group[group == max(mine, other)] = min(mine, other)
    return number_people(group)


def number_people(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """Renumber arbitrary group names (m,) as 0, 1, ... by first member; groups of one become -1."""
    labels = np.full(len(group), -1, dtype=np.int64)
    people = 0
    for name in dict.fromkeys(group.tolist()):
        members = group == name
        if members.sum() > 1:
            labels[members] = people
            people += 1
    return labels
