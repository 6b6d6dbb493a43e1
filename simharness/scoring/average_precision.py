"""Average precision of 3D people, as Panoptic is scored (Tu et al., VoxelPose, ECCV 2020).

The estimates of all frames together, the surest first, each claim the nearest true person of their frame. A claim is
right if the mean joint distance is under the threshold and nobody surer had a right claim to that person. AP is the
area under precision against recall, each precision raised to the best of any higher recall.

Where this departs from the evaluation released with VoxelPose: estimates with the same score come in together, so that
their order does not matter; ghosts in frames without people count, where the other leaves such frames out; distances
are over the joints that both have; and nothing is added to denominators.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.pairing.distance import mean_where_shared


def nearest_people(truth: Floats, estimate: Floats, frame: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats]:
    """The true person that each estimate is nearest to.

    Args:
        truth: (T, P, J, 3), metres; NaN where undefined.
        estimate: those of all frames, (k, J, 3), metres; NaN where missing.
        frame: of each estimate, (k,).

    Returns:
        Their index among the T x P people of all frames, (k,), and the mean distance of the joints that both have,
        (k,), metres. Infinite, of no particular person, where no person shares a joint.
    """
    people = truth.shape[1]
    if not people:
        return np.zeros(len(frame), np.int64), np.full(len(frame), np.inf)
    distance = mean_where_shared(np.linalg.norm(truth[frame] - estimate[:, None], axis=-1))  # (k, P)
    nearest = distance.argmin(axis=1)
    return frame * people + nearest, distance[np.arange(len(frame)), nearest]


def average_precision(
    person: ArrayLike, distance: ArrayLike, score: ArrayLike, *, people: int, threshold: float
) -> float | None:
    """AP at one threshold, percent; None where there is nobody to find.

    Args:
        person: whom each estimate is nearest to, (k,), an index that no two people of any frames share.
        distance: from that person, (k,).
        score: how sure each estimate is, (k,).
        people: how many true people there are in all frames.
        threshold: a right claim is under it; in the unit of the distances.
    """
    if not people:
        return None
    person, distance, score = np.asarray(person), np.asarray(distance), np.asarray(score)
    order = np.argsort(-score)
    near = order[distance[order] < threshold]
    right = np.zeros(len(order), bool)
    right[near[np.unique(person[near], return_index=True)[1]]] = True
    so_far = np.cumsum(right[order])
    last = np.flatnonzero(np.diff(score[order], append=np.inf))  # of those with the same score
    precision = np.maximum.accumulate((so_far[last] / (last + 1))[::-1])[::-1]
    gained = np.diff(so_far[last], prepend=0) / people
    return 100.0 * float((gained * precision).sum())
