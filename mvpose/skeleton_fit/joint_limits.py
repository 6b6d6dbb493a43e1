"""Ranges of motion of the joints of the body, and the nearest rotations within them.

Zero of all rotations is the T-pose: x of a segment forward, y left, z up; arms to the sides with palms down.

Sources: American Academy of Orthopaedic Surgeons, Joint Motion: Method of Measuring and Recording, 1965 (trunk,
shoulder, elbow, wrist, hip, ankle); American Medical Association, Guides to the Evaluation of Permanent Impairment,
5th edition, 2000 (neck, knee); D. Neumann, Kinesiology of the Musculoskeletal System, 2nd edition, 2010 (shoulder
girdle). They are averages of adults.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton_fit.rotations import shortest, to_matrices, to_vectors


class Limit(Protocol):
    """Range of motion of one joint."""

    def nearest(self, rotations: Floats) -> Floats:
        """Return allowed rotations near given ones, (..., 3, 3); those that are allowed already stay the same."""
        ...


@dataclass(frozen=True)
class HingeLimit:
    """Range of a joint with one axis.

    Attributes:
        axis: the axis in the T-pose, (3,), a unit vector; the angle is positive in flexion.
        low, high: range of the angle, degrees.
    """

    axis: tuple[float, float, float]
    low: float
    high: float

    def angles(self, rotations: Floats) -> Floats:
        """Return the angles about the axis, (...), degrees."""
        return np.degrees(to_vectors(rotations) @ np.array(self.axis))

    def nearest(self, rotations: Floats) -> Floats:
        """Return rotations about the axis alone, within the range."""
        angles = np.clip(self.angles(rotations), self.low, self.high)
        return to_matrices(np.radians(angles)[..., None] * np.array(self.axis))


@dataclass(frozen=True)
class Cone:
    """Range of a joint with two or three axes, whose bone keeps within a cone with an elliptic section.

    The rotation is a swing of the bone, about an axis at right angles to it, after a twist about the bone. The
    section of the cone has a half-axis of its own in each of the four directions.
    """

    bone: tuple[float, float, float]
    """Direction of the bone in the T-pose, (3,), a unit vector."""
    toward: tuple[tuple[float, float, float], tuple[float, float, float]]
    """Two directions at right angles to the bone and each other, (2, 3), toward which the bone swings."""
    far: tuple[float, float]
    """Most degrees toward each of them, (2,)."""
    back: tuple[float, float]
    """Most degrees away from each of them, (2,)."""
    twist: tuple[float, float]
    """Most degrees of rotation about the bone: negative and positive, (2,)."""

    def nearest(self, rotations: Floats) -> Floats:
        """Return rotations with swing and twist within their ranges."""
        bone = np.array(self.bone)
        directions = rotations @ bone
        axes = np.cross(bone, np.array(self.toward))  # the swing toward a direction turns about such an axis
        swing = shortest(bone, directions)
        angles = to_vectors(swing) @ axes.T
        most = np.radians(np.where(angles >= 0.0, self.far, self.back))
        excess = np.linalg.norm(angles / most, axis=-1)
        allowed = to_matrices((angles / np.maximum(excess, 1.0)[..., None]) @ axes)
        return allowed @ _clipped_twist(swing.swapaxes(-1, -2) @ rotations, bone, self.twist)


@dataclass(frozen=True)
class Shoulder:
    """Range of the shoulder: the directions that the upper arm can have, and its rotation about itself.

    With flexion f = 0 for an arm that hangs, 90 in front, 180 overhead, and abduction a toward the side, the upper arm
    has the direction (cos a sin f, sin a, -cos a cos f) for the left arm. What rotation about the arm is zero depends
    on the way by which the arm got there (Codman's paradox); here it is the shortest way from the middle of the range,
    and the range of rotation is wider than the published one by the largest difference between ways within a quarter of
    the sphere, 45 degrees.
    """

    side: int
    """1 for the left shoulder, -1 for the right one."""
    extension: float = 60.0
    """Most degrees behind the body of an arm at the side."""
    horizontal_extension: float = 45.0
    """Most degrees behind the side of a horizontal arm."""
    crossing: float = 45.0
    """Most degrees of abduction below 0: the arm crosses the chest."""
    twist: tuple[float, float] = (90.0 + 45.0, 70.0 + 45.0)
    """Most degrees of outward and inward rotation."""

    def nearest(self, rotations: Floats) -> Floats:
        """Return rotations with the arm in an allowed direction, and its own rotation within the range."""
        bone = np.array([0.0, self.side, 0.0])
        directions = rotations @ bone
        turned = shortest(directions, self._allowed(directions)) @ rotations
        middle = np.array([1.0, self.side, -0.5]) / 1.5
        at_middle = shortest(bone, middle)
        zero = shortest(middle, turned @ bone) @ at_middle
        outward, inward = self.twist  # outward turns x up, which is a negative angle about the left arm
        twist = (-outward, inward) if self.side > 0 else (-inward, outward)
        return zero @ _clipped_twist(zero.swapaxes(-1, -2) @ turned, bone, twist)

    def _allowed(self, directions: Floats) -> Floats:
        """Return the allowed directions nearest in flexion and abduction, (..., 3)."""
        x, y, z = np.moveaxis(directions, -1, 0)
        abduction = np.maximum(np.arcsin(np.clip(self.side * y, -1.0, 1.0)), -np.radians(self.crossing))
        flexion = np.arctan2(x, -z)
        # A horizontal arm h degrees behind the side has a flexion of -90 and an abduction of 90 - h.
        share = np.clip(np.degrees(abduction) / (90.0 - self.horizontal_extension), 0.0, None)
        behind = -np.radians(np.minimum(self.extension + (90.0 - self.extension) * share, 180.0))
        nearer_to_overhead = np.where(flexion < (behind - np.pi) / 2.0, -np.pi, behind)
        flexion = np.where(flexion < behind, nearer_to_overhead, flexion)
        level = np.cos(abduction)
        return np.stack([level * np.sin(flexion), self.side * np.sin(abduction), -level * np.cos(flexion)], axis=-1)


def _clipped_twist(rotations: Floats, bone: Floats, degrees: tuple[float, float]) -> Floats:
    """Return the twists about a bone, within a range, of rotations that have no swing, (..., 3, 3)."""
    angles = np.clip(to_vectors(rotations) @ bone, *np.radians(degrees))
    return to_matrices(angles[..., None] * bone)


def _mirrored(limit: Cone) -> Cone:
    """Return the range of the other side of the body."""
    (x, y, z), ((a, b, c), (d, e, f)) = limit.bone, limit.toward
    low, high = limit.twist  # about a bone along x or z the sense changes, along y the bone itself does
    return Cone((x, -y, z), ((a, -b, c), (d, -e, f)), limit.far, limit.back, (-high, -low))


_FORWARD, _LEFT, _UP, _DOWN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
_HIP = Cone(_DOWN, (_FORWARD, _LEFT), (120.0, 45.0), (30.0, 30.0), (-45.0, 45.0))
_GIRDLE = Cone(_LEFT, (_FORWARD, _UP), (30.0, 45.0), (30.0, 10.0), (0.0, 0.0))
_HAND = Cone(_LEFT, (_DOWN, _FORWARD), (80.0, 20.0), (70.0, 30.0), (-80.0, 80.0))  # twist: pronation, supination
_FOOT = Cone(_FORWARD, (_DOWN, _LEFT), (50.0, 20.0), (20.0, 20.0), (-35.0, 15.0))  # twist: inversion, eversion

SPINE = Cone(_UP, (_FORWARD, _LEFT), (80.0, 35.0), (25.0, 35.0), (-45.0, 45.0))
NECK = Cone(_UP, (_FORWARD, _LEFT), (50.0, 45.0), (60.0, 45.0), (-80.0, 80.0))
HIPS = {"left": _HIP, "right": _mirrored(_HIP)}
GIRDLES = {"left": _GIRDLE, "right": _mirrored(_GIRDLE)}
HANDS = {"left": _HAND, "right": _mirrored(_HAND)}
FEET = {"left": _FOOT, "right": _mirrored(_FOOT)}
SHOULDERS = {"left": Shoulder(1), "right": Shoulder(-1)}
ELBOWS = {"left": HingeLimit((0.0, 0.0, -1.0), -10.0, 150.0), "right": HingeLimit((0.0, 0.0, 1.0), -10.0, 150.0)}
KNEE = HingeLimit((0.0, 1.0, 0.0), -10.0, 150.0)
