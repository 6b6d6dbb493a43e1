"""Lengths of a person's bones, and places of the joints on its head and feet, from joints and poses over time.

Both sides have the same lengths, and the head and the feet are symmetric. All estimates are medians over frames, so
that wrong joints do not count.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton_fit.body import LENGTHS, STATURE, ArticulatedBody
from mvpose.skeleton_fit.kinematics import Pose

_FEWEST = 3  # frames in which a bone must be seen
_SHORTEST = 0.01  # metres
_SIDES = ("left", "right")


def _both(part: str) -> tuple[str, ...]:
    return tuple(f"{side}_{part}" for side in _SIDES)


def _limb(start: str, end: str) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]:
    return tuple(((f"{side}_{start}",), (f"{side}_{end}",)) for side in _SIDES)


_SPANS = {
    "trunk": ((_both("hip"), _both("shoulder")),),
    "hip": ((("right_hip",), ("left_hip",)),),
    "shoulder": ((("right_shoulder",), ("left_shoulder",)),),
    "upper arm": _limb("shoulder", "elbow"),
    "forearm": _limb("elbow", "wrist"),
    "thigh": _limb("hip", "knee"),
    "shank": _limb("knee", "ankle"),
}  # from the middle of some joints to that of others, one or two times in the body
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
