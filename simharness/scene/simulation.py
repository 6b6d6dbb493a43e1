"""Kinematic playback: the motions drive the MuJoCo model, and its bodies tell where every bone is."""

from __future__ import annotations

import mujoco
import numpy as np

from simharness.humans.body import body_model
from simharness.humans.model import bone_transforms
from simharness.motion.kinematics import Addresses
from simharness.scene.build import Scene
from simharness.scene.sequence import Sequence


def simulate(scene: Scene) -> Sequence:
    """Play the scene's motions through its MuJoCo model, frame by frame.

    Returns:
        The joints and bone transforms of everyone in every frame; arrays of P = 0 for an empty room.
    """
    frames, people = len(scene.time), len(scene.bodies)
    bones = len(body_model().bones)
    places = np.empty((people, frames, bones, 3))
    turns = np.empty((people, frames, bones, 3, 3))
    addresses = [Addresses(scene.model, body, prefix=f"person{i}/") for i, body in enumerate(scene.bodies)]
    data = mujoco.MjData(scene.model)
    motions = [motion.at(scene.time) for motion in scene.motions]
    for frame in range(frames):
        for address, motion in zip(addresses, motions, strict=True):
            address.write(data.qpos, motion.root[frame], motion.angles[frame])
        mujoco.mj_kinematics(scene.model, data)
        for i, address in enumerate(addresses):
            places[i, frame], turns[i, frame] = address.read(data)
    transforms = np.empty((frames, people, bones, 3, 4))
    joints = np.empty((frames, people, 17, 3))
    for i, body in enumerate(scene.bodies):
        transforms[:, i] = bone_transforms(body, places[i], turns[i])
        joints[:, i] = body.joints(transforms[:, i])
    return Sequence(joints=joints, ids=np.arange(people), time=scene.time, bones=transforms)
