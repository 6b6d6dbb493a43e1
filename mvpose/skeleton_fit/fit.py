"""Bodies fitted to the people of a recording: bone lengths of each person, and joint rotations over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from mvpose.recording import People
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.initial_pose import initial_pose
from mvpose.skeleton_fit.inverse_kinematics import JointTargets, reach
from mvpose.skeleton_fit.kinematics import Pose
from mvpose.skeleton_fit.proportions import first_lengths, fitted_body

_STEPS = (4, 4, 15)  # most iterations of each fit of the poses; the lengths follow from the fit before
_MODEL_ERROR = 0.01  # metres; joints of detectors are not the centres of rotation of a rigid body
_UNKNOWN_ERROR = 0.02  # metres; where there is no covariance
_FEWEST_FRAMES = 3  # with hips and shoulders
_WINDOW, _OVERLAP = 1000, 50  # frames fitted at once, and frames of each that the next window fits again


@dataclass(frozen=True)
class FittedBody:
    """Body of one person and its motion.

    Attributes:
        identity: identity of the person.
        first: index of its first frame in the recording.
        times: time of each frame from the first to the last in which the person is seen, (T,), seconds.
        pose: the body and its poses in these frames.
    """

    identity: int
    first: int
    times: Floats
    pose: Pose

    @property
    def body(self) -> ArticulatedBody:
        """The body: segments, offsets, joints."""
        return self.pose.body

    @property
    def lengths(self) -> dict[str, float]:
        """Lengths of the bones, metres, by the names in :data:`.body.LENGTHS`; both sides have the same."""
        return self.body.lengths


def fit_bodies(people: People) -> list[FittedBody]:
    """Fit a body to each person who is seen with hips and shoulders in three frames or more.

    Gaps of a person are filled by the most even motion between the frames around them.

    Raises:
        ValueError: a skeleton without hips and shoulders.
    """
    template = ArticulatedBody.of_skeleton(people.skeleton)
    fits = (_fit(people, row, template) for row in range(len(people)))
    return [fit for fit in fits if fit is not None]


def _fit(people: People, row: int, body: ArticulatedBody) -> FittedBody | None:
    span, rows = people.span(row), list(body.rows)
    joints = people.joints[span, row][:, rows]
    torso = [body.joints.index(f"{side}_{part}") for side in ("left", "right") for part in ("hip", "shoulder")]
    if np.isfinite(joints[:, torso]).all(axis=(1, 2)).sum() < _FEWEST_FRAMES:
        return None
    covariance = None if people.covariance is None else people.covariance[span, row][:, rows]
    target = JointTargets(people.times[span], joints, _whitening(joints, covariance))
    body = body.resized(first_lengths(body, joints))
    pose = initial_pose(body, _filled(target.times, joints))
    for step, iterations in enumerate(_STEPS):
        if step:
            pose = Pose(fitted_body(pose, joints), pose.root, pose.rotations)
        pose = _in_windows(pose, target, iterations)
    return FittedBody(int(people.ids[row]), span.start, target.times, pose)


def _in_windows(pose: Pose, target: JointTargets, steps: int) -> Pose:
    """Fit long recordings in windows that overlap, so that the memory is bounded."""
    count = len(target.times)
    root, rotations = pose.root.copy(), pose.rotations.copy()
    for start in range(0, max(count - _OVERLAP, 1), _WINDOW - _OVERLAP):
        part = slice(start, min(start + _WINDOW, count))
        some = JointTargets(target.times[part], target.joints[part], target.whitening[part])
        found = reach(Pose(pose.body, root[part], rotations[part]), some, steps=steps)
        skipped = _OVERLAP // 2 if start else 0
        root[start + skipped : part.stop] = found.root[skipped:]
        rotations[start + skipped : part.stop] = found.rotations[skipped:]
    return Pose(pose.body, root, rotations)


def _whitening(joints: Floats, covariance: Floats | None) -> Floats:
    """Return matrices that make the errors of joints independent with variance 1, (T, M, 3, 3); zero where absent."""
    present = np.asarray(np.isfinite(joints).all(axis=-1))
    if covariance is None:
        return np.where(present[..., None, None], np.eye(3) / _UNKNOWN_ERROR, 0.0)
    present = present & np.isfinite(covariance).all(axis=(-1, -2))
    variances, axes = np.linalg.eigh(np.where(present[..., None, None], covariance, 0.0))
    scales = 1.0 / np.sqrt(np.maximum(variances, 0.0) + _MODEL_ERROR**2)
    return np.where(present[..., None, None], scales[..., None] * axes.swapaxes(-1, -2), 0.0)


def _filled(times: Floats, joints: Floats) -> Floats:
    """Return joints with gaps interpolated over time, (T, M, 3); NaN for those that are never seen."""
    filled = joints.copy()
    for joint in range(joints.shape[1]):
        known = np.isfinite(joints[:, joint, 0])
        if known.any():
            for axis in range(3):
                filled[:, joint, axis] = np.interp(times, times[known], joints[known, joint, axis])
    return filled
