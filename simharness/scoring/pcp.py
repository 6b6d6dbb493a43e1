"""Percentage of correct parts (PCP), as Shelf and Campus are scored.

SHELF14 has ten parts. A part is correct if the mean of the errors of its two ends is at most half its true length
(Belagiannis et al., CVPR 2014; as used by Dong et al., CVPR 2019). Every true person is compared with the nearest
estimate; one estimate may be used for two people, and an unused estimate costs nothing. So PCP ignores ghosts: read it
together with the scores of :mod:`simharness.scoring.pairing`.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats, Integers

ALPHA = 0.5
"""Largest mean error of the two ends of a correct part, as a share of the part's true length."""

PARTS = (
    "right_lower_leg", "right_upper_leg", "left_upper_leg", "left_lower_leg",
    "right_lower_arm", "right_upper_arm", "left_upper_arm", "left_lower_arm", "head", "torso",
)  # fmt: skip
"""Names of the ten parts, in the published order."""

GROUPS: dict[str, tuple[int, ...]] = {
    "head": (8,),
    "torso": (9,),
    "upper_arms": (5, 6),
    "lower_arms": (4, 7),
    "upper_legs": (1, 2),
    "lower_legs": (0, 3),
}
"""Groups of parts that tables report together, by index into :data:`PARTS`."""

_ENDS = np.array([[0, 1], [1, 2], [3, 4], [4, 5], [6, 7], [7, 8], [9, 10], [10, 11], [12, 13]])
_HIPS, _HEAD_BOTTOM = (2, 3), 12


class Part(IntEnum):
    """State of one part of one true person."""

    UNDEFINED = -1  # an end is missing in the truth: not counted
    WRONG = 0
    CORRECT = 1


def part_states(truth: Floats, compared: Floats) -> NDArray[np.int8]:
    """Return the :class:`Part` values of people, (..., 10), each compared with one estimate.

    Args:
        truth: joints on SHELF14, (..., 14, 3), metres; NaN where undefined.
        compared: joints of the estimate of each person, (..., 14, 3), metres; NaN where missing.
    """
    true_ends = part_ends(truth)
    length = np.linalg.norm(true_ends[..., 1, :] - true_ends[..., 0, :], axis=-1)
    error = np.linalg.norm(part_ends(compared) - true_ends, axis=-1).mean(axis=-1)
    correct = error <= ALPHA * length  # False where an end is missing
    return np.where(np.isnan(length), Part.UNDEFINED, correct).astype(np.int8)


def nearest(distance: Floats) -> Integers:
    """Return the nearest estimate of each person, (...), -1 where there is none, from mean joint distances (..., n)."""
    if distance.shape[-1] == 0:
        return np.full(distance.shape[:-1], -1)
    return np.where(np.isfinite(distance).any(axis=-1), distance.argmin(axis=-1), -1)


def part_ends(joints: Floats) -> Floats:
    """Return the two ends of every part, (..., 10, 2, 3), from joints on SHELF14, (..., 14, 3)."""
    torso = np.stack([joints[..., _HIPS, :].mean(axis=-2), joints[..., _HEAD_BOTTOM, :]], axis=-2)
    return np.concatenate([joints[..., _ENDS, :], torso[..., None, :, :]], axis=-3)


def percent(parts: ArrayLike) -> float | None:
    """Return PCP, 0 to 100, of any array of :class:`Part` values; None if no part is defined."""
    parts = np.asarray(parts)
    counted = int((parts != Part.UNDEFINED).sum())
    return 100.0 * int((parts == Part.CORRECT).sum()) / counted if counted else None
