"""Distances of jitters from their joints, between 1.14 and 2.35 units.

Ronchi & Perona (ICCV 2017) give the share of jitters, not how far off they are. On Shelf the jitters of hips and
shoulders crowd at the near end, as the tail of a wide scatter; those of elbows and wrists are everywhere. A truncated
exponential distribution with the measured mean has both: the least informative one for a mean within bounds.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import brentq

from mvpose.arrays import Floats
from simharness.types.truth import GOOD_BELOW, MISS_FROM

_MEANS = (0.03, 0.4999)  # between: at less, doubles do not hold the far end; above, the distribution is uniform


def jitter_distance(share: Floats, mean: Floats) -> Floats:
    """Return the distances, units, of jitters below which the given shares of all jitters lie.

    Args:
        share: shares, 0 to 1, (n,).
        mean: mean distances as shares of the way from 1.14 to 2.35, (n,); 0.5: uniform.
    """
    way = share.copy()
    for each in np.unique(mean[mean != 0.5]):
        rate, chosen = _rate(float(each)), mean == each
        way[chosen] = -np.log(1 - share[chosen] + share[chosen] * np.exp(-rate)) / rate
    return np.asarray(GOOD_BELOW + (MISS_FROM - GOOD_BELOW) * way)


@cache
def _rate(mean: float) -> float:
    """Return the rate of the exponential distribution, truncated at 1, with a mean other than 0.5."""
    near = np.clip(min(mean, 1 - mean), *_MEANS)
    rate = brentq(lambda x: 1 / x - 1 / np.expm1(x) - near, 1e-6, 2 / near)
    return float(rate if mean < 0.5 else -rate)
