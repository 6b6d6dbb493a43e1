"""Degrees of freedom of the human body, their ranges of motion, and mass fractions of the segments.

All angles are zero in the anatomical neutral pose: standing, legs straight, feet forward, arms hanging, palms to the
thighs. The name gives the positive direction (flexion, abduction ...). Bending and spine rotation are positive to the
person's left, rotations of hip and shoulder are positive inward (medial). Equal values of a left and a right joint
give mirrored poses.

The segments are the fourteen of de Leva (J. Biomechanics 29, 1996) with the trunk as one segment. The neck belongs to
the head, the shoulder girdle to the torso, the toes to the foot.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

# (least, greatest) in degrees. Limbs: American Academy of Orthopaedic Surgeons, "Joint Motion: Method of Measuring
# and Recording", 1965, and Boone & Azen, J. Bone Joint Surg. 61-A, 1979. Spine: White & Panjabi, "Clinical
# Biomechanics of the Spine", 1990, their vertebral segments summed over lumbar, thoracic and cervical spine.
# Clavicle elevation: Ludewig et al., J. Bone Joint Surg. 91-A, 2009, with the shrug of AAOS.
_SPINE_DEGREES = {
    "lumbar_flexion": (-25, 60),
    "lumbar_bending": (-25, 25),
    "lumbar_rotation": (-15, 15),
    "thorax_flexion": (-20, 40),
    "thorax_bending": (-25, 25),
    "thorax_rotation": (-35, 35),
    "neck_flexion": (-60, 50),
    "neck_bending": (-45, 45),
    "neck_rotation": (-80, 80),
}
_LIMB_DEGREES = {
    "hip_flexion": (-30, 120),
    "hip_abduction": (-30, 45),
    "hip_rotation": (-45, 45),
    "knee_flexion": (-5, 145),
    "ankle_dorsiflexion": (-50, 25),
    "ankle_inversion": (-20, 35),
    "clavicle_elevation": (-10, 40),
    "shoulder_flexion": (-60, 180),
    "shoulder_abduction": (-30, 180),
    "shoulder_rotation": (-90, 90),
    "elbow_flexion": (-5, 150),
    "forearm_pronation": (-80, 80),
    "wrist_flexion": (-70, 80),
}

SIDES: tuple[str, str] = ("left", "right")

RANGES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        name: (float(np.radians(low)), float(np.radians(high)))
        for name, (low, high) in (
            *_SPINE_DEGREES.items(),
            *((f"{side}_{joint}", degrees) for side in SIDES for joint, degrees in _LIMB_DEGREES.items()),
        )
    }
)
"""Least and greatest angle of every degree of freedom, radians."""

DOFS: tuple[str, ...] = tuple(RANGES)
"""Names of the 35 degrees of freedom, in the order of every array of angles."""

# (male, female) percent of body mass: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters",
# J. Biomechanics 29, 1996, table 4. A limb segment is that of one side.
_MASS_PERCENT = {
    "head": (6.94, 6.68),
    "upper_trunk": (15.96, 15.45),
    "middle_trunk": (16.33, 14.65),
    "lower_trunk": (11.17, 12.47),
    "upper_arm": (2.71, 2.55),
    "forearm": (1.62, 1.38),
    "hand": (0.61, 0.56),
    "thigh": (14.16, 14.78),
    "shank": (4.33, 4.81),
    "foot": (1.37, 1.29),
}
PAIRED_SEGMENTS: frozenset[str] = frozenset({"upper_arm", "forearm", "hand", "thigh", "shank", "foot"})


def mass_fractions(gender: float) -> dict[str, float]:
    """Return the fraction of body mass of every segment.

    A limb segment is that of one side: it counts twice in the sum, which is 1.

    Args:
        gender: 0 male to 1 female; the values of de Leva (1996) are interpolated linearly.
    """
    shares = {name: (1 - gender) * male + gender * female for name, (male, female) in _MASS_PERCENT.items()}
    total = sum(share * (2 if name in PAIRED_SEGMENTS else 1) for name, share in shares.items())
    return {name: share / total for name, share in shares.items()}


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


def segments_of_bones(bones: Sequence[str]) -> NDArray[np.int8]:
    """Return the segment that every bone of the body model moves, (B,); bones of no limb, head or neck: the torso."""
    names = {bone: segment for bone, segment in _TRUNK.items()} | {
        f"{start}{bone}": Segment[f"{side}_{segment}"]
        for start, side in _SIDES.items()
        for bone, segment in _LIMBS.items()
    }
    return np.array([names.get(bone, Segment.TORSO) for bone in bones], np.int8)


def segments_of_faces(
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
    segment, weights = segments_of_bones(bones)[np.asarray(weight_bones)], np.asarray(weights)
    share = np.zeros((len(weights), len(Segment)), np.float32)
    rows = np.arange(len(weights))
    for k in range(weights.shape[1]):
        share[rows, segment[:, k]] += weights[:, k]
    return share[np.asarray(faces)].sum(1).argmax(1).astype(np.int8)
