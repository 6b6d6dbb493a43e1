"""Poses of people in pictures: joints of all activities, performed by drawn bodies, seen from all around.

Every pose is seen by a distant camera from one bearing and elevation, with its mirror image from the mirrored bearing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose import COCO17
from mvpose.arrays import Floats
from simharness.detector.viewing_conditions import body_axes
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activity_registry import Activity, activities
from simharness.world.motion.motion import motion_clock
from simharness.world.motion.paths import Loop, Spot, Track, draw_loop
from simharness.world.motion.poses.kinematics import Kinematics

_DURATION = 6.0  # seconds of every motion
_HALF = 2.0  # half the side of the square in which people walk, metres
_GRAVITY = 9.81
_CHILDREN = 0.1  # share of children among the bodies
_HIGHEST = np.deg2rad(45.0)  # elevation of cameras seen from people: from level to this
_ON_THE_WAY = frozenset({"cross", "swap", "hide", "visit"})


@dataclass(frozen=True)
class PosesInPictures:
    """N poses in pictures.

    Attributes:
        places: joints right and down of their mean in the picture, (N, 17, 2), metres.
        bearing: bearing of the camera from the trunk, (N,), radians to the left of straight ahead.
    """

    places: Floats
    bearing: Floats


def activities_in_place() -> tuple[Activity, ...]:
    """Return the activities of people who stay, without those that are about coming, going, passing and hiding.

    What those people do in between, walking and standing, others do as well.
    """
    return tuple(each for each in activities().values() if each.name not in _ON_THE_WAY)


def sample_joints(seed: int, *, bodies: int, frames: int) -> Floats:
    """Return joints in space (N, 17, 3), metres: every activity performed by every body, at random times.

    Args:
        seed: seed of bodies, motions and times.
        bodies: number of bodies.
        frames: poses of each performer in each motion.
    """
    parts = []
    for number in range(bodies):
        shape = draw_shape(stream(seed, "poses", "body", number), child=number < _CHILDREN * bodies)
        mover = Kinematics(make_body(shape))
        parts += [_perform(mover, activity, seed, number, frames) for activity in activities_in_place()]
    return np.concatenate(parts)


def see(joints: Floats, seed: int, *, bearings: int) -> PosesInPictures:
    """Return the poses (N, 17, 3) in the pictures of distant cameras, each pose from several bearings.

    Args:
        joints: joints in space, metres, z up.
        seed: seed of bearings and elevations.
        bearings: number of views of each pose: bearings in equal steps from a random one.
    """
    rng = stream(seed, "poses", "views")
    first, lift = rng.random((len(joints), 1)), rng.random((len(joints), bearings))
    bearing = 2 * np.pi * (first + np.arange(bearings)) / bearings
    forward = body_axes(joints)[:, 0, :2]
    ahead = np.arctan2(forward[:, 1], forward[:, 0])[:, None] + bearing
    elevation = _HIGHEST * lift
    toward = np.stack(
        [np.cos(elevation) * np.cos(ahead), np.cos(elevation) * np.sin(ahead), np.sin(elevation)], axis=-1
    )
    right = np.stack([-np.sin(ahead), np.cos(ahead), np.zeros_like(ahead)], axis=-1)
    axes = np.stack([right, np.cross(right, toward)], axis=-2)  # right and down, (N, bearings, 2, 3)
    places = np.einsum("nbik,njk->nbji", axes, joints - joints.mean(axis=1, keepdims=True)).reshape(-1, 17, 2)
    bearing = bearing.reshape(-1)
    mirrored = places[:, list(COCO17.mirror)] * [-1.0, 1.0]
    return PosesInPictures(np.concatenate([places, mirrored]), np.concatenate([bearing, -bearing]))


def _perform(mover: Kinematics, activity: Activity, seed: int, body: int, frames: int) -> Floats:
    """Return joints (n, 17, 3) at random times of one motion of each performer of an activity."""
    rng = stream(seed, "poses", activity.name, body)
    times = np.sort(rng.uniform(0.0, _DURATION, frames))
    track: Track | None = None
    while track is None:
        if activity.track is Loop:
            speed = np.sqrt(_GRAVITY * mover.leg_length) * rng.uniform(*activity.froude)
            track = draw_loop(rng, half=_HALF, speed=float(speed))
        else:
            track = Spot(np.zeros(2), 0.0)
    performance = activity.perform(
        [mover] * activity.performers, track, motion_clock(_DURATION), rng=rng, pace=float(rng.uniform(0.9, 1.25))
    )
    return np.concatenate([mover.joints(motion.at(times)) for motion in performance.motions])
