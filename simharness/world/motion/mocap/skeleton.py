"""MocapSkeleton and joint rotations of a motion file.

The joints of a recorded skeleton are mapped to a person by their names and hierarchy.
"""

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.files.input_files import parse_toml
from simharness.world.humans.anatomy import SIDES

END = " end"  # suffix of a joint name: tip of its bone, a joint without rotation


@dataclass(frozen=True)
class MocapSkeleton:
    """MocapSkeleton of J joints, the root first and parents before children. The zero pose has no rotations."""

    names: tuple[str, ...]
    """Unique names of the joints."""
    parents: Integers
    """Index of each parent, (J,), -1 for the root."""
    offsets: Floats
    """Vectors from the parent to the joint in the zero pose, (J, 3), in the length unit of the file."""

    def __len__(self) -> int:
        return len(self.names)

    @property
    def zero(self) -> Floats:
        """Positions of the joints in the zero pose with the root at the origin, (J, 3)."""
        places = np.zeros((len(self), 3))
        for joint in range(1, len(self)):
            places[joint] = places[self.parents[joint]] + self.offsets[joint]
        return places

    def ancestors(self, joint: int) -> list[int]:
        """Return the joint, its parent and so on to the root."""
        line = [joint]
        while self.parents[line[-1]] >= 0:
            line.append(int(self.parents[line[-1]]))
        return line

    def children(self, joint: int) -> list[int]:
        """Return the children of a joint."""
        return np.flatnonzero(self.parents == joint).tolist()


@dataclass(frozen=True)
class RecordedMotion:
    """Recorded motion of a skeleton in N frames."""

    file: str
    """Name of the file."""
    skeleton: MocapSkeleton
    """Skeleton with J joints."""
    rate: float
    """Frames per second."""
    root: Floats
    """Position of the root in every frame, (N, 3), in the length unit of the file."""
    turns: Floats
    """Rotation of every joint relative to its parent, (N, J, 4) quaternions w x y z."""

    def __len__(self) -> int:
        return len(self.root)

    @property
    def duration(self) -> float:
        """Time from the first frame to the last, seconds."""
        return (len(self) - 1) / self.rate

    def pose(self) -> tuple[Floats, Floats]:
        """Return positions (N, J, 3) of the joints and their rotations relative to the zero pose, (N, J, 3, 3)."""
        count = len(self.skeleton)
        local = Rotation.from_quat(self.turns.reshape(-1, 4), scalar_first=True).as_matrix().reshape(-1, count, 3, 3)
        places, turns = np.empty((len(self), count, 3)), np.empty_like(local)
        places[:, 0], turns[:, 0] = self.root, local[:, 0]
        for joint in range(1, count):
            parent = self.skeleton.parents[joint]
            places[:, joint] = places[:, parent] + turns[:, parent] @ self.skeleton.offsets[joint]
            turns[:, joint] = turns[:, parent] @ local[:, joint]
        return places, turns


def lowest_common_ancestor(skeleton: MocapSkeleton, first: int, second: int) -> int:
    """Return the nearest joint that is an ancestor of both."""
    above = set(skeleton.ancestors(first))
    return next(joint for joint in skeleton.ancestors(second) if joint in above)


_FILE = Path(__file__).parents[1] / "data" / "joint_names.toml"
_NAMES: dict[str, list[str]] = parse_toml(_FILE.read_text(encoding="utf-8"))  # by role
_OPTIONAL = frozenset({"hand", "toes", "collar"})
_LIMBS = (("thigh", "shank", "foot", "toes"), ("collar", "arm", "forearm", "hand"))
_SIDE_WORDS = {"left": "left", "l": "left", "right": "right", "r": "right"}
_PADDING = re.compile(r"^(bip|bip01|mixamorig|bvh|def|jnt|joint|bone|j|b|\d+)$")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_UPRIGHT = 0.75  # least cosine between the vertical and each segment of a standing person, with legs apart


@dataclass(frozen=True)
class JointMap:
    """Indices of the joints of a person in a skeleton; -1 for joints that the skeleton does not have."""

    pelvis: int
    """Joint that carries both legs."""
    chest: int
    """Joint that carries both arms."""
    head: int
    """Joint of the skull."""
    limbs: dict[str, dict[str, int]]
    """Joints by side and role ("thigh", "shank", "foot", "toes", "collar", "arm", "forearm", "hand")."""
    axes: Floats
    """Axes of the person in the coordinates of the file, (3, 3); columns are forward, left and up."""


def map_joints(recording: RecordedMotion) -> JointMap:
    """Map the skeleton of a recording to the joints of a person.

    Raises:
        ValueError: joints are missing (the message lists the existing ones), or the zero pose does not stand upright.
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
            f"{', '.join(skeleton.names[:80])}: rename them, or choose another file"
        )
    for side in SIDES:
        for limb in _LIMBS:
            _check_limb(recording, side, limb, limbs[side])

    pelvis = lowest_common_ancestor(skeleton, *(limbs[side]["thigh"] for side in SIDES))
    tops = [limbs[side]["collar"] if limbs[side]["collar"] >= 0 else limbs[side]["arm"] for side in SIDES]
    chest = lowest_common_ancestor(skeleton, *(int(skeleton.parents[top]) for top in tops))
    heads = [joint for joint, (side, word) in enumerate(named) if side is None and word == "head"]
    return JointMap(pelvis, chest, heads[0] if heads else -1, limbs, _axes(recording, limbs))


def _side_and_word(name: str) -> tuple[str | None, str]:
    """Split a joint name into side and rest: "mixamorig:LeftUpLeg", "lUpLeg" and "UpLeg.L" are ("left", "upleg")."""
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


def _check_limb(recording: RecordedMotion, side: str, limb: tuple[str, ...], joints: dict[str, int]) -> None:
    """Raise ValueError unless the joints of a limb form a chain in their order."""
    chain = [role for role in limb if joints[role] >= 0]
    names = recording.skeleton.names
    for upper, lower in pairwise(chain):
        if joints[upper] not in recording.skeleton.ancestors(joints[lower]):
            raise ValueError(
                f"{recording.file}: {names[joints[lower]]!r} was mapped to the {side} {lower} and "
                f"{names[joints[upper]]!r} to the {side} {upper}, but the first is not a descendant of the second: "
                "rename them"
            )


def _axes(recording: RecordedMotion, limbs: dict[str, dict[str, int]]) -> Floats:
    """Return the axes of the person in the coordinates of the file, from the zero pose of the skeleton."""
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
            f"{recording.file}: the zero pose of this skeleton (all angles 0) does not stand upright with its hips "
            "side by side, so its joint angles cannot be retargeted: export it with a standing zero pose (T or A pose)"
        )
    left /= np.linalg.norm(left)
    return np.stack([np.cross(left, up), left, up], axis=1)
