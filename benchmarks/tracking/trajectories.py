"""Trajectories of estimates: linked from frame to frame by distance, how long they live, and how they shake."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from mvpose import Estimate
from mvpose.arrays import Floats, Integers
from mvpose.skeleton import coco17_to_shelf14
from simharness.scoring.pairing import pair

_ONE_PERSON = 0.5  # metres: distance between estimates of one person in frames that follow each other
_SHORT = 5  # frames: a track that lives fewer is a ghost


def link(estimates: Sequence[Estimate]) -> list[Estimate]:
    """Return estimates with the identity of the nearest person of the latest frame that has people, one to one."""
    result: list[Estimate] = []
    before, known, count = np.empty((0, 0, 3)), np.empty(0, np.int64), 0
    for estimate in estimates:
        ids = np.full(len(estimate), -1)
        if len(before) and len(estimate):
            distance = _mean_distances(estimate.joints, before)
            for row, column in zip(*linear_sum_assignment(distance), strict=True):
                if distance[row, column] < _ONE_PERSON:
                    ids[row] = known[column]
        new = ids < 0
        ids[new] = count + np.arange(new.sum())
        count += int(new.sum())
        if len(estimate):
            before, known = estimate.joints, ids
        result.append(replace(estimate, ids=ids))
    return result


def _mean_distances(one: Floats, other: Floats) -> Floats:
    """Return the mean distances (n, k), metres, of the joints that two poses have; 1 km if they have none."""
    distance = np.linalg.norm(one[:, None] - other[None], axis=-1)
    known = np.isfinite(distance)
    mean = np.where(known, distance, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
    return np.where(known.any(axis=-1), mean, 1e3)


def short_ghosts(truth: Floats, estimates: Sequence[Estimate]) -> float:
    """Return the number of estimates in a frame that are no annotated person, and whose track lives under five frames.

    Args:
        truth: joints of the annotated people on SHELF14, (F, A, 14, 3), metres; NaN where undefined.
        estimates: estimates on COCO-17 with identities, F.
    """
    lives, ghosts = Counter[int](), Counter[int]()
    for people, estimate in zip(truth, estimates, strict=True):
        ids = _ids(estimate)
        lives.update(ids.tolist())
        paired = pair(people, coco17_to_shelf14(estimate.joints)).estimate
        ghosts.update(np.delete(ids, paired[paired >= 0]).tolist())
    return sum(count for identity, count in ghosts.items() if lives[identity] < _SHORT) / len(estimates)


def second_differences(estimates: Sequence[Estimate]) -> Floats:
    """Return the second differences of all joints of people in three frames that follow each other, (k,), metres."""
    found = [np.empty(0)]
    for first, middle, last in zip(estimates, estimates[1:], estimates[2:], strict=False):
        in_both, before, here = np.intersect1d(_ids(first), _ids(middle), return_indices=True)
        _, row, after = np.intersect1d(in_both, _ids(last), return_indices=True)
        change = first.joints[before[row]] - 2.0 * middle.joints[here[row]] + last.joints[after]
        found.append(np.linalg.norm(change, axis=-1).ravel())
    values = np.concatenate(found)
    return values[np.isfinite(values)]


def _ids(estimate: Estimate) -> Integers:
    assert estimate.ids is not None, "trajectories need identities"
    return estimate.ids
