"""One-to-one scores of 3D people: who was found, who was missed, who was made up, and how far off.

True and estimated people are paired by the Hungarian method on mean joint distance; a pair further apart than
500 mm is none (the rule of Panoptic's recall, Tu et al., ECCV 2020).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from mvpose.checks import as_array
from simharness.pairing.distance import mean_distances

LIMIT = 0.5  # metres


@dataclass(frozen=True)
class Pairing:
    """True people of one frame and the estimates that are theirs.

    Attributes:
        estimate: index of the estimate of every true person, (P,); -1 where missed or not there.
        error: MPJPE of the pair over the joints that both have, (P,), metres; NaN where there is no pair.
        present: which of the P are there, that is have at least one defined joint, (P,).
        estimates: how many estimates there are.
    """

    estimate: NDArray[np.int64]
    error: NDArray[np.float64]
    present: NDArray[np.bool_]
    estimates: int

    @property
    def people(self) -> int:
        """True people who are there."""
        return int(self.present.sum())

    @property
    def found(self) -> int:
        """True people with an estimate of their own."""
        return int((self.estimate >= 0).sum())

    @property
    def missed(self) -> int:
        """True people without one."""
        return self.people - self.found

    @property
    def ghosts(self) -> int:
        """Estimates that are nobody's."""
        return self.estimates - self.found


def pair(truth: ArrayLike, estimate: ArrayLike, *, limit: float = LIMIT) -> Pairing:
    """Pair the people of one frame: as many pairs as the limit allows, at the least total distance.

    Args:
        truth: (P, J, 3), metres; NaN where undefined. A person without any defined joint is not there.
        estimate: (n, J, 3), metres; NaN where missing.
        limit: the largest mean joint distance of a pair, metres.

    Raises:
        ValueError: a wrong shape, or two skeletons.
    """
    truth = as_array(truth, ("P", "J", 3), "truth")
    estimate = as_array(estimate, ("n", truth.shape[1], 3), "estimate")
    distance = mean_distances(truth, estimate)
    # A pair over the limit costs more than any change among the allowed ones can save.
    forbidden = 1.0 + 2.0 * limit * min(distance.shape)
    rows, columns = linear_sum_assignment(np.where(distance <= limit, distance, forbidden))
    allowed = distance[rows, columns] <= limit
    rows, columns = rows[allowed], columns[allowed]
    partner, error = np.full(len(truth), -1), np.full(len(truth), np.nan)
    partner[rows] = columns
    error[rows] = distance[rows, columns]
    present = np.isfinite(truth).all(axis=-1).any(axis=-1)
    return Pairing(partner, error, present, len(estimate))
