"""How far apart true and estimated people are."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats


def mean_distances(truth: Floats, estimate: Floats) -> Floats:
    """Mean distance of the joints that both have, of every true person to every estimate.

    Args:
        truth: (P, J, 3), metres; NaN where undefined.
        estimate: (n, J, 3), metres; NaN where missing.

    Returns:
        (P, n), metres; infinite where the two share no joint.
    """
    return mean_where_shared(np.linalg.norm(truth[:, None] - estimate[None], axis=-1))


def mean_where_shared(distance: Floats) -> Floats:
    """Mean over joints of distances (..., J) that are NaN where one of the two is missing; infinite where all are."""
    shared = np.isfinite(distance)
    count = shared.sum(axis=-1)
    total = np.where(shared, distance, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.inf)
