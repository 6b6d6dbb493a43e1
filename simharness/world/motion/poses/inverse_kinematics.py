"""Inverse kinematics of a body: legs for a given pelvis and feet, and arms that reach for given positions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import ARM, DOFS, LEG, SIDES
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematic_chain import Chain
from simharness.world.motion.poses.kinematics import Kinematics

_REACH, _FULL_REACH = 0.95, 0.985  # of the arm length: largest distance reached exactly, and largest distance at all
_PULL = 0.01  # metres per radian: pull of an arm towards its start angles; moves the palm by about 0.3 mm

PALM_DOWN = {
    "right": np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "left": np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
"""By side, orientation of a hand that lies on its palm, fingers ahead; columns: its x (thumb), y and z (wrist) axes."""


@dataclass(frozen=True)
class Foot:
    """Target pose of one foot in every frame."""

    ankle: Floats
    """Position of the ankle, (T, 3) metres."""
    bearing: Floats
    """Direction of the toes, (T,) radians from the x axis."""
    pitch: Floats
    """Pitch, toes up positive, (T,) radians."""

    @property
    def turn(self) -> Floats:
        """Orientation relative to the neutral foot, (T, 3, 3)."""
        return Rotation.from_euler("ZY", np.stack([self.bearing, -self.pitch], axis=-1)).as_matrix()


Feet = Mapping[str, Foot]
"""Feet by side."""


@dataclass(frozen=True)
class Pelvis:
    """Pose of the pelvis in every frame, except for its mean height."""

    ground: Floats
    """Position on the floor, (T, 2) metres."""
    bob: Floats
    """Vertical displacement about a height above the floor that is given separately, (T,) metres."""
    bearing: Floats
    """Facing direction, (T,) radians from the x axis."""
    lean: Floats
    """Lean, forward positive, (T,) radians."""
    list: Floats
    """List, left side up positive, (T,) radians."""

    @classmethod
    def along(
        cls, ground: Floats, bearing: ArrayLike, *, lean: ArrayLike = 0.0, list: ArrayLike = 0.0, bob: ArrayLike = 0.0
    ) -> "Pelvis":
        """Return the pelvis along a path (T, 2) on the floor; each other value is (T,) or constant."""
        values = (np.broadcast_to(np.asarray(each, float), len(ground)) for each in (bob, bearing, lean, list))
        return cls(ground, *values)

    @property
    def turn(self) -> Rotation:
        """Orientation in every frame."""
        return Rotation.from_euler("ZYX", np.stack([self.bearing, self.lean, self.list], axis=-1))


def solve_standing(
    kinematics: Kinematics,
    time: Floats,
    pelvis: Pelvis,
    feet: Feet,
    posture: Mapping[str, ArrayLike],
    *,
    straightest: float,
    fit: tuple[Pelvis, Feet] | None = None,
) -> Motion:
    """Place the pelvis as high as the legs allow, and solve the legs for the given feet.

    The mean height is one constant for the whole motion, the greatest at which no knee flexes less than
    ``straightest``: a height fitted frame by frame would jerk at every step.

    Args:
        kinematics: body.
        time: times in seconds, (T,).
        pelvis: motion of the pelvis.
        feet: motion of the feet by side.
        posture: curves (T,) or constants of the upper body by degree of freedom, degrees; all others are 0.
        straightest: smallest flexion of a knee, radians; it determines the height.
        fit: pelvis and feet to which the height is fitted, if it must not depend on ``time``: their whole cycle, or its
            extremes; None: ``pelvis`` and ``feet``.
    """
    fitted, planted = fit or (pelvis, feet)
    turn, ground = fitted.turn.as_matrix(), fitted.ground
    highest = [pelvis_height(kinematics, side, ground, turn, planted[side].ankle, straightest) for side in SIDES]
    height = float(np.min(highest - fitted.bob, initial=np.inf))
    return solve_legs(kinematics, time, pelvis, height, feet, posture)


def solve_legs(
    kinematics: Kinematics,
    time: Floats,
    pelvis: Pelvis,
    height: ArrayLike,
    feet: Feet,
    posture: Mapping[str, ArrayLike],
) -> Motion:
    """Solve the legs so that the feet reach their targets under a given pelvis.

    Args:
        kinematics: body.
        time: times in seconds, (T,).
        pelvis: motion of the pelvis; ``bob`` is added to the height.
        height: height of the pelvis above the floor, (T,) or constant, metres.
        feet: target motion of the feet by side.
        posture: curves (T,) or constants of the upper body by degree of freedom, degrees; all others are 0.
    """
    turn = pelvis.turn.as_matrix()
    position = np.column_stack([pelvis.ground, np.asarray(height, float) + pelvis.bob])
    angles = np.zeros((len(position), len(DOFS)))
    for name, value in posture.items():
        angles[:, DOFS.index(name)] = np.radians(value)
    order = LEG
    sagittal = [order.index(name) for name in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]
    inward = turn.swapaxes(1, 2)
    for side in SIDES:
        place = (inward @ (feet[side].ankle - position)[..., None])[..., 0]
        start = np.zeros((len(position), len(order)))
        start[:, sagittal] = _bent(kinematics, side, place, feet[side].pitch + pelvis.lean)
        solved = kinematics.legs[side].solve(inward @ feet[side].turn, place, start=start)
        angles[:, [DOFS.index(f"{side}_{name}") for name in order]] = solved
    quaternion = Rotation.from_matrix(turn).as_quat(scalar_first=True)
    return Motion(time, root=np.concatenate([position, quaternion], axis=1), angles=angles)


def _bent(kinematics: Kinematics, side: str, ankle: Floats, pitch: Floats) -> Floats:
    """Return sagittal flexions (T, 3) of hip, knee and ankle for ankle (T, 3) and foot pitch (T,) in the pelvis frame.

    Exact if both stay in the sagittal plane, otherwise a start value.
    """
    leg = kinematics.legs[side]
    thigh, shank = kinematics.leg_parts
    offset = ankle - leg.anchors[0]
    far = np.clip(np.linalg.norm(offset, axis=1), abs(thigh - shank) + 1e-3, thigh + shank - 1e-4)
    knee = np.pi - np.arccos((thigh**2 + shank**2 - far**2) / (2 * thigh * shank))
    above = np.arccos((thigh**2 + far**2 - shank**2) / (2 * thigh * far))
    hip = np.arctan2(offset[:, 0], -offset[:, 2]) + above
    return np.stack([hip, knee, pitch - hip + knee], axis=-1)


def pelvis_height(
    kinematics: Kinematics, side: str, ground: Floats, turn: Floats, ankle: Floats, knee: float
) -> Floats:
    """Return the height of the pelvis at which a knee flexes by ``knee`` radians, (T,) metres.

    Args:
        kinematics: body.
        side: side of the leg.
        ground: position of the pelvis on the floor, (T, 2) metres.
        turn: orientation of the pelvis, (T, 3, 3).
        ankle: position of the ankle, (T, 3) metres. If it is out of reach, the hip gets the height of the ankle.
        knee: knee flexion, radians.
    """
    leg = kinematics.legs[side]
    hip = turn @ leg.anchors[0]
    bent = np.zeros((1, len(leg.axes)))
    bent[:, LEG.index("knee_flexion")] = knee
    length = np.linalg.norm(leg.forward(bent)[1] - leg.anchors[0])
    across = np.linalg.norm(ankle[:, :2] - ground - hip[:, :2], axis=1)
    return ankle[:, 2] - hip[:, 2] + np.sqrt(np.maximum(length**2 - across**2, 0.0))


def shoulder_girdle(kinematics: Kinematics, motion: Motion, side: str) -> tuple[Floats, Floats]:
    """Return orientation (T, 3, 3) and position (T, 3) in metres of the frame of an arm, which the clavicle carries."""
    pelvis = Rotation.from_quat(motion.root[:, 3:], scalar_first=True).as_matrix()
    columns = [DOFS.index(name) for name in kinematics.trunk_order(side)]
    turn, place = kinematics.trunks[side].forward(motion.angles[:, columns])
    return pelvis @ turn, (pelvis @ place[..., None])[..., 0] + motion.root[:, :3]


def arm_angles(kinematics: Kinematics, **degrees: float) -> Floats:
    """Return arm angles in chain order, (6,) radians, from degrees by name without the side; all others are 0."""
    unknown = degrees.keys() - set(ARM)
    if unknown:
        raise ValueError(f"an arm has no hinge {', '.join(sorted(unknown))}; its hinges are {', '.join(ARM)}")
    return np.radians([degrees.get(name, 0.0) for name in ARM])


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
    """Return the motion with an arm that brings the centre of its palm to given positions in the world.

    The rest of the body is unchanged. Positions further than 95 % of the arm length from the shoulder are only
    approached, because an arm that becomes straight does not move smoothly.

    Args:
        kinematics: body.
        motion: motion to change.
        side: side of the arm.
        place: target positions of the palm, (T, 3) metres.
        turn: target orientations of the palm, (T, 3, 3), the identity being the neutral pose; None: any orientation.
        weight: weight of the solved angles relative to those of ``motion``, (T,) or constant, 0 to 1.
        guess: start angles of the arm, (T, 6) or (6,) radians; None: those of ``motion``. If the target leaves the arm
            free, the solution stays near them and is as smooth as they are.
        turn_weight: weight of one radian of orientation error, in metres.
        follow: as for ``Chain.solve``; recommended with ``turn``.
    """
    weight = np.broadcast_to(np.asarray(weight, float), len(motion))
    columns, on = [DOFS.index(f"{side}_{name}") for name in ARM], weight > 0
    current = motion.angles[:, columns]
    start = current if guess is None else np.broadcast_to(np.asarray(guess, float), current.shape)
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
    current[on] += weight[on, None] * (solved - current[on])
    angles[:, columns] = current
    return Motion(motion.time, motion.root, angles)


def _within_reach(place: Floats, arm: Chain) -> Floats:
    """Return positions (T, 3), with those near or beyond the reach of an arm drawn in smoothly."""
    shoulder = arm.anchors[0]
    length = np.linalg.norm(arm.end - shoulder)
    offset = place - shoulder
    far = np.linalg.norm(offset, axis=1)
    over = np.maximum(far / length - _REACH, 0.0) / (_FULL_REACH - _REACH)
    near = np.where(over > 0, length * (_REACH + (_FULL_REACH - _REACH) * np.tanh(over)), far)
    return shoulder + offset * (near / np.maximum(far, 1e-9))[:, None]


_FREE = np.radians(5.0)  # before the end of the range, where the heel begins to rise
_SOFT = np.radians(2.0)  # in which the rise reaches its rate
# Rotation of the foot per rotation of the ankle that is saved. A heel that rises bends the knee, too, so that the ankle
# turns back by less than the foot; for a straight knee hardly at all, which is why this is not solved for the angle.
_RISE = 1.5


def follow_shank(
    kinematics: Kinematics, side: str, pelvis: Pelvis, height: Floats, pitch: Floats, foot: Callable[[Floats], Foot]
) -> Floats:
    """Return the pitch of a foot whose heel rises as the shank leans over it, (T,) radians.

    Where the ankle is far from the end of its range, the pitch is unchanged.

    Args:
        kinematics: body.
        side: side of the leg.
        pelvis: motion of the pelvis.
        height: height of the pelvis above the floor without ``bob``, (T,) metres.
        pitch: pitch to start from, toes up positive, (T,) radians.
        foot: motion of the foot with pitches (T,).
    """
    hips = np.column_stack([pelvis.ground, height + pelvis.bob]) + pelvis.turn.apply(kinematics.legs[side].anchors[0])
    highest = kinematics.ranges[DOFS.index(f"{side}_ankle_dorsiflexion"), 1]
    over = np.maximum(dorsiflexion(kinematics, hips, foot(pitch)) - (highest - _FREE), 0.0)
    return pitch - _RISE * over * over / (over + _SOFT)


def dorsiflexion(kinematics: Kinematics, hips: Floats, foot: Foot) -> Floats:
    """Return the dorsiflexion of the ankle below hips (T, 3), (T,) radians, if the knee points to the toes."""
    thigh, shank = kinematics.leg_parts
    below = hips - foot.ankle
    toes = np.stack([np.cos(foot.bearing), np.sin(foot.bearing)], axis=-1)
    ahead = (below[:, :2] * toes).sum(axis=-1)
    far = np.clip(np.linalg.norm(below, axis=-1), abs(thigh - shank) + 1e-3, thigh + shank - 1e-4)
    leaning = np.arcsin(np.clip(ahead / far, -1.0, 1.0))
    bent = np.arccos((shank**2 + far**2 - thigh**2) / (2 * shank * far))
    return leaning + bent + foot.pitch
