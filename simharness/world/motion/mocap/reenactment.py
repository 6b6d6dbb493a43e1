"""Re-enactment: a body performs the recorded joints of a person at the recorded place and time.

The joints over time become the source motion of a retargeting to a body of the recorded size. The joints of COCO-17
are not the axes of the hinges, and joints have ranges, so the result is compared with them, and trunk, head and arms
are corrected by what they are off. The pelvis follows its recorded path on the floor; its height is that of feet on the
floor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.recording import People
from simharness.world.humans.anatomy import DOFS, SIDES
from simharness.world.motion.mocap.joint_directions import (
    chest_turn,
    foot_turn,
    head_turn,
    joint,
    middle,
    pelvis_turn,
    segment,
    unit,
)
from simharness.world.motion.mocap.retarget import SourceMotion, retarget, tilt_pelvis
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.trajectory import RATE, interpolate

_CONTEXT = 0.5  # seconds before and after the performed part that determine steps and the height of the floor
_CORRECTIONS = 2  # rounds; the next ones change little
_MOST = np.radians(40.0)  # largest correction of a direction in one round: one beyond a joint's range has no end


def reenact(people: People, person: int, kinematics: Kinematics, *, time: Floats) -> Motion:
    """Return the motion of a body that re-enacts one person.

    Args:
        people: recorded people on COCO-17, all joints in all frames, at times from 0.
        person: column of the person in them.
        kinematics: body, preferably of the recorded size, see ``recorded_shape``.
        time: times in the recording, (N,) seconds, ascending; the pose is held before the first and after the last
            frame.
    """
    time = np.asarray(time, float)
    start, end = np.clip([time[0] - _CONTEXT, time[-1] + _CONTEXT], 0.0, people.times[-1])
    clock = np.linspace(start, end, round((end - start) * RATE) + 1)
    joints = interpolate(people.times, people.joints[:, person].reshape(people.frames, -1), clock)
    motion = follow(joints.reshape(len(clock), -1, 3), kinematics, time=clock)
    return Motion(time, *motion.read(time))


def follow(joints: Floats, kinematics: Kinematics, *, time: Floats) -> Motion:
    """Return the motion of a body whose joints follow COCO-17 joints (N, 17, 3), metres, at times (N,), seconds."""
    neutral = _neutral_joints(kinematics)
    source = _source(time, joints, kinematics, neutral)
    motion = retarget(source, kinematics)
    for _ in range(_CORRECTIONS):
        source = _corrected(source, joints, kinematics.joints(motion), neutral)
        motion = retarget(source, kinematics)
    return motion


def _neutral_joints(kinematics: Kinematics) -> Floats:
    """Return the COCO-17 joints (17, 3) of the neutral pose in the pelvis frame."""
    root = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
    return kinematics.joints(Motion(np.zeros(1), root, np.zeros((1, len(DOFS)))))[0]


def _source(time: Floats, joints: Floats, kinematics: Kinematics, neutral: Floats) -> SourceMotion:
    """Return the source motion of COCO-17 joints (N, 17, 3), in metres and with the leg length of the body.

    The hinges of hips and ankles are where they are in the body relative to its COCO-17 joints.
    """
    rate = 1.0 / np.diff(time).mean() if len(time) > 1 else 1.0
    pelvis = pelvis_turn(joints)
    feet = {side: foot_turn(joints, side, pelvis[:, :, 0], rate=rate) for side in SIDES}
    turns = {"pelvis": pelvis, "chest": chest_turn(joints), "head": head_turn(joints, neutral)}
    turns |= {f"{side} foot": turn for side, turn in feet.items()}
    segments = {(side, part): segment(joints, side, part) for side in SIDES for part in ("arm", "forearm")}
    hips = np.mean([kinematics.legs[side].anchors[0] for side in SIDES], axis=0)
    centre = middle(joints, "hip") + pelvis @ (hips - middle(neutral, "hip"))
    for side in SIDES:
        leg = kinematics.legs[side]
        hip = centre + pelvis @ (leg.anchors[0] - hips)
        knee = joint(joints, f"{side}_knee")
        ankle = joint(joints, f"{side}_ankle") + feet[side] @ (leg.end - joint(neutral, f"{side}_ankle"))
        segments[side, "thigh"], segments[side, "shank"] = knee - hip, ankle - knee
    turns["pelvis"] = tilt_pelvis(pelvis, segments, rate=rate)
    legs = dict.fromkeys(SIDES, sum(kinematics.leg_parts))
    return SourceMotion(time=time, turns=turns, segments=segments, hips=centre, legs=legs)


def _corrected(source: SourceMotion, wanted: Floats, reached: Floats, neutral: Floats) -> SourceMotion:
    """Return the source motion changed by the difference between wanted and reached COCO-17 joints, (N, 17, 3)."""
    turns, segments = dict(source.turns), dict(source.segments)
    for name, turn in (("chest", chest_turn), ("head", lambda joints: head_turn(joints, neutral))):
        turns[name] = _limited(turn(wanted) @ turn(reached).swapaxes(1, 2)) @ turns[name]
    for side in SIDES:
        for part in ("arm", "forearm"):
            off = _between(segment(reached, side, part), segment(wanted, side, part))
            segments[side, part] = (off @ segments[side, part][..., None])[..., 0]
    shift = middle(wanted, "hip") - middle(reached, "hip")
    shift[:, 2] = 0.0
    for side in SIDES:  # the ankles stay
        segments[side, "thigh"] = segments[side, "thigh"] - shift
    return replace(source, turns=turns, segments=segments, hips=source.hips + shift)


def _between(start: Floats, end: Floats) -> Floats:
    """Return the smallest rotations (N, 3, 3) between two directions (N, 3), limited to ``_MOST``."""
    start, end = unit(start), unit(end)
    axis = np.cross(start, end)
    angle = np.arctan2(np.linalg.norm(axis, axis=1), (start * end).sum(axis=1))
    return Rotation.from_rotvec(unit(axis) * np.minimum(angle, _MOST)[:, None]).as_matrix()


def _limited(turn: Floats) -> Floats:
    """Return rotations (N, 3, 3) limited to ``_MOST``."""
    vector = Rotation.from_matrix(turn).as_rotvec()
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    return Rotation.from_rotvec(vector * np.minimum(1.0, _MOST / np.maximum(angle, 1e-12))).as_matrix()
