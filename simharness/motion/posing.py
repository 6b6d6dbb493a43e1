"""From a pelvis, feet on the floor and the angles of the upper body to a motion: the legs are solved to fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from simharness.humans.anatomy import DOFS, SIDES
from simharness.motion.kinematics import Kinematics
from simharness.motion.motion import Motion

Floats = NDArray[np.float64]


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
        bob: how it goes up and down, (T,) metres; its height over the floor is the legs' matter.
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


def stand_on(
    kinematics: Kinematics,
    time: Floats,
    pelvis: Pelvis,
    feet: Mapping[str, Foot],
    angles: Floats,
    *,
    guess: Mapping[str, Floats],
    straightest: float,
) -> Motion:
    """Let the pelvis ride as high as its legs allow, and solve them so that the feet are where they should be.

    Args:
        kinematics: the body.
        time: seconds, (T,).
        pelvis: its motion.
        feet: by side.
        angles: of the upper body, (T, D); the legs' columns are overwritten.
        guess: by side, flexion of hip and knee and dorsiflexion of the ankle to start the solution from, (T, 3) or
            (3,), radians.
        straightest: the least flexion that a knee comes to, radians; it sets the height.
    """
    turn = pelvis.turn.as_matrix()
    highest = [riding_height(kinematics, side, pelvis.ground, turn, feet[side].ankle, straightest) for side in SIDES]
    # One constant for the whole motion: a height fitted frame by frame would jolt with every step.
    height = pelvis.bob + np.min(highest - pelvis.bob, initial=np.inf)
    position = np.column_stack([pelvis.ground, height])

    angles = angles.copy()
    order = kinematics.leg_order
    sagittal = [order.index(name) for name in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]
    inward = turn.swapaxes(1, 2)
    for side in SIDES:
        start = np.zeros((len(position), len(order)))
        start[:, sagittal] = guess[side]
        place = (inward @ (feet[side].ankle - position)[..., None])[..., 0]
        solved = kinematics.legs[side].solve(inward @ feet[side].turn, place, start=start)
        angles[:, [DOFS.index(f"{side}_{name}") for name in order]] = solved
    quaternion = Rotation.from_matrix(turn).as_quat(scalar_first=True)
    return Motion(time, root=np.concatenate([position, quaternion], axis=1), angles=angles)


def riding_height(
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
