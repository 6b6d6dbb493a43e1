"""Re-enactment: a body performs the recorded joints of a person at the recorded place and time.

The joints over time become the source motion of a retargeting to a body of the recorded size, with feet on the floor.
The joints of COCO-17 are not the axes of the hinges, so inverse kinematics then bring the body's joints to them.

An orientation of trunk, head or feet, (N, 3, 3), has the columns forward, left and up; standing upright and facing +x
is the identity.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.recording import People
from mvpose.skeleton import COCO17
from simharness.world.humans.anatomy import DOFS, SIDES
from simharness.world.motion.mocap.joint_following import follow_joints
from simharness.world.motion.mocap.retarget import SourceMotion, low_pass, retarget, tilt_pelvis
from simharness.world.motion.motion import RATE, Motion, interpolate
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import smoothstep

_CONTEXT = 0.5  # seconds before and after the performed part that determine steps and the height of the floor


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
    joints = low_pass(joints, RATE).reshape(len(clock), -1, 3)
    motion = follow(joints, kinematics, time=clock)
    return Motion(time, *motion.read(time))


def follow(joints: Floats, kinematics: Kinematics, *, time: Floats) -> Motion:
    """Return the motion of a body whose joints follow COCO-17 joints (N, 17, 3), metres, at times (N,), seconds."""
    source = _source(time, joints, kinematics, _neutral_joints(kinematics))
    rate = 1.0 / np.diff(time).mean() if len(time) > 1 else RATE
    return follow_joints(retarget(source, kinematics), kinematics, joints, rate=rate)


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


_UP = np.array([0.0, 0.0, 1.0])
# Pitch of the pelvis relative to the line from mid-hips to mid-shoulders, as shares of the angles from that line to the
# thighs and to the vertical: regression over recorded walking, boxing, bending and washing (CMU subjects 2 and 3, three
# BVH files), residual 6 degrees.
_TO_THIGHS, _TO_VERTICAL = 0.18, 0.12
_KNOWN_PLANE = 0.05  # metres from the knee to the line from hip to ankle at which the leg's plane counts as the pelvis
_RAISED = 0.12  # metres of the ankle above its lowest height: the foot is in the air
_STILL, _SWINGING = 0.15, 0.8  # m/s of the ankle: the foot stands, and the foot is in the air
_TO_BALL = 0.14  # metres from the ankle to the ball of the foot, about which a heel rises
_FOOT_PITCH = np.radians([-20.0, 60.0])  # range of the pitch of a raised foot, toes down positive
_LOWEST = 5.0  # percentile of the height of the ankles that is taken as a foot on the floor
FACE: tuple[int, ...] = tuple(COCO17.index(name) for name in ("nose", "left_eye", "right_eye", "left_ear", "right_ear"))
"""Indices of the joints of the face."""
SEGMENTS: dict[str, tuple[str, str]] = {
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
    "arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
}
"""By segment of a limb, the joints, without the side, at its ends."""


def joint(joints: Floats, name: str) -> Floats:
    """Return one joint (..., 3) of COCO-17 joints (..., 17, 3)."""
    return joints[..., COCO17.index(name), :]


def middle(joints: Floats, name: str) -> Floats:
    """Return the midpoint (..., 3) between the left and the right joint of a name, such as "hip"."""
    return (joint(joints, f"left_{name}") + joint(joints, f"right_{name}")) / 2


def across(joints: Floats, name: str) -> Floats:
    """Return the vector (..., 3) from the right to the left joint of a name."""
    return joint(joints, f"left_{name}") - joint(joints, f"right_{name}")


def segment(joints: Floats, side: str, name: str) -> Floats:
    """Return the vector (..., 3) along a segment of ``SEGMENTS``."""
    start, end = SEGMENTS[name]
    return joint(joints, f"{side}_{end}") - joint(joints, f"{side}_{start}")


def chest_turn(joints: Floats) -> Floats:
    """Return the orientation of the chest: up from mid-hips to mid-shoulders, left along the shoulders."""
    up = unit(middle(joints, "shoulder") - middle(joints, "hip"))
    left = _perpendicular(across(joints, "shoulder"), up)
    return np.stack([np.cross(left, up), left, up], axis=-1)


def pelvis_turn(joints: Floats) -> Floats:
    """Return the orientation of the pelvis: left along the hips, and pitched between trunk, thighs and vertical."""
    left = unit(across(joints, "hip"))
    up = _perpendicular(middle(joints, "shoulder") - middle(joints, "hip"), left)
    along_trunk = np.stack([np.cross(left, up), left, up], axis=-1)

    def pitch(vector: Floats) -> Floats:
        inner = np.einsum("nji,nj->ni", along_trunk, vector)
        return np.arctan2(inner[:, 0], inner[:, 2])

    thighs = pitch(middle(joints, "hip") - middle(joints, "knee"))
    vertical = pitch(np.broadcast_to(_UP, left.shape))
    return along_trunk @ Rotation.from_euler("Y", (_TO_THIGHS * thighs + _TO_VERTICAL * vertical)[:, None]).as_matrix()


def head_turn(joints: Floats, neutral: Floats) -> Floats:
    """Return the orientation of the head: best rotation of a neutral face to the recorded one (Kabsch, 1976).

    Args:
        joints: COCO-17 joints, (N, 17, 3).
        neutral: joints of a neutral pose that faces +x, (17, 3).
    """
    recorded, model = joints[:, FACE], neutral[list(FACE)]
    recorded, model = recorded - recorded.mean(axis=1, keepdims=True), model - model.mean(axis=0)
    left, _, right = np.linalg.svd(recorded.swapaxes(1, 2) @ model)
    flip = np.ones((len(joints), 3))
    flip[:, 2] = np.linalg.det(left @ right)
    return (left * flip[:, None]) @ right


def foot_turn(joints: Floats, side: str, forward: Floats, *, rate: float) -> Floats:
    """Return the orientation of a foot: flat while the ankle is low, in line with the shank while it is raised.

    It points where the leg bends, since knee and ankle are hinges; a straight leg points forward like the pelvis.

    Args:
        joints: COCO-17 joints, (N, 17, 3).
        side: "left" or "right".
        forward: forward direction of the pelvis, (N, 3).
        rate: frames per second.
    """
    thigh, shank = (segment(joints, side, name) for name in ("thigh", "shank"))
    line = unit(thigh + shank)
    bend = thigh - (thigh * line).sum(axis=1, keepdims=True) * line
    level = bend + _KNOWN_PLANE * _perpendicular(forward, line)
    hinge = unit(np.cross(-line, level))
    toes = unit(np.cross(hinge, _UP))
    ankles = np.stack([joint(joints, f"{each}_ankle")[:, 2] for each in ("left", "right")])
    ankle = joint(joints, f"{side}_ankle")
    rise = np.maximum(ankle[:, 2] - np.percentile(ankles, _LOWEST), 0.0)
    lean = np.arctan2(-(shank * toes).sum(axis=1), -shank[:, 2])
    speed = np.linalg.norm(np.gradient(ankle, axis=0), axis=1) * rate if len(joints) > 1 else np.zeros(len(joints))
    free = np.maximum(smoothstep(rise / _RAISED), smoothstep((speed - _STILL) / (_SWINGING - _STILL)))
    down = np.minimum(lean, np.arcsin(np.minimum(rise / _TO_BALL, 1.0)))
    pitch = np.clip(np.where(lean > 0, down, free * lean), *_FOOT_PITCH)
    bearing = np.unwrap(np.arctan2(toes[:, 1], toes[:, 0]))
    return Rotation.from_euler("ZY", np.column_stack([bearing, pitch])).as_matrix()


def unit(vector: Floats) -> Floats:
    """Return vectors (..., 3) with unit length; a vector without length stays zero."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return vector / np.where(length > 0, length, 1.0)


def _perpendicular(vector: Floats, axis: Floats) -> Floats:
    """Return unit vectors (N, 3) along the part of vectors that is perpendicular to unit axes."""
    return unit(vector - (vector * axis).sum(axis=-1, keepdims=True) * axis)
