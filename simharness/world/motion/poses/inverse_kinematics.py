"""From a pelvis, feet on the floor and the angles of the upper body to a motion: the legs are solved to fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import DOFS, SIDES
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematic_chain import Chain
from simharness.world.motion.poses.kinematics import Kinematics

_REACH, _FULL_REACH = 0.95, 0.985  # of an arm's length: up to where it goes freely, and at most
_PULL = 0.01  # metres a radian: of an arm towards the angles that it starts from; costs its palm 0.3 mm or so


@dataclass(frozen=True)
class Foot:
    """Where one foot is to be in every frame.

    Attributes:
        ankle: metres, (T, 3).
        bearing: direction of the toes, (T,) radians from the x axis.
        pitch: toes up positive, (T,) radians.
    """

    ankle: Floats
    bearing: Floats
    pitch: Floats

    @property
    def turn(self) -> Floats:
        """Orientation against the neutral foot, (T, 3, 3)."""
        return Rotation.from_euler("ZY", np.stack([self.bearing, -self.pitch], axis=-1)).as_matrix()


@dataclass(frozen=True)
class Pelvis:
    """Where the pelvis is in every frame.

    Attributes:
        ground: the point that it is over, (T, 2) metres.
        bob: how it goes up and down, (T,) metres, about a height over the floor that is given apart.
        bearing: the direction that it faces, (T,) radians from the x axis.
        lean: forward positive, (T,) radians.
        list: left side up positive, (T,) radians.
    """

    ground: Floats
    bob: Floats
    bearing: Floats
    lean: Floats
    list: Floats

    @property
    def turn(self) -> Rotation:
        """Orientation of every frame."""
        return Rotation.from_euler("ZYX", np.stack([self.bearing, self.lean, self.list], axis=-1))


def pose_angles(frames: int, **degrees: ArrayLike) -> Floats:
    """Angles (T, D) in radians from named curves or constants in degrees; what is not named is 0."""
    angles = np.zeros((frames, len(DOFS)))
    for name, value in degrees.items():
        angles[:, DOFS.index(name)] = np.radians(value)
    return angles


def solve_standing(
    kinematics: Kinematics,
    time: Floats,
    pelvis: Pelvis,
    feet: Mapping[str, Foot],
    angles: Floats,
    *,
    guess: Mapping[str, Floats] | None = None,
    straightest: float,
    fit: tuple[Pelvis, Mapping[str, Foot]] | None = None,
) -> Motion:
    """Let the pelvis ride as high as its legs allow, and solve them so that the feet are where they should be.

    Args:
        kinematics: the body.
        time: seconds, (T,).
        pelvis: its motion.
        feet: by side.
        angles: of the upper body, (T, D); the legs' columns are overwritten.
        guess: as in :func:`solve_legs`.
        straightest: the least flexion that a knee comes to, radians; it sets the height.
        fit: the pelvis and the feet that the height is fitted to, where it shall not depend on which instants are
            asked for: all that they ever do, or the extremes of it; None: ``pelvis`` and ``feet``.
    """
    height = highest_pelvis(kinematics, *(fit or (pelvis, feet)), straightest=straightest)
    return solve_legs(kinematics, time, pelvis, height, feet, angles, guess=guess)


def highest_pelvis(kinematics: Kinematics, pelvis: Pelvis, feet: Mapping[str, Foot], *, straightest: float) -> float:
    """The greatest height of the pelvis, over which it bobs, at which no knee flexes less than ``straightest``.

    One constant for the whole motion: a height fitted frame by frame would jolt with every step.
    """
    turn = pelvis.turn.as_matrix()
    highest = [pelvis_height(kinematics, side, pelvis.ground, turn, feet[side].ankle, straightest) for side in SIDES]
    return float(np.min(highest - pelvis.bob, initial=np.inf))


def solve_legs(
    kinematics: Kinematics,
    time: Floats,
    pelvis: Pelvis,
    height: ArrayLike,
    feet: Mapping[str, Foot],
    angles: Floats,
    *,
    guess: Mapping[str, Floats] | None = None,
) -> Motion:
    """Solve the legs so that the feet are where they should be under a pelvis at a height, metres, (T,) or constant.

    Args:
        kinematics: the body.
        time: seconds, (T,).
        pelvis: its motion; ``bob`` is added to the height.
        height: of the pelvis over the floor.
        feet: by side.
        angles: of the upper body, (T, D); the legs' columns are overwritten.
        guess: by side, flexion of hip and knee and dorsiflexion of the ankle to start the solution from, (T, 3) or
            (3,), radians; None: those of a leg in its plane.
    """
    turn = pelvis.turn.as_matrix()
    position = np.column_stack([pelvis.ground, np.asarray(height, float) + pelvis.bob])
    angles = angles.copy()
    order = kinematics.leg_order
    sagittal = [order.index(name) for name in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]
    inward = turn.swapaxes(1, 2)
    for side in SIDES:
        place = (inward @ (feet[side].ankle - position)[..., None])[..., 0]
        start = np.zeros((len(position), len(order)))
        start[:, sagittal] = (
            _bent(kinematics, side, place, feet[side].pitch + pelvis.lean) if guess is None else guess[side]
        )
        solved = kinematics.legs[side].solve(inward @ feet[side].turn, place, start=start)
        angles[:, [DOFS.index(f"{side}_{name}") for name in order]] = solved
    quaternion = Rotation.from_matrix(turn).as_quat(scalar_first=True)
    return Motion(time, root=np.concatenate([position, quaternion], axis=1), angles=angles)


def _bent(kinematics: Kinematics, side: str, ankle: Floats, pitch: Floats) -> Floats:
    """Flexions (T, 3) of hip, knee and ankle in the plane for an ankle (T, 3) and a foot's pitch (T,), of the pelvis.

    Exact where neither rolls out of the plane; a start elsewhere.
    """
    leg = kinematics.legs[side]
    thigh, shank = kinematics.leg_parts
    way = ankle - leg.anchors[0]
    far = np.clip(np.linalg.norm(way, axis=1), abs(thigh - shank) + 1e-3, thigh + shank - 1e-4)
    knee = np.pi - np.arccos((thigh**2 + shank**2 - far**2) / (2 * thigh * shank))
    above = np.arccos((thigh**2 + far**2 - shank**2) / (2 * thigh * far))
    hip = np.arctan2(way[:, 0], -way[:, 2]) + above
    return np.stack([hip, knee, pitch - hip + knee], axis=-1)


def pelvis_height(
    kinematics: Kinematics, side: str, ground: Floats, turn: Floats, ankle: Floats, knee: float
) -> Floats:
    """The height of the pelvis at which a knee flexes by ``knee`` radians, (T,) metres.

    Args:
        kinematics: the body.
        side: of the leg.
        ground: the point that the pelvis is over, (T, 2) metres.
        turn: how it is turned, (T, 3, 3).
        ankle: where the ankle is, (T, 3) metres. One too far away gives the hip the ankle's height.
        knee: flexion, radians.
    """
    leg = kinematics.legs[side]
    hip = turn @ leg.anchors[0]
    bent = np.zeros((1, len(leg.axes)))
    bent[:, kinematics.leg_order.index("knee_flexion")] = knee
    length = np.linalg.norm(leg.forward(bent)[1] - leg.anchors[0])
    across = np.linalg.norm(ankle[:, :2] - ground - hip[:, :2], axis=1)
    return ankle[:, 2] - hip[:, 2] + np.sqrt(np.maximum(length**2 - across**2, 0.0))


def shoulder_girdle(kinematics: Kinematics, motion: Motion, side: str) -> tuple[Floats, Floats]:
    """Where the pelvis, the trunk and the clavicle have carried the frame of an arm, (T, 3, 3) and (T, 3) metres."""
    pelvis = Rotation.from_quat(motion.root[:, 3:], scalar_first=True).as_matrix()
    columns = [DOFS.index(name) for name in kinematics.trunk_order(side)]
    turn, place = kinematics.trunks[side].forward(motion.angles[:, columns])
    return pelvis @ turn, (pelvis @ place[..., None])[..., 0] + motion.root[:, :3]


def palm_pose(kinematics: Kinematics, motion: Motion, side: str) -> tuple[Floats, Floats]:
    """Orientation (T, 3, 3) and place (T, 3), metres, of the middle of a palm; see ``Kinematics.arms``."""
    base, origin = shoulder_girdle(kinematics, motion, side)
    turn, place = kinematics.arms[side].forward(motion.angles[:, arm_columns(kinematics, side)])
    return base @ turn, (base @ place[..., None])[..., 0] + origin


def arm_columns(kinematics: Kinematics, side: str) -> list[int]:
    """Where the angles of an arm lie among all, in the chain's order."""
    return [DOFS.index(f"{side}_{name}") for name in kinematics.arm_order]


def arm_angles(kinematics: Kinematics, **degrees: float) -> Floats:
    """Angles of an arm in the chain's order, (6,) radians, from degrees by name without the side; 0 if not named."""
    unknown = degrees.keys() - set(kinematics.arm_order)
    if unknown:
        raise ValueError(f"an arm has no {sorted(unknown)}; its hinges are {', '.join(kinematics.arm_order)}")
    return np.radians([degrees.get(name, 0.0) for name in kinematics.arm_order])


def reach_with(
    kinematics: Kinematics,
    motion: Motion,
    side: str,
    place: Floats,
    *,
    turn: Floats | None = None,
    weight: ArrayLike = 1.0,
    guess: ArrayLike | None = None,
    turn_weight: float = 0.03,
    follow: bool = False,
) -> Motion:
    """The same motion with an arm that brings the middle of its palm to places in the world.

    The trunk is as in the motion. What is more than 95 % of the arm's length away from the shoulder is approached only
    in its direction, for an arm that becomes straight has no smooth motion.

    Args:
        kinematics: the body.
        motion: what everything else does.
        side: of the arm.
        place: of the palm, (T, 3) metres.
        turn: its orientation, (T, 3, 3), the identity being that of the neutral pose; None: as it comes.
        weight: how far the arm goes from its own angles to the solved ones, (T,) or one for all, 0 to 1.
        guess: the arm's angles to start the solution from, (T, 6) or (6,) radians; None: the motion's own. Where the
            target leaves the arm free it stays near them, and what is smooth in them is smooth in the solution.
        turn_weight: what a radian of wrong orientation counts for, metres.
        follow: as in ``Chain.solve``; wise where ``turn`` is given.
    """
    weight = np.broadcast_to(np.asarray(weight, float), len(motion))
    columns, on = arm_columns(kinematics, side), weight > 0
    own = motion.angles[:, columns]
    start = own if guess is None else np.broadcast_to(np.asarray(guess, float), own.shape)
    base, origin = shoulder_girdle(kinematics, motion, side)
    inward = base[on].swapaxes(1, 2)
    arm = kinematics.arms[side]
    solved = arm.solve(
        None if turn is None else inward @ turn[on],
        _within_reach((inward @ (place[on] - origin[on])[..., None])[..., 0], arm),
        start=start[on],
        turn_weight=turn_weight,
        pull=_PULL,
        follow=follow,
    )
    angles = motion.angles.copy()
    own[on] += weight[on, None] * (solved - own[on])
    angles[:, columns] = own
    return Motion(motion.time, motion.root, angles)


def _within_reach(place: Floats, arm: Chain) -> Floats:
    """Places (T, 3), those near the end of an arm's reach and beyond drawn in, smoothly."""
    shoulder = arm.anchors[0]
    length = np.linalg.norm(arm.end - shoulder)
    way = place - shoulder
    far = np.linalg.norm(way, axis=1)
    over = np.maximum(far / length - _REACH, 0.0) / (_FULL_REACH - _REACH)
    near = np.where(over > 0, length * (_REACH + (_FULL_REACH - _REACH) * np.tanh(over)), far)
    return shoulder + way * (near / np.maximum(far, 1e-9))[:, None]
