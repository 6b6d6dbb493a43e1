"""Two people face to face: distance, lean, gaze and reach, so that their hands meet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import DOFS, RANGES, SIDES
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import spot_to_world
from simharness.world.motion.poses.inverse_kinematics import shoulder_girdle
from simharness.world.motion.poses.kinematics import Cast, Kinematics

_SAG = 0.02  # metres: height difference between standing upright and relaxed
_STRETCHED = 0.93  # comfortable distance of a hand from the shoulder, in arm lengths
_STEEPEST = 0.62  # largest depth of a hand below the shoulder before the trunk bends, in arm lengths
_NEAREST = 0.27  # metres: least distance from a pelvis to the meeting point
_LEAN = {"lumbar_flexion": 0.55, "thorax_flexion": 0.45}  # fractions of the lean of the trunk
_MOST_LEAN = 45.0  # degrees: largest lean


@dataclass(frozen=True)
class Meeting:
    """Meeting of the hands of two people who face each other."""

    spots: tuple[Spot, Spot]
    """Spot of each person, facing the other."""
    point: Floats
    """Meeting point of the hands, (3,) metres."""
    lean: tuple[float, float]
    """Lean of each trunk that this takes, degrees."""


def face_to_face(middle: Spot, distance: float, *, share: float = 0.5, aside: float = 0.0) -> tuple[Spot, Spot]:
    """Return two spots ``distance`` metres apart that face each other along the bearing of ``middle``.

    Args:
        middle: spot between them; its bearing points from the first to the second.
        distance: distance in metres.
        share: fraction of the distance between the first spot and the middle.
        aside: offset of each to the left of the line between them, metres.
    """
    first, second = spot_to_world(middle, [[-share * distance, aside], [(1 - share) * distance, -aside]])
    return Spot(first, middle.bearing), Spot(second, middle.bearing + np.pi)


def plan_meeting(performers: Cast, middle: Spot, *, raised: float = 0.5, stretched: float = _STRETCHED) -> Meeting:
    """Return spots of two people, such that their right hands, or both hands, meet at one point between them.

    The height of the point is the mean of the heights that are natural for both; a person too tall for it bends.

    Args:
        performers: the two people.
        middle: midpoint of their pelvises; its bearing points from the first to the second.
        raised: preferred depth of the hand below the shoulder, in arm lengths.
        stretched: distance of the hand from the shoulder, in arm lengths.
    """
    height = float(np.mean([_shoulder(mover, 0.0)[2] - raised * arm_length(mover) for mover in performers]))
    leans, ahead = [], []
    for mover in performers:
        length = arm_length(mover)
        bends = np.arange(0.0, _MOST_LEAN + 0.5)
        shoulders = np.array([_shoulder(mover, bend) for bend in bends])
        deep = shoulders[:, 2] - height
        enough = np.flatnonzero(deep <= _STEEPEST * length)
        k = int(enough[0]) if len(enough) else len(bends) - 1
        across = (stretched * length) ** 2 - deep[k] ** 2 - shoulders[k, 1] ** 2
        leans.append(float(bends[k]))
        ahead.append(max(_NEAREST, float(shoulders[k, 0] + np.sqrt(max(across, 0.0)))))
    distance = ahead[0] + ahead[1]
    spots = face_to_face(middle, distance)
    place = spot_to_world(middle, [ahead[0] - distance / 2, 0.0, height])
    return Meeting(spots, place, (leans[0], leans[1]))


def arm_length(mover: Kinematics) -> float:
    """Return the distance from the shoulder to the centre of the palm of a straight arm, metres."""
    arm = mover.arms["right"]
    return float(np.linalg.norm(arm.end - arm.anchors[0]))


def _shoulder(mover: Kinematics, lean: float) -> Floats:
    """Return the right shoulder of a person at the origin who leans the trunk by ``lean`` degrees, (3,) metres."""
    root = np.array([[0.0, 0.0, mover.standing_height - _SAG, 1.0, 0.0, 0.0, 0.0]])
    upright = Motion(np.zeros(1), root, np.zeros((1, len(DOFS))))
    turn, place = shoulder_girdle(mover, lean_forward(upright, lean), "right")
    return turn[0] @ mover.arms["right"].anchors[0] + place[0]


def lean_forward(motion: Motion, lean: ArrayLike) -> Motion:
    """Return the motion with the trunk leaning forward by ``lean`` degrees more, (T,) or constant.

    The head compensates half of the lean, and the arms keep their direction in the world.
    """
    lean = np.asarray(lean, float)
    trunk = {name: share * lean for name, share in _LEAN.items()}
    arms = {f"{side}_shoulder_flexion": lean for side in SIDES}
    return offset_angles(motion, **trunk, **arms, neck_flexion=-0.5 * lean)


def offset_angles(motion: Motion, **degrees: ArrayLike) -> Motion:
    """Return the motion with degrees, (T,) or constant, added to the named angles, clipped to their ranges."""
    angles = motion.angles.copy()
    for name, change in degrees.items():
        column = DOFS.index(name)
        angles[:, column] = np.clip(angles[:, column] + np.radians(change), *RANGES[name])
    return Motion(motion.time, motion.root, angles)


def blend_angles(motion: Motion, on: ArrayLike, **degrees: ArrayLike) -> Motion:
    """Return the motion with the named angles blended towards targets in degrees by the weight ``on``, (T,) 0 to 1."""
    angles = motion.angles.copy()
    for name, target in degrees.items():
        column = DOFS.index(name)
        angles[:, column] += np.asarray(on) * (np.radians(target) - angles[:, column])
    return Motion(motion.time, motion.root, angles)


def look_ahead(motion: Motion) -> Motion:
    """Return the motion of a person who looks ahead: rotations of head and thorax are scaled by 0.35."""
    angles = motion.angles.copy()
    angles[:, [DOFS.index("neck_rotation"), DOFS.index("thorax_rotation")]] *= 0.35
    return Motion(motion.time, motion.root, angles)
