"""Poses for anybody, cheaply: motions are planned once, on one body, and lent to all others bone by bone.

All bodies rest in the same A pose, so the turn of a bone from rest to the world may be lent to another body, whose
bones are then put one to the end of the other. Feet and hands come to lie a little elsewhere than they were planned,
which no crop tells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.paths import Loop, Spot, Track, draw_loop
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.registry import Activity, activities
from simharness.world.motion.trajectory import motion_clock

_DURATION = 4.0  # seconds of every motion
_HALF = 2.0  # metres: half the side of the square in which people walk
_GRAVITY = 9.81


@dataclass(frozen=True)
class Poses:
    """N poses, each facing along x.

    Attributes:
        turns: of the bones from rest to the world, (N, B, 3, 3).
    """

    turns: Floats

    def __len__(self) -> int:
        return len(self.turns)


def plan_poses(seed: int, *, frames: int = 40, takes: int = 2) -> Poses:
    """Poses out of all that people do in scenarios.

    Args:
        seed: of the manners and of the moments.
        frames: poses of each motion.
        takes: motions of each activity, each in a manner of its own.
    """
    mover = Kinematics(make_body(Shape()))
    turns = [
        _level(_take(mover, activity, seed, take, frames))
        for activity in activities().values()
        for take in range(takes)
    ]
    return Poses(np.concatenate(turns))


def _take(mover: Kinematics, activity: Activity, seed: int, take: int, frames: int) -> Floats:
    """Turns of the bones (n, B, 3, 3) in moments of one motion of each performer."""
    rng = stream(seed, "train", "pose", activity.name, take)
    moments = np.sort(rng.uniform(0.0, _DURATION, frames))
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
    return np.concatenate([mover.transforms(motion.at(moments))[..., :3] for motion in performance.motions])


def _level(turns: Floats) -> Floats:
    """The same turns (n, B, 3, 3), about the vertical so that every pelvis faces along x."""
    return upright(-bearing(turns))[:, None] @ turns


def bearing(turns: Floats) -> Floats:
    """Where the pelvis of poses (..., B, 3, 3) faces, radians from the x axis, (...)."""
    forward = turns[..., 0, :, 0]
    return np.arctan2(forward[..., 1], forward[..., 0])


def upright(angle: Floats | float) -> Floats:
    """Rotations about the vertical, (..., 3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(*np.shape(c), 3, 3)


def placed(body: Body, turns: Floats, place: Floats, facing: float) -> tuple[Floats, NDArray[np.float32]]:
    """A body in a pose, standing or lying on the floor.

    Args:
        body: any.
        turns: of its bones, (B, 3, 3).
        place: of the pelvis on the floor, (2,) metres.
        facing: radians by which the pose is turned about the vertical.

    Returns:
        Bone transforms (B, 3, 4), and the skin (n, 3) metres, whose lowest point is on z = 0.
    """
    turns = upright(facing) @ turns
    heads = np.zeros_like(body.heads)
    for bone, parent in enumerate(body.parents):
        if parent >= 0:
            heads[bone] = heads[parent] + turns[parent] @ (body.heads[bone] - body.heads[parent])
    shift = heads - np.einsum("brc,bc->br", turns, body.heads)
    transforms = np.concatenate([turns, shift[..., None]], axis=-1)
    skin = body.skin(transforms)
    move = np.array([*place, -float(skin[:, 2].min())])
    transforms[..., 3] += move
    return transforms, skin + move.astype(np.float32)
