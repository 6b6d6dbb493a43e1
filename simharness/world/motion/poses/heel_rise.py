"""Heel rise that follows the shank: a foot rolls over its toes before the ankle reaches the end of its range."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis
from simharness.world.motion.poses.kinematics import Kinematics

_FREE = np.radians(5.0)  # before the end of the range, where the heel begins to rise
_SOFT = np.radians(2.0)  # in which the rise reaches its rate
# Rotation of the foot per rotation of the ankle that is saved. A heel that rises bends the knee, too, so that the ankle
# turns back by less than the foot; for a straight knee hardly at all, which is why this is not solved for the angle.
_RISE = 1.5


def follow_shank(
    kinematics: Kinematics,
    side: str,
    pelvis: Pelvis,
    height: Floats,
    pitch: Floats,
    foot: Callable[[Floats], Foot],
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
