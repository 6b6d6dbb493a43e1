"""Degrees of freedom of the human body, their ranges of motion, and mass fractions of the segments.

All angles are zero in the anatomical neutral pose: standing, legs straight, feet forward, arms hanging, palms to the
thighs. The name gives the positive direction (flexion, abduction ...). Bending and spine rotation are positive to the
person's left, rotations of hip and shoulder are positive inward (medial). Equal values of a left and a right joint
give mirrored poses.

The segments are the fourteen of de Leva (J. Biomechanics 29, 1996) with the trunk as one segment. The neck belongs to
the head, the shoulder girdle to the torso, the toes to the foot.

Ranges of limbs: American Academy of Orthopaedic Surgeons, "Joint Motion: Method of Measuring and Recording", 1965, and
Boone & Azen, J. Bone Joint Surg. 61-A, 1979. Spine: White & Panjabi, "Clinical Biomechanics of the Spine", 1990, their
vertebral segments summed over lumbar, thoracic and cervical spine. Clavicle elevation: Ludewig et al., J. Bone Joint
Surg. 91-A, 2009, with the shrug of AAOS. Masses: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters", J. Biomechanics 29, 1996, table 4.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.files.input_files import parse_toml

SIDES: tuple[str, str] = ("left", "right")
OTHER = {"left": "right", "right": "left"}

ANATOMY: Mapping[str, Any] = MappingProxyType(
    parse_toml((Path(__file__).parent / "data" / "anatomy.toml").read_text(encoding="utf-8"))
)
"""Tables of ``anatomy.toml``: hinges, masses, capsules and servos."""

HINGES_BY_DOF: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    ANATOMY["spine"] | {f"{side}_{joint}": hinge for side in SIDES for joint, hinge in ANATOMY["limbs"].items()}
)
"""Bone (without its side), axis and range of every degree of freedom."""

RANGES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {name: tuple(np.radians(hinge["degrees"]).tolist()) for name, hinge in HINGES_BY_DOF.items()}
)
"""Least and greatest angle of every degree of freedom, radians."""

DOFS: tuple[str, ...] = tuple(RANGES)
"""Names of the 35 degrees of freedom, in the order of every array of angles."""

TRUNK, LEG, ARM = tuple(ANATOMY["spine"])[:6], tuple(ANATOMY["limbs"])[:6], tuple(ANATOMY["limbs"])[7:]
"""Names of the hinges of lumbar spine and thorax, of a leg and of an arm, without the side, outwards; the clavicle,
which carries the arm, is in none."""

PAIRED_SEGMENTS: frozenset[str] = frozenset({"upper_arm", "forearm", "hand", "thigh", "shank", "foot"})


def mass_fractions(gender: float) -> dict[str, float]:
    """Return the fraction of body mass of every segment.

    A limb segment is that of one side: it counts twice in the sum, which is 1.

    Args:
        gender: 0 male to 1 female; the values of de Leva (1996) are interpolated linearly.
    """
    shares = {name: (1 - gender) * male + gender * female for name, (male, female) in ANATOMY["masses"].items()}
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


_SIDES = {"Left": "LEFT", "Right": "RIGHT", "L": "LEFT", "R": "RIGHT"}


def segments_of_bones(bones: Sequence[str]) -> NDArray[np.int8]:
    """Return the segment that every bone of the body model moves, (B,); bones of no limb, head or neck: the torso."""
    faces = ANATOMY["faces"]
    names = {bone: Segment[segment] for bone, segment in faces["trunk"].items()} | {
        f"{start}{bone}": Segment[f"{side}_{segment}"]
        for start, side in _SIDES.items()
        for bone, segment in faces["limbs"].items()
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
