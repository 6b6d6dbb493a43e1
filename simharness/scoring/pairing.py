"""One-to-one pairs of true and estimated 3D people: found and missed people, ghosts, and the error of each pair.

People are paired by the Hungarian method on mean joint distance. A distance over 500 mm makes no pair (the rule of
Panoptic's recall, Tu et al., ECCV 2020).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import as_array

LIMIT = 0.5
"""Largest mean joint distance of a pair, metres."""


@dataclass(frozen=True)
class Pairing:
    """True people of one frame and the estimates paired with them."""

    estimate: Integers
    """Index of the estimate paired with each true person, (P,); -1 where the person is missed or absent."""
    error: Floats
    """MPJPE of each pair over the joints that both have, (P,), metres; NaN without a pair."""
    present: Bools
    """Which of the P people are in the frame, that is have at least one defined joint, (P,)."""

    def owners(self, count: int) -> Integers:
        """Return the true person of each of ``count`` estimates, (n,); -1 for a ghost."""
        owner = np.full(count, -1)
        owner[self.estimate[self.estimate >= 0]] = np.flatnonzero(self.estimate >= 0)
        return owner


def pair(truth: ArrayLike, estimate: ArrayLike, *, limit: float = LIMIT) -> Pairing:
    """Pair the people of one frame: the largest number of pairs within the limit, at the least total distance.

    Args:
        truth: joints, (P, J, 3), metres; NaN where undefined. A person without any defined joint is absent.
        estimate: joints, (n, J, 3), metres; NaN where missing.
        limit: largest mean joint distance of a pair, metres.

    Raises:
        ValueError: a wrong shape, or different skeletons.
    """
    truth = as_array(truth, ("P", "J", 3), "truth")
    estimate = as_array(estimate, ("n", truth.shape[1], 3), "estimate")
    distance = mean_distances(truth, estimate)
    partner = assign(distance, limit=limit)
    rows = np.flatnonzero(partner >= 0)
    error = np.full(len(truth), np.nan)
    error[rows] = distance[rows, partner[rows]]
    present = np.isfinite(truth).all(axis=-1).any(axis=-1)
    return Pairing(partner, error, present)


def assign(distance: Floats, *, limit: float = LIMIT) -> Integers:
    """Return the estimate paired with each true person, (P,), -1 for none, from their distances (P, n) in metres."""
    # A pair over the limit costs more than any change among the allowed pairs can save.
    forbidden = 1.0 + 2.0 * limit * min(distance.shape)
    rows, columns = linear_sum_assignment(np.where(distance <= limit, distance, forbidden))
    allowed = distance[rows, columns] <= limit
    partner = np.full(len(distance), -1)
    partner[rows[allowed]] = columns[allowed]
    return partner


def placed_joints(partner: Integers, joints: Floats) -> Floats:
    """Return the joints of the estimate paired with each true person, (P, J, 3), from those of all, (n, J, 3).

    They are NaN where the person is missed, whose partner is -1.
    """
    result, found = np.full((len(partner), *joints.shape[1:]), np.nan), partner >= 0
    result[found] = joints[partner[found]]
    return result


def mean_distances(truth: Floats, estimate: Floats) -> Floats:
    """Return the mean distance of each true person from each estimate, over the joints that both have.

    Args:
        truth: joints, (P, J, 3), metres; NaN where undefined.
        estimate: joints, (n, J, 3), metres; NaN where missing.

    Returns:
        Distances, (P, n), metres; infinite where the two share no joint.
    """
    return mean_where_shared(np.linalg.norm(truth[:, None] - estimate[None], axis=-1))


def mean_where_shared(distance: Floats) -> Floats:
    """Return the mean over joints of distances (..., J), without those that are NaN; infinite where all are NaN."""
    shared = np.isfinite(distance)
    count = shared.sum(axis=-1)
    total = np.where(shared, distance, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.inf)
