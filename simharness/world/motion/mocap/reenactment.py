"""Re-enactment: a body performs the recorded joints of a person at the recorded place and time.

The joints over time become the source motion of a retargeting to a body of the recorded size, with feet on the floor.
The joints of COCO-17 are not the axes of the hinges, so inverse kinematics of the whole motion then bring the body's
joints to them, smoothly in time: Gauss-Newton over all frames together. What the joints do not determine, such as the
twist of a straight arm, stays as in the initial motion, and so does the orientation of the feet. The normal equations
are banded, because only neighbours in time are coupled.

An orientation of trunk, head or feet, (N, 3, 3), has the columns forward, left and up; standing upright and facing +x
is the identity.
"""

import numpy as np
import threadpoolctl
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.recording import People
from mvpose.skeleton import COCO17
from simharness.world.humans.anatomy import DOFS, SIDES
from simharness.world.motion.mocap.limb_angles import smooth_step
from simharness.world.motion.mocap.retarget import SourceMotion, low_pass, retarget, tilt_pelvis
from simharness.world.motion.motion import RATE, Motion, interpolate
from simharness.world.motion.poses.kinematics import Kinematics, LinearPose
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
    root = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
    neutral = kinematics.joints(Motion(np.zeros(1), root, np.zeros((1, len(DOFS)))))[0]  # in the pelvis frame
    source = _source(time, joints, kinematics, neutral)
    rate = 1.0 / np.diff(time).mean() if len(time) > 1 else RATE
    return follow_joints(retarget(source, kinematics), kinematics, joints, rate=rate)


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


_ITERATIONS = 6
_LARGEST_STEP = 0.2  # metres or radians
_CLOSE = 5e-4  # metres or radians: largest change of the last iteration
_INITIAL = 0.01  # metres per radian: weight of the distance from the initial angles
_DAMPING = 0.1  # metres per radian: weight of the step; arms have more angles than their joints determine
_HELD = 1e4  # square metres per square radian: an angle at its limit that would pass it
_FOOT = 0.1  # metres per radian: weight of the orientation of a foot
_SMOOTH = 0.6  # metres per radian/frame² at the planning rate: with a lever of 0.4 m passes motion below about 8 Hz
_ANKLES = [COCO17.index(f"{side}_ankle") for side in SIDES]
_ROOT = 6  # translation and rotation of the pelvis


@threadpoolctl.threadpool_limits.wrap(limits=1)  # its matrices are small
def follow_joints(motion: Motion, kinematics: Kinematics, joints: Floats, *, rate: float) -> Motion:
    """Return a motion whose joints are near the recorded ones, near an initial motion whose feet are on the floor.

    The recorded floor is unknown: the lower ankle is as high above it as in the initial motion.

    Args:
        motion: initial motion, of N frames.
        kinematics: body.
        joints: recorded COCO-17 joints at its times, (N, 17, 3) metres.
        rate: frames per second.
    """
    count = _ROOT + len(DOFS)
    own, smooth = range(_ROOT, count), _SMOOTH * (rate / RATE) ** 2
    low, high = kinematics.ranges.T
    low, high = np.minimum(low, motion.angles.min(axis=0)), np.maximum(high, motion.angles.max(axis=0))
    start = np.concatenate([motion.root[:, :3], np.zeros((len(motion), 3)), motion.angles], axis=1)
    change = np.zeros((len(motion), count))
    pose = kinematics.linearised(motion)
    target = joints + [0.0, 0.0, _rise(pose, joints, kinematics)]
    ankles = pose.ankles[..., 2] + (target - pose.joints)[:, _ANKLES, 2]
    feet = _above_floor(pose.feet, ankles, kinematics)
    moved = motion
    for _ in range(_ITERATIONS):
        tilt = Rotation.from_matrix((feet @ pose.feet.swapaxes(-1, -2)).reshape(-1, 3, 3)).as_rotvec()
        rows = np.concatenate([pose.joint_derivatives, _FOOT * pose.foot_derivatives], axis=1)
        rows = rows.reshape(len(motion), -1, count)
        off = np.concatenate([target - pose.joints, _FOOT * tilt.reshape(-1, 2, 3)], axis=1).reshape(len(motion), -1)
        normal = rows.swapaxes(1, 2) @ rows
        right = np.einsum("tik,ti->tk", rows, off)
        right[:, _ROOT:] -= _INITIAL**2 * change[:, _ROOT:]
        angles = motion.angles + change[:, _ROOT:]
        held = ((angles <= low) & (right[:, _ROOT:] < 0)) | ((angles >= high) & (right[:, _ROOT:] > 0))
        normal[:, own, own] += np.where(held, _HELD, _INITIAL**2 + _DAMPING**2)
        step = smooth_step(normal, right, start + change, weight=smooth)
        last = change
        change = change + np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        change[:, _ROOT:] = np.clip(motion.angles + change[:, _ROOT:], low, high) - motion.angles
        moved = _changed(motion, change)
        if np.abs(change - last).max() < _CLOSE:
            break
        pose = kinematics.linearised(moved)
    return moved


def _rise(pose: LinearPose, joints: Floats, kinematics: Kinematics) -> float:
    """Return what the recorded joints have to rise for the feet to be on the floor, metres."""
    pitch = np.arcsin(np.clip(pose.feet[..., 2, 0], -1, 1))
    clearance = (pose.ankles[..., 2] - kinematics.rolling.at(pitch)[1]).min(axis=1)
    reached, wanted = (each[:, _ANKLES, 2].min(axis=1) for each in (pose.joints, joints))
    return float(np.median(reached - wanted) - np.median(clearance))


def _above_floor(feet: Floats, ankles: Floats, kinematics: Kinematics) -> Floats:
    """Return orientations of feet (N, 2, 3, 3), pitched so that no sole is under the floor at heights of the ankles.

    Args:
        feet: orientations, (N, 2, 3, 3).
        ankles: heights of the ankles, (N, 2) metres.
        kinematics: body.
    """
    roll = kinematics.rolling
    flat = int(np.searchsorted(roll.pitch, 0.0))
    down, up = slice(flat, None, -1), slice(flat, None)
    lowest, highest = (
        np.interp(ankles, np.maximum.accumulate(roll.height[part]), roll.pitch[part]) for part in (down, up)
    )
    pitch = np.arcsin(np.clip(feet[..., 2, 0], -1, 1))
    more = np.clip(pitch, lowest, highest) - pitch
    return feet @ Rotation.from_euler("Y", -more.reshape(-1, 1)).as_matrix().reshape(feet.shape)


def _changed(motion: Motion, change: Floats) -> Motion:
    """Return a motion changed by translation, rotation and angles, (N, 6 + D)."""
    turn = Rotation.from_rotvec(change[:, 3:_ROOT]) * Rotation.from_quat(motion.root[:, 3:], scalar_first=True)
    root = np.concatenate([motion.root[:, :3] + change[:, :3], turn.as_quat(scalar_first=True)], axis=1)
    return Motion(motion.time, root, motion.angles + change[:, _ROOT:])
