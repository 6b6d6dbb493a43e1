"""Moving articulated people with known lengths and rotations, made by forward kinematics."""

from dataclasses import replace

import numpy as np

from mvpose import COCO17
from mvpose.recording import People
from mvpose.skeleton_fit.body import LENGTHS, ArticulatedBody
from mvpose.skeleton_fit.inverse_kinematics import within_limits
from mvpose.skeleton_fit.kinematics import Pose
from mvpose.skeleton_fit.rotations import to_matrices

TRUE_LENGTHS = {name: share * 1.82 * (1.06 if name == "thigh" else 0.97) for name, share in LENGTHS.items()}


def moving(frames=60, *, seed=0, rate=25.0, skeleton=COCO17):
    """Smooth random motion within the ranges of all joints: the pose and the time of each frame."""
    rng = np.random.default_rng(seed)
    body = ArticulatedBody.of_skeleton(skeleton).resized(TRUE_LENGTHS)
    body = replace(body, places=body.places * 1.1)
    times = np.arange(frames) / rate
    rotations = np.broadcast_to(np.eye(3), (frames, len(body.segments), 3, 3)).copy()
    for number, segment in enumerate(body.segments):
        phases, speeds = rng.uniform(0, 6, (2, len(segment.axes)))
        angles = 0.35 * np.sin(times[:, None] * (0.3 + 0.3 * speeds) + phases) * (0.2 if segment.spread < 20 else 1.0)
        rest = np.radians(segment.rest) if segment.limit else np.zeros(3)
        turn = to_matrices(np.broadcast_to(rest, (frames, 3)))
        rotations[:, number] = turn @ to_matrices(angles @ np.reshape(segment.axes, (-1, 3)))
    heading = np.zeros((frames, 3))
    heading[:, 2] = 2.0 + times
    rotations[:, 0] = to_matrices(heading) @ rotations[:, 0]
    root = np.stack([0.8 * times, np.sin(times), np.full(frames, 0.95)], axis=-1)
    return times, within_limits(Pose(body, root, rotations))


def recorded(times, pose, *, noise=0.0, seed=1, skeleton=COCO17):
    """One person with identity 4 as a tracker would give it."""
    joints = np.full((len(times), 1, len(skeleton), 3), np.nan)
    joints[:, 0, list(pose.body.rows)] = pose.joints
    joints += noise * np.random.default_rng(seed).normal(size=joints.shape)
    covariance = np.broadcast_to(max(noise, 0.003) ** 2 * np.eye(3), (*joints.shape, 3))
    return People(times, np.array([4]), joints, np.ones(joints.shape[:3]), covariance, skeleton)


def distances(fit, joints):
    """Distances of the joints of a fit from others, (T, M), metres."""
    return np.linalg.norm(fit.pose.joints - joints, axis=-1)
