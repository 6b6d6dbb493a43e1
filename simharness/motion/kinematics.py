"""Forward kinematics of one body, read from the person's own MuJoCo model."""

from __future__ import annotations

from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from simharness.humans.anatomy import DOFS, RANGES, SIDES
from simharness.humans.body import Body
from simharness.humans.model import bone_transforms, person_spec
from simharness.motion.chain import Chain
from simharness.motion.motion import Motion

Floats = NDArray[np.float64]

_LEG = ("hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion", "ankle_dorsiflexion", "ankle_inversion")
_FEET = {"left": "LeftFoot", "right": "RightFoot"}
_SOLE = 0.03  # metres: skin this near the floor in the neutral stance belongs to the sole


class Kinematics:
    """One body's skeleton, ready to be posed: the person's MuJoCo model and the addresses in it.

    Attributes:
        body: the body.
        legs: by side, the six hinges from the pelvis to the ankle in the pelvis's frame.
        leg_order: the hinges of a leg, without the side, in the chain's order.
        ranges: lowest and highest value of every angle, (D, 2) radians.
    """

    leg_order = _LEG

    def __init__(self, body: Body) -> None:
        self.body = body
        self._model = person_spec(body, "person").compile()
        self._data = mujoco.MjData(self._model)
        self._address = Addresses(self._model, body, prefix="")
        self.ranges = np.array([RANGES[name] for name in DOFS])
        self._neutral = self._pose(np.array([0.0, 0, 0, 1, 0, 0, 0]), np.zeros(len(DOFS)))
        self.legs = {side: self._leg(side) for side in SIDES}

    def transforms(self, motion: Motion) -> Floats:
        """Skinning transforms of the bones, (T, B, 3, 4)."""
        bones = len(self.body.bones)
        places, turns = np.empty((len(motion), bones, 3)), np.empty((len(motion), bones, 3, 3))
        for frame, (root, angles) in enumerate(zip(motion.root, motion.angles, strict=True)):
            places[frame], turns[frame] = self._pose(root, angles)
        return bone_transforms(self.body, places, turns)

    def joints(self, motion: Motion) -> Floats:
        """The COCO-17 joints, (T, 17, 3) metres."""
        return self.body.joints(self.transforms(motion))

    @cached_property
    def soles(self) -> dict[str, Floats]:
        """By side, the skin under the foot relative to the ankle while the foot lies flat, (n, 3) metres."""
        neutral = self.body.skin(bone_transforms(self.body, *self._neutral)).astype(float)
        floor = neutral[:, 2].min()
        result = {}
        for side in SIDES:
            foot = self._neutral[0][self.body.bones.index(_FEET[side])]
            own = (np.sign(neutral[:, 1]) == np.sign(foot[1])) & (neutral[:, 2] < floor + _SOLE)
            result[side] = neutral[own] - foot
        return result

    @cached_property
    def standing_height(self) -> float:
        """Height of the pelvis over the floor in the neutral stance, metres."""
        return -float(self.body.skin(bone_transforms(self.body, *self._neutral))[:, 2].min())

    @property
    def leg_length(self) -> float:
        """From hip to ankle, metres."""
        leg = self.legs["left"]
        return float(np.linalg.norm(leg.end - leg.anchors[0]))

    def _pose(self, root: Floats, angles: Floats) -> tuple[Floats, Floats]:
        self._address.write(self._data.qpos, root, angles)
        mujoco.mj_kinematics(self._model, self._data)
        return self._address.read(self._data)

    def _leg(self, side: str) -> Chain:
        """The leg's chain in the pelvis's frame: what MuJoCo says while the data is in the neutral configuration."""
        hinges = [self._model.joint(f"{side}_{name}").id for name in _LEG]
        foot = self._neutral[0][self.body.bones.index(_FEET[side])]
        return Chain(
            axes=self._data.xaxis[hinges].copy(),
            anchors=self._data.xanchor[hinges].copy(),
            end=foot,
            ranges=np.array([RANGES[f"{side}_{name}"] for name in _LEG]),
        )


class Addresses:
    """Where one person's configuration and bones lie in the arrays of a MuJoCo model that holds the person.

    Args:
        model: the compiled model.
        body: the person's body.
        prefix: what the person's names begin with, "person0/".
    """

    def __init__(self, model: mujoco.MjModel, body: Body, *, prefix: str) -> None:
        root = model.joint(f"{prefix}root").qposadr[0]
        self._root = np.arange(root, root + 7)
        self._hinges = np.array([model.joint(f"{prefix}{name}").qposadr[0] for name in DOFS])
        self._bones = np.array([model.body(f"{prefix}{name}").id for name in body.bones])

    def write(self, qpos: Floats, root: Floats, angles: Floats) -> None:
        """Set the person's part of ``qpos`` from a root (7,) and angles (D,)."""
        qpos[self._root] = root
        qpos[self._hinges] = angles

    def read(self, data: mujoco.MjData) -> tuple[Floats, Floats]:
        """Positions (B, 3) and orientations (B, 3, 3) of the bones after ``mj_kinematics``, as copies."""
        return data.xpos[self._bones], data.xmat[self._bones].reshape(-1, 3, 3)
