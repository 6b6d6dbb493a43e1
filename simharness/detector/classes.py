"""Which error a keypoint has, by where it lies: Ronchi & Perona's classes, ICCV 2017.

In units of OKS sigma x sqrt(area): good up to 1.14 from the true joint, jitter up to 2.35, a miss beyond; unless what
is beyond lies within 1.14 of the joint's left-right counterpart (inversion) or of somebody else's same joint (swap).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from simharness.types.truth import GOOD_BELOW, MISS_FROM, KeypointError

MIRROR = np.array(COCO17.mirror)
"""The left-right counterpart of each of COCO-17, (17,)."""

PAIRED = np.arange(len(COCO17)) != MIRROR
"""Which have one, (17,)."""

APART = GOOD_BELOW + MISS_FROM
"""Units from which two places can be told apart: what is good at one is a miss from the other."""


def classify(keypoints: ArrayLike, target: ArrayLike, unit: ArrayLike, *, other: ArrayLike | None = None) -> NDArray:
    """The class of each keypoint.

    Args:
        keypoints: COCO-17, (..., 17, 2) pixels; NaN where not reported.
        target: where the detector should have found them (its bias included), (..., 17, 2); NaN where unknown.
        unit: OKS sigma x sqrt(area), (..., 17) pixels.
        other: the same joints of the person that they may be mistaken for, (..., 17, 2); NaN where nobody is.

    Returns:
        :class:`KeypointError`, (..., 17) int8; ABSENT where not reported or the target is unknown.
    """
    keypoints, target, unit = (np.asarray(each, float) for each in (keypoints, target, unit))
    own = distance(keypoints, target, unit)
    mirrored = np.where(PAIRED, distance(keypoints, target[..., MIRROR, :], unit), np.inf)
    swapped = np.full(own.shape, np.inf) if other is None else distance(keypoints, np.asarray(other, float), unit)
    error = np.where(own < MISS_FROM, np.int8(KeypointError.JITTER), np.int8(KeypointError.MISS))
    error[own < GOOD_BELOW] = KeypointError.GOOD
    beyond = error == KeypointError.MISS
    inverted = beyond & (mirrored < GOOD_BELOW)
    swap = beyond & (swapped < GOOD_BELOW)
    error[inverted] = KeypointError.INVERSION
    error[swap & ~(inverted & (mirrored <= swapped))] = KeypointError.SWAP
    error[~np.isfinite(own)] = KeypointError.ABSENT
    return error


def distance(keypoints: Floats, target: Floats, unit: Floats) -> Floats:
    """Distances in units, (...); infinite where either is unknown."""
    away = keypoints - target
    with np.errstate(invalid="ignore", divide="ignore"):
        result = np.hypot(away[..., 0], away[..., 1]) / unit
    return np.where(np.isfinite(result), result, np.inf)


def apart(one: Floats, other: Floats, unit: Floats) -> Bools:
    """Which places can be told apart, (...); not where either is unknown."""
    between = distance(one, other, unit)
    return (between > APART) & np.isfinite(between)


def by_chance(keypoints: Floats, target: Floats, place: Floats, unit: Floats) -> Bools:
    """Which keypoints lie as far from the target as ``place`` does, but in the opposite direction, (...).

    As many misses lie there as lie at ``place`` by chance, where misses go all ways alike.
    """
    return distance(keypoints, 2 * target - place, unit) < GOOD_BELOW
