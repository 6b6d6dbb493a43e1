"""Bodies fitted to the people of a recording: bone lengths of each person, and joint rotations over time.

Both sides have the same lengths, and the head and the feet are symmetric. Lengths, and the places of the joints on the
head and the feet, are medians over frames, so that wrong joints do not count.
"""

from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Floats
from mvpose.recording import People
from mvpose.skeleton_fit.body import LENGTHS, STATURE, ArticulatedBody
from mvpose.skeleton_fit.inverse_kinematics import JointTargets, initial_pose, reach
from mvpose.skeleton_fit.kinematics import Pose

_STEPS = (4, 4, 15)  # most iterations of each fit of the poses; the lengths follow from the fit before
_MODEL_ERROR = 0.01  # metres; joints of detectors are not the centres of rotation of a rigid body
_UNKNOWN_ERROR = 0.02  # metres; where there is no covariance
_FEWEST_FRAMES = 3  # with hips and shoulders
_WINDOW, _OVERLAP = 1000, 50  # frames fitted at once, and frames of each that the next window fits again

_FEWEST = 3  # frames in which a bone must be seen
_SHORTEST = 0.01  # metres
_SIDES = ("left", "right")


@dataclass(frozen=True)
class FittedBody:
    """Body of one person and its motion."""

    identity: int
    """Identity of the person."""
    first: int
    """Index of its first frame in the recording."""
    times: Floats
    """Time of each frame from the first to the last in which the person is seen, (T,), seconds."""
    pose: Pose
    """The body and its poses in these frames."""

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


def _both(part: str) -> tuple[str, ...]:
    return tuple(f"{side}_{part}" for side in _SIDES)


def _limb(start: str, end: str) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]:
    return tuple(((f"{side}_{start}",), (f"{side}_{end}",)) for side in _SIDES)


_SPANS = {  # from the middle of some joints to that of others, one or two times in the body
    "trunk": ((_both("hip"), _both("shoulder")),),
    "hip": ((("right_hip",), ("left_hip",)),),
    "shoulder": ((("right_shoulder",), ("left_shoulder",)),),
    "upper arm": _limb("shoulder", "elbow"),
    "forearm": _limb("elbow", "wrist"),
    "thigh": _limb("hip", "knee"),
    "shank": _limb("knee", "ankle"),
}
_HALVES = ("hip", "shoulder")  # whose span is twice the length


def first_lengths(body: ArticulatedBody, joints: Floats) -> dict[str, float]:
    """Return lengths from the distances between joints (T, M, 3).

    A length that is never seen follows from the others by the average proportions of adults.
    """
    return _completed(
        {
            name: _median(np.linalg.norm(_spans(body, joints, name), axis=-1)) / (2.0 if name in _HALVES else 1.0)
            for name in LENGTHS
        }
    )


def fitted_body(pose: Pose, joints: Floats) -> ArticulatedBody:
    """Return the body with lengths and places of joints as fitted poses show them.

    Args:
        pose: poses of the body with its present lengths.
        joints: joints of the body in these frames, (T, M, 3), metres; NaN where absent.
    """
    return replace(pose.body, places=_places(pose, joints)).resized(_lengths(pose, joints))


def _lengths(pose: Pose, joints: Floats) -> dict[str, float]:
    """Return lengths from joints, measured along the bones of the poses.

    Errors across a bone make a distance longer, but not its component along the bone.
    """
    found = {}
    for name, length in pose.body.lengths.items():
        model, measured = (_spans(pose.body, each, name) for each in (pose.joints, joints))
        found[name] = length * _median(np.sum(measured * model, axis=-1) / np.sum(model**2, axis=-1))
    return _completed(found)


def _places(pose: Pose, joints: Floats) -> Floats:
    """Return the places of the joints on head and feet as medians over frames, symmetric, (M, 3)."""
    body = pose.body
    turned, origins = pose.frames
    carriers = list(body.carriers)
    seen = np.einsum("tmji,tmj->tmi", turned[:, carriers], joints - origins[:, carriers])
    places = body.places.copy()
    for row, joint in enumerate(body.joints):
        if body.centres[row]:
            continue
        side, _, part = joint.partition("_")
        other = {"left": "right", "right": "left"}.get(side)
        twin = body.joints.index(f"{other}_{part}") if f"{other}_{part}" in body.joints else row
        both = np.concatenate([seen[:, row], seen[:, twin] * [1.0, -1.0, 1.0]])
        both = both[np.isfinite(both).all(axis=-1)]
        if len(both) >= _FEWEST:
            places[row] = np.median(both, axis=0)
            if twin == row and other is None:
                places[row, 1] = 0.0  # on the midline
    return places


def _spans(body: ArticulatedBody, joints: Floats, name: str) -> Floats:
    """Return the vectors from start to end of a length in all frames, (k, T, 3); NaN where absent."""

    def middle(names: tuple[str, ...]) -> Floats:
        known = [joints[:, body.joints.index(each)] for each in names if each in body.joints]
        absent = np.full((len(joints), 3), np.nan)
        return np.mean(known, axis=0) if len(known) == len(names) else absent

    return np.array([middle(end) - middle(start) for start, end in _SPANS[name]])


def _completed(found: dict[str, float]) -> dict[str, float]:
    """Return lengths; one that is NaN or impossibly short follows from the stature that the others have in adults."""
    found = {name: length if length > _SHORTEST else float("nan") for name, length in found.items()}
    ratios = [found[name] / share for name, share in LENGTHS.items() if np.isfinite(found[name])]
    stature = float(np.median(ratios)) if ratios else STATURE
    return {name: found[name] if np.isfinite(found[name]) else share * stature for name, share in LENGTHS.items()}


def _median(values: Floats) -> float:
    """Return the median of finite values; NaN if there are too few."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) >= _FEWEST else float("nan")
