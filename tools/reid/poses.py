"""Poses of the re-ID data set: motions are planned once on an average body and transferred to other bodies.

All bodies rest in the same A pose, so the rotation of a bone from rest to the world can be applied to the same bone of
another body; the bones are then joined end to end. Feet and hands are slightly displaced from their planned positions,
which does not show in a crop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.activity_registry import Activity
from simharness.world.motion.motion import motion_clock
from simharness.world.motion.paths import Loop, Spot, Track, draw_loop
from simharness.world.motion.poses.kinematics import Kinematics
from tools.poses.sample import activities_in_place

_DURATION = 4.0  # duration of every motion, seconds
_HALF = 2.0  # half the side of the square in which people walk, metres
_GRAVITY = 9.81


@dataclass(frozen=True)
class Poses:
    """N poses, each facing along x.

    Attributes:
        turns: rotations of the bones from rest to the world, (N, B, 3, 3).
    """

    turns: Floats

    def __len__(self) -> int:
        return len(self.turns)


def plan_poses(seed: int, *, frames: int = 40, takes: int = 2) -> Poses:
    """Sample poses from the motions of all activities.

    Args:
        seed: seed of the motions and of the sampled times.
        frames: number of poses per motion.
        takes: number of motions per activity, drawn independently.
    """
    mover = Kinematics(make_body(Shape()))
    turns = [
        _level(_sample_take(mover, activity, seed, take, frames))
        for activity in activities_in_place()
        for take in range(takes)
    ]
    return Poses(np.concatenate(turns))


def _sample_take(mover: Kinematics, activity: Activity, seed: int, take: int, frames: int) -> Floats:
    """Return rotations of the bones (n, B, 3, 3) at random times of one motion of each performer."""
    rng = stream(seed, "train", "pose", activity.name, take)
    times = np.sort(rng.uniform(0.0, _DURATION, frames))
    track: Track | None = None
    while track is None:
        if activity.track is Loop:
            speed = np.sqrt(_GRAVITY * mover.leg_length) * rng.uniform(*activity.froude)
            track = draw_loop(rng, half=_HALF, speed=float(speed))
        else:
            track = Spot(np.zeros(2), 0.0)
    performance = activity.perform(
        [mover] * activity.performers, track, motion_clock(_DURATION), rng=rng, pace=float(rng.uniform(1.05, 1.25))
    )
    return np.concatenate([mover.transforms(motion.at(times))[..., :3] for motion in performance.motions])


def _level(turns: Floats) -> Floats:
    """Rotate poses (n, B, 3, 3) about the vertical so that every pelvis faces along x."""
    return vertical_rotation(-bearing(turns))[:, None] @ turns


def bearing(turns: Floats) -> Floats:
    """Return the direction that the pelvis of poses (..., B, 3, 3) faces, radians from the x axis, (...)."""
    forward = turns[..., 0, :, 0]
    return np.arctan2(forward[..., 1], forward[..., 0])


def vertical_rotation(angle: Floats | float) -> Floats:
    """Return rotations about the vertical axis, (..., 3, 3), by angles (...) in radians."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(*np.shape(c), 3, 3)


def place_body(body: Body, turns: Floats, position: Floats, facing: float) -> tuple[Floats, NDArray[np.float32]]:
    """Pose a body and put it on the floor.

    Args:
        body: body with B bones.
        turns: rotations of its bones from rest, (B, 3, 3).
        position: position of the pelvis on the floor, (2,) metres.
        facing: rotation of the pose about the vertical, radians.

    Returns:
        Bone transforms (B, 3, 4), and the skin (n, 3) in metres, whose lowest point is on z = 0.
    """
    turns = vertical_rotation(facing) @ turns
    heads = np.zeros_like(body.heads)
    for bone, parent in enumerate(body.parents):
        if parent >= 0:
            heads[bone] = heads[parent] + turns[parent] @ (body.heads[bone] - body.heads[parent])
    shift = heads - np.einsum("brc,bc->br", turns, body.heads)
    transforms = np.concatenate([turns, shift[..., None]], axis=-1)
    skin = body.skin(transforms)
    move = np.array([*position, -float(skin[:, 2].min())])
    transforms[..., 3] += move
    return transforms, skin + move.astype(np.float32)
