"""Two people face to face: how far apart they stand, and how each leans, looks and reaches to meet the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import DOFS, RANGES, SIDES
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import spot_to_world
from simharness.world.motion.poses.inverse_kinematics import shoulder_girdle
from simharness.world.motion.poses.kinematics import Kinematics

_SAG = 0.02  # metres that standing at ease is lower than standing upright
_STRETCHED = 0.93  # of an arm's length: a hand that meets another's, comfortably
_STEEPEST = 0.62  # of an arm's length: how far below the shoulder a hand goes before the trunk bends
_NEAREST = 0.27  # metres from the pelvis to where hands meet
_LEAN = {"lumbar_flexion": 0.55, "thorax_flexion": 0.45}  # shares of a trunk's bend
_MOST_LEAN = 45.0  # degrees


@dataclass(frozen=True)
class Meeting:
    """Where the hands of two people meet who face each other.

    Attributes:
        spots: where each stands, facing the other.
        point: where their hands meet, metres, (3,).
        lean: how far each bends the trunk for it, degrees.
    """

    spots: tuple[Spot, Spot]
    point: Floats
    lean: tuple[float, float]

    def spot(self, person: int) -> Spot:
        """The point seen by one of them: its place on the floor, faced as they face it."""
        return Spot(self.point[:2], self.spots[person].bearing)


def face_to_face(middle: Spot, distance: float, *, share: float = 0.5, aside: float = 0.0) -> tuple[Spot, Spot]:
    """Two spots ``distance`` metres apart that face each other along the bearing of ``middle``.

    Args:
        middle: between them; its bearing leads from the first to the second.
        distance: metres.
        share: of the distance that the first has to the middle.
        aside: how far each is to the left of the line between them, metres.
    """
    first, second = spot_to_world(middle, [[-share * distance, aside], [(1 - share) * distance, -aside]])
    return Spot(first, middle.bearing), Spot(second, middle.bearing + np.pi)


def plan_meeting(
    performers: Sequence[Kinematics], middle: Spot, *, raised: float = 0.5, stretched: float = _STRETCHED
) -> Meeting:
    """Where two stand so that the right hand of each, or both hands, come to one place between them.

    The place is as high as is natural for both on average; whoever is too tall for it bends.

    Args:
        performers: the two.
        middle: of their pelvises; its bearing leads from the first to the second.
        raised: how far under the shoulder the hand is held by choice, as a share of the arm's length.
        stretched: distance of hand and shoulder, as a share of the arm's length.
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
    """From the shoulder to the middle of the palm of a straight arm, metres."""
    arm = mover.arms["right"]
    return float(np.linalg.norm(arm.end - arm.anchors[0]))


def _shoulder(mover: Kinematics, lean: float) -> Floats:
    """The right shoulder of someone who stands at the origin and bends the trunk by ``lean`` degrees, (3,) metres."""
    root = np.array([[0.0, 0.0, mover.standing_height - _SAG, 1.0, 0.0, 0.0, 0.0]])
    upright = Motion(np.zeros(1), root, np.zeros((1, len(DOFS))))
    turn, place = shoulder_girdle(mover, lean_forward(upright, lean), "right")
    return turn[0] @ mover.arms["right"].anchors[0] + place[0]


def lean_forward(motion: Motion, lean: ArrayLike) -> Motion:
    """The same motion with the trunk bent forward by ``lean`` degrees more, (T,) or constant.

    The eyes stay half level, and the arms hang down as before.
    """
    lean = np.asarray(lean, float)
    trunk = {name: share * lean for name, share in _LEAN.items()}
    arms = {f"{side}_shoulder_flexion": lean for side in SIDES}
    return offset_angles(motion, **trunk, **arms, neck_flexion=-0.5 * lean)


def offset_angles(motion: Motion, **degrees: ArrayLike) -> Motion:
    """The same motion with these angles changed by so many degrees, (T,) or constant, within their ranges."""
    angles = motion.angles.copy()
    for name, change in degrees.items():
        column = DOFS.index(name)
        angles[:, column] = np.clip(angles[:, column] + np.radians(change), *RANGES[name])
    return Motion(motion.time, motion.root, angles)


def blend_angles(motion: Motion, on: ArrayLike, **degrees: ArrayLike) -> Motion:
    """The same motion gone so far, (T,) from 0 to 1, towards these angles, degrees."""
    angles = motion.angles.copy()
    for name, target in degrees.items():
        column = DOFS.index(name)
        angles[:, column] += np.asarray(on) * (np.radians(target) - angles[:, column])
    return Motion(motion.time, motion.root, angles)


def look_ahead(motion: Motion, share: float = 0.35) -> Motion:
    """The same motion of someone who keeps looking ahead: the head turns only by a share of what it did."""
    angles = motion.angles.copy()
    angles[:, [DOFS.index("neck_rotation"), DOFS.index("thorax_rotation")]] *= share
    return Motion(motion.time, motion.root, angles)
