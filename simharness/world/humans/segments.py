"""Body segments: the labels of body-part images.

The segments are the fourteen of de Leva (J. Biomechanics 29, 1996) with the trunk as one segment. The neck belongs to
the head, the shoulder girdle to the torso, the toes to the foot.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Segment(IntEnum):
    """Body segment that a face belongs to."""

    HEAD = 0
    TORSO = 1
    LEFT_UPPER_ARM = 2
    RIGHT_UPPER_ARM = 3
    LEFT_FOREARM = 4
    RIGHT_FOREARM = 5
    LEFT_HAND = 6
    RIGHT_HAND = 7
    LEFT_THIGH = 8
    RIGHT_THIGH = 9
    LEFT_SHANK = 10
    RIGHT_SHANK = 11
    LEFT_FOOT = 12
    RIGHT_FOOT = 13


_TRUNK = {"Head": Segment.HEAD, "Neck1": Segment.HEAD, "Neck": Segment.HEAD}
_LIMBS = {
    "Arm": "UPPER_ARM",
    "ArmTwist": "UPPER_ARM",
    "ForeArm": "FOREARM",
    "ForeArmTwist": "FOREARM",
    "Hand": "HAND",
    "FingerBase": "HAND",
    "HandFinger1": "HAND",
    "Thumb": "HAND",
    "UpLeg": "THIGH",
    "Leg": "SHANK",
    "Foot": "FOOT",
    "ToeBase": "FOOT",
}
_SIDES = {"Left": "LEFT", "Right": "RIGHT", "L": "LEFT", "R": "RIGHT"}


def of_bones(bones: Sequence[str]) -> NDArray[np.int8]:
    """Return the segment that every bone of the body model moves, (B,); bones of no limb, head or neck: the torso."""
    names = {bone: segment for bone, segment in _TRUNK.items()} | {
        f"{start}{bone}": Segment[f"{side}_{segment}"]
        for start, side in _SIDES.items()
        for bone, segment in _LIMBS.items()
    }
    return np.array([names.get(bone, Segment.TORSO) for bone in bones], np.int8)


def of_faces(
    faces: ArrayLike, weight_bones: ArrayLike, weights: ArrayLike, *, bones: Sequence[str]
) -> NDArray[np.int8]:
    """Return the segment of every face: the one with the largest sum of skinning weights over the face's corners.

    Args:
        faces: vertex indices, (k, 3).
        weight_bones: indices of the bones that move every vertex, (n, w).
        weights: skinning weights, (n, w).
        bones: bone names.

    Returns:
        Values of :class:`Segment`, (k,) int8.
    """
    segment, weights = of_bones(bones)[np.asarray(weight_bones)], np.asarray(weights)
    share = np.zeros((len(weights), len(Segment)), np.float32)
    rows = np.arange(len(weights))
    for k in range(weights.shape[1]):
        share[rows, segment[:, k]] += weights[:, k]
    return share[np.asarray(faces)].sum(1).argmax(1).astype(np.int8)
