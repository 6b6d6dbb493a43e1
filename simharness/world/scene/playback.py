"""Kinematic playback: the motions drive the MuJoCo model, which gives positions of people and objects at any time."""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.skeleton import COCO17
from simharness.types.sequence import LANDMARKS, Sequence
from simharness.world.humans.body import body_model
from simharness.world.humans.mujoco_model import bone_transforms
from simharness.world.motion.motion import presence_at
from simharness.world.motion.poses.kinematics import Addresses
from simharness.world.scene.build import Scene

_NOWHERE = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0]])
"""Transform of all bones of an absent person: every point to 1 m under the origin."""


@dataclass(frozen=True)
class PlaybackState:
    """Positions of all people and moving solids at one time."""

    time: float
    """Time in seconds."""
    landmarks: Floats
    """Positions of ``simharness.types.sequence.LANDMARKS`` in the world, (P, L, 3), metres."""
    bones: Floats
    """Skinning transforms from rest pose to world, (P, B, 3, 4); those of an absent person take the whole body to one
    point under the floor, where it stops no ray."""
    placements: Floats
    """Poses of the moving solids of the scene in their order, (M, 7): metres, quaternion w x y z."""
    present: Bools
    """Who is in the scene, (P,)."""

    @property
    def joints(self) -> Floats:
        """COCO-17 joints in the world, (P, 17, 3), metres."""
        return self.landmarks[:, : len(COCO17)]


class Playback:
    """Playback of a scene at any time. It holds one MuJoCo state, so it must not be shared between threads.

    Attributes:
        scene: scene to play.
        data: MuJoCo state, that of the last :class:`PlaybackState` returned.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.data = mujoco.MjData(scene.model)
        self._people = [Addresses(scene.model, body, prefix=f"person{i}/") for i, body in enumerate(scene.bodies)]
        self._mocap = [int(scene.model.body(solid.name).mocapid[0]) for solid in scene.moving]
        self._empty = np.zeros((0, len(body_model().bones), 3, 4))

    def at(self, time: float) -> PlaybackState:
        """Return the state of the scene at one time in seconds."""
        return next(self.over([time]))

    def over(self, times: ArrayLike) -> Iterator[PlaybackState]:
        """Yield the states of the scene at times (n,) in seconds."""
        times = np.asarray(times, float)
        motions = [motion.read(times) for motion in self.scene.motions]
        present = presence_at(self.scene.presence, times)
        placements = np.empty((len(times), len(self._mocap), 7))
        for k, solid in enumerate(self.scene.moving):
            assert solid.trajectory is not None  # all moving solids have one
            placements[:, k] = solid.trajectory.at(times)
        for n, time in enumerate(times):
            for address, (root, angles) in zip(self._people, motions, strict=True):
                address.write(self.data.qpos, root[n], angles[n])
            self.data.mocap_pos[self._mocap] = placements[n, :, :3]
            self.data.mocap_quat[self._mocap] = placements[n, :, 3:]
            mujoco.mj_kinematics(self.scene.model, self.data)
            bones = [
                bone_transforms(body, *address.read(self.data))
                for body, address in zip(self.scene.bodies, self._people, strict=True)
            ]
            landmarks = [body.landmarks(pose) for body, pose in zip(self.scene.bodies, bones, strict=True)]
            transforms = np.stack(bones) if bones else self._empty
            transforms[~present[n]] = _NOWHERE
            shown = np.stack(landmarks) if landmarks else np.zeros((0, len(LANDMARKS), 3))
            yield PlaybackState(float(time), shown, transforms, placements[n], present[n])


def simulate(scene: Scene) -> Sequence:
    """Return the landmarks of all people at the times of the frames, (T, P, L, 3); P may be 0.

    These are the nominal times of the frames: the clocks of the cameras have no influence.
    """
    landmarks = np.empty((len(scene.time), len(scene.bodies), len(LANDMARKS), 3))
    for frame, state in enumerate(Playback(scene).over(scene.time)):
        landmarks[frame] = state.landmarks
    return Sequence(landmarks, np.arange(len(scene.bodies)), scene.time, presence_at(scene.presence, scene.time))
