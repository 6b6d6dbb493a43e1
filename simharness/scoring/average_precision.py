"""Average precision (AP) of 3D people, as Panoptic is scored (Tu et al., VoxelPose, ECCV 2020).

The estimates of all frames are sorted by descending score, and each is assigned to the nearest person of its frame.
An estimate is correct if the mean joint distance is under the threshold and no estimate with a higher score is correct
for the same person. AP is the area under the precision-recall curve, with each precision replaced by the highest
precision at the same or a higher recall.

Differences from the evaluation released with VoxelPose: estimates with equal scores are added together, so that their
order does not matter; ghosts in frames without people count, while VoxelPose skips such frames; distances are over the
joints that both have; and no epsilon is added to denominators.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.scoring.pairing import mean_where_shared


def nearest_people(truth: Floats, estimate: Floats, frame: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats]:
    """Find the true person nearest to each estimate.

    Args:
        truth: true joints, (T, P, J, 3), metres; NaN where undefined.
        estimate: joints of the estimates of all frames, (k, J, 3), metres; NaN where missing.
        frame: frame of each estimate, (k,).

    Returns:
        Index of the person among the T x P people of all frames, (k,), and mean distance over the joints that both
        have, (k,), metres. If no person shares a joint, the distance is infinite and the index arbitrary.
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
    """Return AP at one threshold, percent; None without true people.

    Args:
        person: person nearest to each estimate, (k,), an index that is unique over all frames.
        distance: distance from that person, (k,).
        score: confidence of each estimate, (k,).
        people: number of true people in all frames.
        threshold: distance under which an estimate can be correct, in the unit of the distances.
    """
    if not people:
        return None
    person, distance, score = np.asarray(person), np.asarray(distance), np.asarray(score)
    order = np.argsort(-score)
    near = order[distance[order] < threshold]
    correct = np.zeros(len(order), bool)
    correct[near[np.unique(person[near], return_index=True)[1]]] = True
    true_positives = np.cumsum(correct[order])
    last = np.flatnonzero(np.diff(score[order], append=np.inf))  # last of each run of equal scores
    precision = np.maximum.accumulate((true_positives[last] / (last + 1))[::-1])[::-1]
    recall_gain = np.diff(true_positives[last], prepend=0) / people
    return 100.0 * float((recall_gain * precision).sum())
