"""Which joint of a recorded skeleton is which of a person's, told by its name and by what hangs on what."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.mocap.skeleton import Recording, Skeleton, lowest_common_ancestor

# By role the names it goes by, without the side, the best first: CMU's, MotionBuilder's, Biovision's, Poser's, 3ds
# Max's, Blender's. What follows another in one limb may share its name ("shoulder" is the collar bone of one and the
# upper arm of another), so the first that is there counts.
_NAMES = {
    "thigh": ("upleg", "upperleg", "femur", "thigh", "hip"),
    "shank": ("leg", "tibia", "shin", "calf", "lowerleg", "lowleg", "knee"),
    "foot": ("foot", "ankle"),
    "arm": ("humerus", "upperarm", "uparm", "shldr", "arm", "shoulder"),
    "forearm": ("radius", "forearm", "lowerarm", "lowarm", "elbow"),
    "hand": ("hand", "wrist"),
    "toes": ("toebase", "toes", "toe", "ball"),
    "collar": ("clavicle", "collar", "collarbone", "shoulder"),
}
_OPTIONAL = frozenset({"hand", "toes", "collar"})
_LIMBS = (("thigh", "shank", "foot", "toes"), ("collar", "arm", "forearm", "hand"))
_SIDE_WORDS = {"left": "left", "l": "left", "right": "right", "r": "right"}
_PADDING = re.compile(r"^(bip|bip01|mixamorig|bvh|def|jnt|joint|bone|j|b|\d+)$")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_UPRIGHT = 0.75  # cosine between the vertical and each segment of a person who stands, legs astride at most


@dataclass(frozen=True)
class JointMap:
    """The joints of a skeleton that matter to us, as indices; -1 where a skeleton has none.

    Attributes:
        pelvis: carries both legs. chest: carries both arms. head: the skull.
        limbs: by side and role ("thigh", "shank", "foot", "toes", "collar", "arm", "forearm", "hand").
        axes: columns are forward, left and up in the file's coordinates, (3, 3).
    """

    pelvis: int
    chest: int
    head: int
    limbs: dict[str, dict[str, int]]
    axes: Floats


def map_joints(recording: Recording) -> JointMap:
    """Find a person in the skeleton of a recording.

    Raises:
        ValueError: what is missing, and the joints that are there; or that the zero pose does not stand.
    """
    skeleton = recording.skeleton
    named = [_side_and_word(name) for name in skeleton.names]
    limbs: dict[str, dict[str, int]] = {}
    missing = []
    for side in SIDES:
        limbs[side] = {}
        for role, words in _NAMES.items():
            taken = set(limbs[side].values())
            fitting = [
                joint
                for word in words
                for joint, (where, what) in enumerate(named)
                if where == side and what == word and joint not in taken
            ]
            limbs[side][role] = fitting[0] if fitting else -1
            if not fitting and role not in _OPTIONAL:
                missing.append(f"{side} {role} ({', '.join(words)})")
    if missing:
        raise ValueError(
            f"{recording.file}: this skeleton has no {'; no '.join(missing)}; its joints are "
            f"{', '.join(skeleton.names[:80])}: rename them, or take another file"
        )
    for side in SIDES:
        for limb in _LIMBS:
            _check_limb(recording, side, limb, limbs[side])

    pelvis = lowest_common_ancestor(skeleton, *(limbs[side]["thigh"] for side in SIDES))
    tops = [limbs[side]["collar"] if limbs[side]["collar"] >= 0 else limbs[side]["arm"] for side in SIDES]
    chest = lowest_common_ancestor(skeleton, *(_above(skeleton, top) for top in tops))
    heads = [joint for joint, (side, word) in enumerate(named) if side is None and word == "head"]
    return JointMap(pelvis, chest, heads[0] if heads else -1, limbs, _axes(recording, limbs))


def _above(skeleton: Skeleton, joint: int) -> int:
    return int(skeleton.parents[joint])


def _side_and_word(name: str) -> tuple[str | None, str]:
    """A name's side and the rest of it: "mixamorig:LeftUpLeg", "lUpLeg" and "UpLeg.L" are all ("left", "upleg")."""
    words = [word.lower() for word in _WORD.findall(re.split(r"[:|]", name)[-1])]
    words = [word for word in words if not _PADDING.match(word)] or [""]
    sides = [word for word in words if word in _SIDE_WORDS]
    if sides:
        words.remove(sides[0])
        return _SIDE_WORDS[sides[0]], "".join(words)
    joined = "".join(words)
    for prefix, side in _SIDE_WORDS.items():
        rest = joined.removeprefix(prefix)
        if rest != joined and any(rest in known for known in _NAMES.values()):
            return side, rest
    return None, joined


def _check_limb(recording: Recording, side: str, limb: tuple[str, ...], found: dict[str, int]) -> None:
    """The joints of a limb hang on each other in its order."""
    chain = [role for role in limb if found[role] >= 0]
    names = recording.skeleton.names
    for upper, lower in pairwise(chain):
        if found[upper] not in recording.skeleton.ancestors(found[lower]):
            raise ValueError(
                f"{recording.file}: {names[found[lower]]!r} was taken for the {side} {lower} and "
                f"{names[found[upper]]!r} for the {side} {upper}, but the one does not hang on the other: rename them"
            )


def _axes(recording: Recording, limbs: dict[str, dict[str, int]]) -> Floats:
    """The person's axes in the file's coordinates, from how the skeleton stands in its zero pose."""
    zero = recording.skeleton.zero
    thigh, shank, foot, arm = (
        np.array([zero[limbs[side][role]] for side in SIDES]) for role in ("thigh", "shank", "foot", "arm")
    )
    rise = arm.mean(axis=0) - thigh.mean(axis=0)
    axis = int(np.abs(rise).argmax())
    up = np.zeros(3)
    up[axis] = np.sign(rise[axis])
    left = thigh[0] - thigh[1]
    left = left - (left @ up) * up
    segments = np.vstack([rise[None], thigh - shank, shank - foot])
    lengths = np.linalg.norm(segments, axis=1)
    standing = lengths.min() > 0 and (segments @ up / np.where(lengths > 0, lengths, 1.0)).min() > _UPRIGHT
    if not standing or np.linalg.norm(left) < 1e-3 * lengths.max():
        raise ValueError(
            f"{recording.file}: with all angles 0 this skeleton does not stand upright with its hips beside each "
            "other, so that its joint angles mean nothing to a body that does: export it with a standing zero pose "
            "(T or A pose)"
        )
    left /= np.linalg.norm(left)
    return np.stack([np.cross(left, up), left, up], axis=1)
