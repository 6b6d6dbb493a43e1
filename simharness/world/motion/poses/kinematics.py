"""Forward kinematics of one body, computed with the MuJoCo model of the person, and the roll of its soles."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from scipy.ndimage import gaussian_filter1d

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17
from simharness.world.humans.anatomy import ARM, DOFS, LEG, RANGES, SIDES, TRUNK
from simharness.world.humans.body import Body
from simharness.world.humans.mujoco_model import bone_transforms, person_spec
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematic_chain import Chain

_FEET = {"left": "LeftFoot", "right": "RightFoot"}
_ORIGIN = np.array([0.0, 0, 0, 1, 0, 0, 0])
_SOLE = 0.03  # metres: skin this near the floor in the neutral stance belongs to the sole
_KNEE = 0.04  # metres: half the height and width of the knee region
_STEP, _ROUNDING = 0.25, 5.0  # degrees: of the pitch of a foot that rolls
_PALM = 0.02  # metres: half the height of the region at the centre of the palm


class Kinematics:
    """Kinematics of one body: its MuJoCo model and the chains of its limbs.

    All chains are described in the pelvis frame of the neutral pose: x forward, y to the left, z up.

    Attributes:
        body: body.
        spec: MuJoCo model, made once because that is slow; copies can be attached to other models.
        legs: by side, chain of the six hinges of ``LEG`` from the pelvis to the ankle, which is the end.
        trunks: by side, chain of the seven hinges from the pelvis over lumbar spine and thorax to the clavicle. Its end
            is the origin: ``turn @ x + place`` is the new position of a point x of the shoulder girdle in the neutral
            pose.
        arms: by side, chain of the six hinges of ``ARM`` from the clavicle to the hand, in the frame at the end of the
            trunk. The end is the centre of the palm, on the skin; at zero the fingers point to -z, the thumb to +x, and
            the palm to the thigh, which is -y for the left hand and +y for the right one.
        ranges: lowest and highest value of every angle, (D, 2) radians.
    """

    def __init__(self, body: Body) -> None:
        self.body = body
        self.spec = person_spec(body, "person")
        self._model = self.spec.copy().compile()
        self._data = mujoco.MjData(self._model)
        self._address = Addresses(self._model, body, prefix="")
        self.ranges = np.array([RANGES[name] for name in DOFS])
        self._neutral = self._pose(_ORIGIN, np.zeros(len(DOFS)))
        self.legs = {
            side: self._chain([f"{side}_{name}" for name in LEG], end=self._head(_FEET[side])) for side in SIDES
        }
        self.trunks = {side: self._chain(self.trunk_order(side), end=np.zeros(3)) for side in SIDES}
        self.arms = {side: self._chain([f"{side}_{name}" for name in ARM], end=self._palm(side)) for side in SIDES}

    @staticmethod
    def trunk_order(side: str) -> list[str]:
        """Return the names of the hinges of one side's trunk in the order of the chain."""
        return [*TRUNK, f"{side}_clavicle_elevation"]

    def transforms(self, motion: Motion) -> Floats:
        """Return the skinning transforms of the bones, (T, B, 3, 4)."""
        poses = [self._pose(root, angles) for root, angles in zip(motion.root, motion.angles, strict=True)]
        return bone_transforms(self.body, *map(np.stack, zip(*poses, strict=True)))

    def joints(self, motion: Motion) -> Floats:
        """Return the COCO-17 joints, (T, 17, 3) metres."""
        return self.body.joints(self.transforms(motion))

    def linearised(self, motion: Motion) -> "LinearPose":
        """Return joints and feet, and how they move with the pose."""
        frames, bones = len(motion), len(self.body.bones)
        places, turns = np.empty((frames, bones, 3)), np.empty((frames, bones, 3, 3))
        anchors, axes = np.empty((2, frames, len(DOFS), 3))
        for frame, (root, angles) in enumerate(zip(motion.root, motion.angles, strict=True)):
            places[frame], turns[frame] = self._pose(root, angles)
            anchors[frame], axes[frame] = self._data.xanchor[self._hinges], self._data.xaxis[self._hinges]
        near = np.flatnonzero(self.body.keypoints[: len(COCO17)].any(axis=(0, 2)))  # bones that carry joints
        transforms = bone_transforms(self.body, places, turns)[:, None, near]
        keypoints, moves = self.body.keypoints[: len(COCO17), near], self._moves[:, near]
        points = (transforms @ keypoints[..., None])[..., 0]  # share of each bone in each joint, (T, 17, B, 3)
        joints = points.sum(axis=2)
        moved = moves @ points - (keypoints[:, :, 3] @ moves.T)[..., None] * anchors[:, None]
        translation = np.broadcast_to(np.eye(3), (*joints.shape[:2], 3, 3))
        rotation = np.cross(np.eye(3), (joints - motion.root[:, None, :3])[:, :, None])
        derivatives = np.concatenate([translation, rotation, np.cross(axes[:, None], moved)], axis=2)
        feet = [self.body.index(_FEET[side]) for side in SIDES]
        spins = np.broadcast_to(np.concatenate([np.zeros((3, 3)), np.eye(3)]), (frames, 2, 6, 3))
        turning = np.concatenate([spins, axes[:, None] * self._moves.T[feet][None, :, :, None]], axis=2)
        return LinearPose(joints, derivatives.swapaxes(2, 3), places[:, feet], turns[:, feet], turning.swapaxes(2, 3))

    @cached_property
    def _hinges(self) -> list[int]:
        """Indices of the hinges in the MuJoCo model, (D,)."""
        return [self._model.joint(name).id for name in DOFS]

    @cached_property
    def _moves(self) -> Floats:
        """Whether a hinge moves a bone, (D, B)."""
        moves = np.zeros((len(DOFS), len(self.body.bones)))
        own = self._model.jnt_bodyid[self._hinges]
        for bone, name in enumerate(self.body.bones):
            above = self._model.body(name).id
            while above:
                moves[own == above, bone] = 1.0
                above = self._model.body_parentid[above]
        return moves

    @cached_property
    def neutral_skin(self) -> Floats:
        """Skin vertices of the neutral pose in the pelvis frame, (n, 3) metres."""
        return self.body.skin(bone_transforms(self.body, *self._neutral)).astype(float)

    @cached_property
    def soles(self) -> dict[str, Floats]:
        """By side, skin vertices under the flat foot relative to the ankle, (n, 3) metres."""
        neutral = self.neutral_skin
        floor = neutral[:, 2].min()
        result = {}
        for side in SIDES:
            foot = self._neutral[0][self.body.bones.index(_FEET[side])]
            on_sole = (np.sign(neutral[:, 1]) == np.sign(foot[1])) & (neutral[:, 2] < floor + _SOLE)
            result[side] = neutral[on_sole] - foot
        return result

    @cached_property
    def standing_height(self) -> float:
        """Height of the pelvis above the floor in the neutral stance, metres."""
        return -float(self.neutral_skin[:, 2].min())

    @cached_property
    def rolling(self) -> "FootRoll":
        """Foot roll of the left foot; the sole of the right foot is its mirror image."""
        return roll_sole(self.soles["left"])

    @cached_property
    def leg_parts(self) -> tuple[float, float]:
        """Lengths of thigh and shank, metres."""
        leg = self.legs["left"]
        hip, knee, ankle = leg.anchors[0], leg.anchors[LEG.index("knee_flexion")], leg.end
        return float(np.linalg.norm(knee - hip)), float(np.linalg.norm(ankle - knee))

    @cached_property
    def kneecap(self) -> float:
        """Distance from the axis of the knee forward to the skin, metres."""
        leg = self.legs["left"]
        knee = leg.anchors[LEG.index("knee_flexion")]
        near = (np.abs((self.neutral_skin - knee)[:, 1:]) < _KNEE).all(axis=1)
        return float((self.neutral_skin[near, 0] - knee[0]).max())

    @property
    def leg_length(self) -> float:
        """Distance from hip to ankle, metres."""
        leg = self.legs["left"]
        return float(np.linalg.norm(leg.end - leg.anchors[0]))

    def _pose(self, root: Floats, angles: Floats) -> tuple[Floats, Floats]:
        self._address.write(self._data.qpos, root, angles)
        mujoco.mj_kinematics(self._model, self._data)
        return self._address.read(self._data)

    def _palm(self, side: str) -> Floats:
        """Return the centre of the palm in the neutral pose, on the skin, (3,) metres."""
        body, bones = self.body, [f"{side.capitalize()}{name}" for name in ("Hand", "FingerBase", "HandFinger1")]
        hand = self.neutral_skin[body.skin_of(bones)]
        middle = (self._head(bones[0]) + self._head(bones[-1])) / 2  # between wrist and knuckles
        slice_ = hand[np.abs(hand[:, 2] - middle[2]) < _PALM]
        inward = -np.sign(middle[1])
        ahead = (slice_[:, 0].min() + slice_[:, 0].max()) / 2
        core = inward * slice_[np.abs(slice_[:, 0] - ahead) < _PALM, 1]
        return np.array([ahead, inward * np.median(core[core > core.mean()]), middle[2]])

    def _head(self, bone: str) -> Floats:
        """Return the head of a bone in the neutral pose, (3,) metres."""
        return self._neutral[0][self.body.index(bone)]

    def _chain(self, hinges: Sequence[str], *, end: Floats) -> Chain:
        """Return the chain of hinges in the pelvis frame, read from MuJoCo in the neutral configuration."""
        self._pose(_ORIGIN, np.zeros(len(DOFS)))
        ids = [self._model.joint(name).id for name in hinges]
        axes, anchors = self._data.xaxis[ids].copy(), self._data.xanchor[ids].copy()
        return Chain(axes, anchors, end, np.array([RANGES[name] for name in hinges]))


Cast = Sequence[Kinematics]
"""Bodies in the order of the people."""


@dataclass(frozen=True)
class LinearPose:
    """Joints and feet over T frames, and their derivatives by the pose.

    The columns of the derivatives are translation and rotation of the pelvis in the world, metres and radians, and the
    D angles. Feet are left and right.
    """

    joints: Floats
    """COCO-17 joints, (T, 17, 3) metres."""
    joint_derivatives: Floats
    """Derivatives of the joints, (T, 17, 3, 6 + D)."""
    ankles: Floats
    """Hinges of the ankles, (T, 2, 3) metres."""
    feet: Floats
    """Orientations of the feet, (T, 2, 3, 3)."""
    foot_derivatives: Floats
    """Rotations of the feet in the world, (T, 2, 3, 6 + D)."""


class Addresses:
    """Indices of one person's configuration and bones in the arrays of a MuJoCo model.

    Args:
        model: compiled model that contains the person.
        body: body of the person.
        prefix: prefix of the person's names, such as "person0/".
    """

    def __init__(self, model: mujoco.MjModel, body: Body, *, prefix: str) -> None:
        root = model.joint(f"{prefix}root").qposadr[0]
        self._root = np.arange(root, root + 7)
        self._hinges = np.array([model.joint(f"{prefix}{name}").qposadr[0] for name in DOFS])
        self._bones = np.array([model.body(f"{prefix}{name}").id for name in body.bones])

    def write(self, qpos: Floats, root: Floats, angles: Floats) -> None:
        """Set the person's part of ``qpos`` to a root (7,) and angles (D,)."""
        qpos[self._root] = root
        qpos[self._hinges] = angles

    def read(self, data: mujoco.MjData) -> tuple[Floats, Floats]:
        """Return copies of positions (B, 3) and orientations (B, 3, 3) of the bones after ``mj_kinematics``."""
        return data.xpos[self._bones], data.xmat[self._bones].reshape(-1, 3, 3)


@dataclass(frozen=True)
class FootRoll:
    """Position of the ankle as a function of the pitch of the foot."""

    pitch: Floats
    """Pitch, toes up positive, (n,) radians, ascending."""
    ahead: Floats
    """Forward offset of the ankle from its position over the flat foot, (n,) metres."""
    height: Floats
    """Height of the ankle while the lowest point of the sole touches the floor, (n,) metres."""
    passing: Floats
    """As ``height``, but smooth where the lowest point changes from toe to heel, and nowhere lower, (n,) metres; for a
    foot in the air."""

    def at(self, pitch: Floats) -> tuple[Floats, Floats]:
        """Return forward offset and height of the ankle at pitches (...), metres."""
        return np.interp(pitch, self.pitch, self.ahead), np.interp(pitch, self.pitch, self.height)

    def spare(self, pitch: Floats) -> Floats:
        """Return the floor clearance of a swinging foot at pitches (...), metres."""
        return np.interp(pitch, self.pitch, self.passing - self.height)


def roll_sole(sole: Floats) -> FootRoll:
    """Roll a rigid sole over its edges: at each pitch the lowest point touches the floor and does not slip.

    Args:
        sole: points of the flat sole relative to the ankle, x forward, z up, (n, 3) metres.
    """
    pitch = np.radians(np.arange(-95.0, 95.0, _STEP))
    forward, up = sole[:, 0], sole[:, 2]
    x = forward * np.cos(pitch)[:, None] - up * np.sin(pitch)[:, None]
    z = forward * np.sin(pitch)[:, None] + up * np.cos(pitch)[:, None]
    touching = z.argmin(axis=1)
    rows = np.arange(len(pitch) - 1)
    ahead = np.concatenate([[0.0], np.cumsum(x[rows, touching[:-1]] - x[rows + 1, touching[:-1]])])
    ahead -= np.interp(0.0, pitch, ahead)
    height = -z.min(axis=1)
    passing = np.maximum(height, gaussian_filter1d(height, _ROUNDING / _STEP))
    return FootRoll(pitch=pitch, ahead=ahead, height=height, passing=passing)
