"""Articulated body: segments with rotations between them, and the joints of a skeleton that are fixed to segments.

The T-pose is zero: x forward, y left, z up, arms to the sides. A segment turns about its origin, which lies at a fixed
offset from that of its parent. Joints of the skeleton that are centres of rotation (hips, knees, shoulders, elbows ...)
are the origins themselves; others (nose, eyes, ears, toes ...) have fixed offsets in a segment.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton import Skeleton
from mvpose.skeleton_fit import joint_limits
from mvpose.skeleton_fit.joint_limits import HingeLimit, Limit


@dataclass(frozen=True)
class BodySegment:
    """Segment of the body."""

    name: str
    """Name in files, as most animation programs write it."""
    parent: str
    """Name of the parent; "" for the root."""
    bone: tuple[float, float, float]
    """Direction from the origin of the parent to its own in the T-pose, (3,), a unit vector."""
    length: str
    """Name of the length of that offset in :data:`LENGTHS`; both sides share it."""
    limit: Limit | None
    """Range of motion; None for the root, which turns freely."""
    axes: tuple[tuple[float, float, float], ...]
    """Axes about which it turns in its own frame, (D, 3); empty if it is fixed to its parent."""
    spread: float
    """Standard deviation of its rotation about the axes, degrees, around ``rest``. It only matters where joints do not
    determine the rotation."""
    share: float = 1.0
    """Share of that length that the offset is."""
    rest: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Mean rotation, a rotation vector in degrees, (3,)."""


LENGTHS = {
    "trunk": 0.288, "hip": 0.06, "shoulder": 0.129, "upper arm": 0.186, "forearm": 0.146, "thigh": 0.245,
    "shank": 0.246,
}  # fmt: skip
"""Lengths as shares of the stature, for those that a recording does not show: Drillis and Contini, Body Segment
Parameters, 1966 (in D. Winter, Biomechanics and Motor Control of Human Movement, 4th edition, figure 4.1). Hip and
shoulder are half the distance between both sides."""

STATURE = 1.7
"""Metres; only the start of the search for a person's lengths."""

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_BALL = (_X, _Y, _Z)
_FREE = 180.0  # degrees; the spread of rotations that the joints of the body determine as a rule
_HEAD = {
    "nose": (0.12, 0.0, 0.17), "left_eye": (0.09, 0.03, 0.21), "right_eye": (0.09, -0.03, 0.21),
    "left_ear": (0.01, 0.07, 0.19), "right_ear": (0.01, -0.07, 0.19),
    "head": (0.0, 0.0, 0.30), "head_top": (0.0, 0.0, 0.30), "head_bottom": (0.0, 0.0, 0.08),
}  # fmt: skip  # metres from the middle of the shoulders, an adult; only the start of the search
_FOOT = {"big_toe": (0.16, -0.03, -0.07), "small_toe": (0.13, 0.05, -0.07), "heel": (-0.05, 0.0, -0.07)}
_HAND = {
    "hand_5": (0.03, 0.09, 0.0), "hand_9": (0.01, 0.09, 0.0), "hand_13": (-0.01, 0.085, 0.0),
    "hand_17": (-0.03, 0.08, 0.0),
}  # fmt: skip  # knuckles of the left hand with the palm down; fingers bend, and are no part of a rigid hand
_CENTRES = {"mid_hip": "Hips", "hip": "Hips", "pelvis": "Hips", "neck": "Neck", "thorax": "Neck"}


def _bent(hinge: HingeLimit) -> tuple[float, float, float]:
    """Return the rest of a hinge, a rotation vector in degrees: a little bent."""
    x, y, z = hinge.axis
    return (30.0 * x, 30.0 * y, 30.0 * z)


def _side(side: str) -> tuple[BodySegment, ...]:
    """Return the segments of one side of the body."""
    name, out = side.capitalize(), (0.0, 1.0 if side == "left" else -1.0, 0.0)
    girdle, arm, forearm, leg = (f"{name}{each}" for each in ("Shoulder", "Arm", "ForeArm", "UpLeg"))
    down, elbow, knee = (0.0, 0.0, -1.0), joint_limits.ELBOWS[side], joint_limits.KNEE
    hanging = (-80.0 * out[1], 0.0, 0.0)
    return (
        BodySegment(girdle, "Spine", _Z, "trunk", joint_limits.GIRDLES[side], (_X, _Z), 10.0, 0.8),
        BodySegment(arm, girdle, out, "shoulder", joint_limits.SHOULDERS[side], _BALL, _FREE, 1.0, hanging),
        BodySegment(forearm, arm, out, "upper arm", elbow, (elbow.axis,), _FREE, 1.0, _bent(elbow)),
        BodySegment(f"{name}Hand", forearm, out, "forearm", joint_limits.HANDS[side], (), _FREE),
        BodySegment(leg, "Hips", out, "hip", joint_limits.HIPS[side], _BALL, _FREE),
        BodySegment(f"{name}Leg", leg, down, "thigh", knee, (knee.axis,), _FREE, 1.0, _bent(knee)),
        BodySegment(f"{name}Foot", f"{name}Leg", down, "shank", joint_limits.FEET[side], (), 20.0),
    )


SEGMENTS = (
    BodySegment("Hips", "", _Z, "trunk", None, _BALL, np.inf, 0.0),
    # Joints do not show how the trunk bends between hips and shoulders: the less of it, the likelier.
    BodySegment("Spine", "Hips", _Z, "trunk", joint_limits.SPINE, _BALL, 15.0, 0.2),
    BodySegment("Neck", "Spine", _Z, "trunk", joint_limits.NECK, _BALL, 60.0, 0.8),
    *_side("left"),
    *_side("right"),
)
"""All segments, parents before children."""

_ORIGINS = {
    f"{side}_{joint}": f"{side.capitalize()}{segment}"
    for side in ("left", "right")
    for joint, segment in {
        "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand", "hip": "UpLeg", "knee": "Leg", "ankle": "Foot",
    }.items()
}  # fmt: skip


@dataclass(frozen=True)
class ArticulatedBody:
    """Body of one person: its segments and the joints of a skeleton on them, in metres."""

    segments: tuple[BodySegment, ...]
    """The S segments, parents before children."""
    offsets: Floats
    """From the origin of the parent to that of the segment, (S, 3); that of the root is zero."""
    joints: tuple[str, ...]
    """Names of the M joints of the skeleton that lie on the body."""
    rows: tuple[int, ...]
    """Their indices in the skeleton, (M,)."""
    carriers: tuple[int, ...]
    """Index of the segment of each of them, (M,)."""
    places: Floats
    """Their places in the frames of their segments, (M, 3)."""

    @classmethod
    def of_skeleton(cls, skeleton: Skeleton) -> Self:
        """Return a body of average proportions for a skeleton.

        Raises:
            ValueError: a skeleton without hips and shoulders, from which a body cannot be placed.
        """
        needed = ("left_hip", "right_hip", "left_shoulder", "right_shoulder")
        if not set(needed) <= set(skeleton.joints):
            raise ValueError(
                f"skeleton {skeleton.name!r} must have {', '.join(needed)} for joint rotations, got "
                f"{', '.join(skeleton.joints)}"
            )
        seen = {
            end: sum(f"{side}_{part}" in skeleton.joints for side in ("left", "right") for part in parts)
            for end, parts in (("Foot", _FOOT), ("Hand", _HAND))
        }
        turning = tuple(end for end, count in seen.items() if count > 2)  # two joints or more of a side
        segments = tuple(replace(each, axes=_BALL) if each.name.endswith(turning) else each for each in SEGMENTS)
        numbers = {each.name: k for k, each in enumerate(segments)}
        found: list[tuple[str, int, int, tuple[float, float, float]]] = []
        for row, joint in enumerate(skeleton.joints):
            side, _, part = joint.partition("_")
            if joint in _ORIGINS or joint in _CENTRES:
                found.append((joint, row, numbers[_ORIGINS.get(joint) or _CENTRES[joint]], (0.0, 0.0, 0.0)))
            elif joint in _HEAD:
                found.append((joint, row, numbers["Neck"], _HEAD[joint]))
            elif side in ("left", "right") and (part in _FOOT or part in _HAND):
                end, (x, y, z) = ("Foot", _FOOT[part]) if part in _FOOT else ("Hand", _HAND[part])
                found.append((joint, row, numbers[f"{side.capitalize()}{end}"], (x, y if side == "left" else -y, z)))
        joints, rows, carriers, places = zip(*found, strict=True)
        lengths = {name: share * STATURE for name, share in LENGTHS.items()}
        return cls(segments, _offsets(segments, lengths), joints, rows, carriers, np.array(places))

    @property
    def lengths(self) -> dict[str, float]:
        """Lengths of the bones, metres, by the names in :data:`LENGTHS`."""
        found = {
            each.length: float(np.linalg.norm(offset)) / each.share
            for each, offset in zip(self.segments, self.offsets, strict=True)
            if each.share > 0.0
        }
        return {name: found[name] for name in LENGTHS}

    def resized(self, lengths: dict[str, float]) -> Self:
        """Return the body with other lengths, by the names in :data:`LENGTHS`."""
        return replace(self, offsets=_offsets(self.segments, lengths))

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """Index of the parent of each segment, (S,); -1 for the root."""
        numbers = {each.name: k for k, each in enumerate(self.segments)}
        return tuple(numbers.get(each.parent, -1) for each in self.segments)

    @property
    def centres(self) -> tuple[bool, ...]:
        """Whether each joint is the origin of its segment, (M,)."""
        return tuple(joint in _ORIGINS or joint in _CENTRES for joint in self.joints)

    def index(self, segment: str) -> int:
        """Return the index of a segment by name."""
        return next(k for k, each in enumerate(self.segments) if each.name == segment)

    def ancestors(self, segment: int) -> list[int]:
        """Return a segment, its parent and so on to the root."""
        line = [segment]
        while self.parents[line[-1]] >= 0:
            line.append(self.parents[line[-1]])
        return line


def _offsets(segments: tuple[BodySegment, ...], lengths: dict[str, float]) -> Floats:
    return np.array([np.multiply(each.bone, each.share * lengths[each.length]) for each in segments])
