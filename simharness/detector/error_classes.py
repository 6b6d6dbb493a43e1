"""Error classes of keypoints by their position (Ronchi & Perona, ICCV 2017).

In units of OKS sigma x sqrt(area): good up to 1.14 from the true joint, jitter up to 2.35, a miss beyond. A keypoint
beyond 2.35 is an inversion within 1.14 of the joint's left-right counterpart, and a swap within 1.14 of the same joint
of another person.

Ronchi & Perona give the share of jitters, not how far off they are. On Shelf the jitters of hips and shoulders crowd at
the near end, as the tail of a wide scatter; those of elbows and wrists are everywhere. A truncated exponential
distribution with the measured mean has both (:func:`jitter_distance`): the least informative one for a mean within
bounds.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError

MIRROR = np.array(COCO17.mirror)
"""Left-right counterpart of each COCO-17 joint, (17,)."""

PAIRED = np.arange(len(COCO17)) != MIRROR
"""Which joints have a left-right counterpart, (17,)."""

DISTINGUISHABLE_FROM = GOOD_BELOW + MISS_FROM
"""Distance, in units, from which two places are distinguishable: a keypoint good at one is a miss from the other."""

_MEANS = (0.03, 0.4999)  # between: at less, doubles do not hold the far end; above, the distribution is uniform


def classify(keypoints: ArrayLike, target: ArrayLike, unit: ArrayLike, *, other: ArrayLike | None = None) -> NDArray:
    """Return the error class of each keypoint.

    Args:
        keypoints: COCO-17, (..., 17, 2) pixels; NaN where not reported.
        target: true positions for the detector (with its bias), (..., 17, 2); NaN where unknown.
        unit: OKS sigma x sqrt(area), (..., 17) pixels.
        other: the same joints of the person with whom this one may be swapped, (..., 17, 2); NaN where there is none.

    Returns:
        :class:`KeypointError`, (..., 17) int8; ABSENT where not reported or the target is unknown.
    """
    keypoints, target, unit = (np.asarray(each, float) for each in (keypoints, target, unit))
    away = distance(keypoints, target, unit)
    mirrored = np.where(PAIRED, distance(keypoints, target[..., MIRROR, :], unit), np.inf)
    swapped = np.full(away.shape, np.inf) if other is None else distance(keypoints, np.asarray(other, float), unit)
    error = np.where(away < MISS_FROM, np.int8(KeypointError.JITTER), np.int8(KeypointError.MISS))
    error[away < GOOD_BELOW] = KeypointError.GOOD
    beyond = error == KeypointError.MISS
    inverted = beyond & (mirrored < GOOD_BELOW)
    swap = beyond & (swapped < GOOD_BELOW)
    error[inverted] = KeypointError.INVERSION
    error[swap & ~(inverted & (mirrored <= swapped))] = KeypointError.SWAP
    error[~np.isfinite(away)] = KeypointError.ABSENT
    return error


def distance(keypoints: Floats, target: Floats, unit: Floats) -> Floats:
    """Return distances in units, (...); infinite where either position is unknown."""
    away = keypoints - target
    with np.errstate(invalid="ignore", divide="ignore"):
        result = np.hypot(away[..., 0], away[..., 1]) / unit
    return np.where(np.isfinite(result), result, np.inf)


def distinguishable(one: Floats, other: Floats, unit: Floats) -> Bools:
    """Return which pairs of places are distinguishable, (...); False where either is unknown."""
    between = distance(one, other, unit)
    return (between > DISTINGUISHABLE_FROM) & np.isfinite(between)


def opposite_hits(keypoints: Floats, target: Floats, place: Floats, unit: Floats) -> Bools:
    """Return which keypoints lie opposite to ``place``: as far from the target, in the other direction, (...).

    Where misses go in all directions alike, this is the expected number of misses that fall on ``place`` by chance.
    """
    return distance(keypoints, 2 * target - place, unit) < GOOD_BELOW


def jitter_distance(share: Floats, mean: Floats, *, nearest: float = GOOD_BELOW, farthest: float = MISS_FROM) -> Floats:
    """Return the distances, units, of jitters below which the given shares of all jitters lie.

    Args:
        share: shares, 0 to 1, (n,).
        mean: mean distances as shares of the way from the nearest to the farthest, (n,); 0.5: uniform.
        nearest: least distance; 1.14 of jitters.
        farthest: largest distance; 2.35 of jitters.
    """
    way = share.copy()
    for each in np.unique(mean[mean != 0.5]):
        rate, chosen = _rate(float(each)), mean == each
        way[chosen] = -np.log(1 - share[chosen] + share[chosen] * np.exp(-rate)) / rate
    return np.asarray(nearest + (farthest - nearest) * way)


@cache
def _rate(mean: float) -> float:
    """Return the rate of the exponential distribution, truncated at 1, with a mean other than 0.5."""
    near = np.clip(min(mean, 1 - mean), *_MEANS)
    rate = brentq(lambda x: 1 / x - 1 / np.expm1(x) - near, 1e-6, 2 / near)
    return float(rate if mean < 0.5 else -rate)
