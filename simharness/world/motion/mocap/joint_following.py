"""Inverse kinematics of a whole motion: the body's joints are brought to recorded ones, smoothly in time.

Gauss-Newton over all frames together. What the joints do not determine, such as the twist of a straight arm, stays as
in the initial motion, and so does the orientation of the feet. The normal equations are banded, because only neighbours
in time are coupled.
"""

import numpy as np
import threadpoolctl
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17
from simharness.world.humans.anatomy import DOFS, SIDES
from simharness.world.motion.mocap.limb_angles import smooth_step
from simharness.world.motion.motion import RATE, Motion
from simharness.world.motion.poses.kinematics import Kinematics, LinearPose

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
