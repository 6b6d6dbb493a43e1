"""What hides which joint, guessed from skeletons: recordings say nothing of it.

People are taken for capsules about their bones, seen in the picture: a joint is hidden by a bone that it projects into
and whose near side is in front of it, by more than its own flesh if the bone is its own. Things that stand about are
not known, so what they hide counts as visible. How right that is can be told on simulated people: CONFUSION.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Rig
from mvpose.arrays import Floats
from simharness.detector.bias import body_axes
from simharness.detector.conditions import OCCLUDED, OUTSIDE, SELF_OCCLUDED, VISIBLE
from simharness.reality.detector_fit.sizes import head

CONFUSION = np.array(
    [
        [[0.97, 0.02, 0.01], [0.06, 0.94, 0.00], [0.11, 0.01, 0.88]],  # nose
        [[0.96, 0.03, 0.01], [0.04, 0.96, 0.00], [0.08, 0.02, 0.90]],  # eyes
        [[0.96, 0.03, 0.01], [0.04, 0.95, 0.01], [0.07, 0.06, 0.87]],  # ears
        [[0.89, 0.10, 0.01], [0.03, 0.96, 0.01], [0.06, 0.03, 0.91]],  # shoulders
        [[0.90, 0.08, 0.02], [0.10, 0.88, 0.02], [0.06, 0.02, 0.92]],  # elbows
        [[0.89, 0.09, 0.02], [0.01, 0.98, 0.01], [0.03, 0.01, 0.96]],  # wrists
        [[0.96, 0.03, 0.01], [0.08, 0.91, 0.01], [0.01, 0.01, 0.98]],  # hips
        [[0.91, 0.06, 0.03], [0.01, 0.98, 0.01], [0.01, 0.02, 0.97]],  # knees
        [[0.84, 0.13, 0.03], [0.14, 0.83, 0.03], [0.01, 0.00, 0.99]],  # ankles
    ]
)
"""What joints truly are that skeletons tell to be VISIBLE, SELF_OCCLUDED and OCCLUDED, (9, 3, 3): rows of shares by what they tell.
Counted on simulated, dressed people on the rig of Shelf (:func:`twin.confusion`, seeds 10, 11, 14 and 15).
"""

_NEAR = 0.25  # metres from the skull's middle within which a face is believed
_SKULL = 0.40  # where the skull's middle is above the shoulders, in lengths of the trunk
# Points of a body: COCO-17, then the middle of the skull, of the shoulders and of the hips. Bones and metres of flesh.
_HEAD, _NECK, _PELVIS = 17, 18, 19
_BONES = (
    (_HEAD, _HEAD, 0.095), (_NECK, _HEAD, 0.06), (_NECK, _PELVIS, 0.13), (5, 11, 0.10), (6, 12, 0.10), (5, 6, 0.07),
    (5, 7, 0.05), (6, 8, 0.05), (7, 9, 0.04), (8, 10, 0.04),
    (11, 13, 0.08), (12, 14, 0.08), (13, 15, 0.055), (14, 16, 0.055),
)  # fmt: skip
# How far in front of a joint its own skin may be: twice the flesh about it, and 4 cm, as of rendered bodies.
# Shoulders and hips, which lie in the trunk: as much less as makes them hidden as often as they truly are.
_SKIN = np.array([0.04] * 5 + [0.14, 0.14, 0.13, 0.13, 0.10, 0.10, 0.19, 0.19, 0.16, 0.16, 0.12, 0.12])
# The face beside the skull's middle, forward, left and up in metres, where no detections tell where it is.
_FACE = np.array([[0.10, 0, 0.0], [0.08, 0.03, 0.03], [0.08, -0.03, 0.03], [0.0, 0.075, 0.01], [0.0, -0.075, 0.01]])
# Where it looks to, and the cosine of the angle to a camera from which the own head hides it.
_LOOKS = np.array([[1.0, 0, 0], [0.9, 0.44, 0], [0.9, -0.44, 0], [0, 1.0, 0], [0, -1.0, 0]])
_TURNED_AWAY = np.array([-0.5, -0.28, -0.28, -0.1, -0.1])
_ENDS = np.array([bone[:2] for bone in _BONES])
_FLESH = np.array([bone[2] for bone in _BONES])
_OF_HEAD = (_ENDS == _HEAD).any(axis=1)


def with_face(reference: Floats, consensus: Floats) -> tuple[Floats, Floats]:
    """Joints with the face where detections agree that it is, and where it looks to.

    Where they do not agree, it is a usual face, turned as what they agree on of it is, or else as the trunk.

    Args:
        reference: true limb joints, (T, P, 17, 3) metres.
        consensus: joints as detections have them, (T, P, 17, 3); NaN where they do not agree.

    Returns:
        Joints (T, P, 17, 3), and unit vectors away from the head at the five joints of the face, (T, P, 5, 3).
    """
    joints, axes = reference.copy(), body_axes(reference)
    skull = head(reference, height=_SKULL)[..., None, :]
    told = np.einsum("tpjc,tpkc->tpjk", consensus[..., :5, :] - skull, axes)  # forward, left, up
    near = np.linalg.norm(told, axis=-1) < _NEAR
    # How far the head is turned against the trunk: what brings the usual face nearest to what was found of it.
    x, y = np.moveaxis(np.where(near[..., None], told, 0.0)[..., :2], -1, 0)
    turn = np.arctan2(
        (_FACE[:, 0] * y - _FACE[:, 1] * x).sum(axis=-1), (_FACE[:, 0] * x + _FACE[:, 1] * y).sum(axis=-1)
    )
    cos, sin = np.cos(turn)[..., None], np.sin(turn)[..., None]
    forward, left, up = np.moveaxis(axes, -2, 0)
    turned = np.stack([cos * forward + sin * left, cos * left - sin * forward, up], axis=-2)
    joints[..., :5, :] = np.where(near[..., None], consensus[..., :5, :], skull + _FACE @ turned)
    return joints, _LOOKS @ turned


def seen(joints: Floats, looks: Floats, strangers: Floats, rig: Rig) -> NDArray[np.int8]:
    """How each joint is seen, (T, V, P, 17): VISIBLE, SELF_OCCLUDED, OCCLUDED or OUTSIDE; OUTSIDE where it is unknown.

    Args:
        joints: of the known people, with the face, (T, P, 17, 3) metres; NaN where unknown.
        looks: where the joints of the face look to, (T, P, 5, 3) unit vectors.
        strangers: of the others, (T, N, 17, 3).
        rig: the V cameras.
    """
    people = joints.shape[1]
    bodies = _points(np.concatenate([joints, strangers], axis=1))
    start, end = (bodies[..., _ENDS[:, side], :] for side in (0, 1))
    present = np.any(np.isfinite(bodies), axis=(2, 3))
    result = np.full((len(joints), len(rig), people, len(COCO17)), VISIBLE, np.int8)
    for view, camera in enumerate(rig):
        focal = np.sqrt(camera.K[0, 0] * camera.K[1, 1])
        pixels, depth = camera.project(joints), camera.depth(joints)
        a, b, near, far = camera.project(start), camera.project(end), camera.depth(start), camera.depth(end)
        label = result[:, view]
        for body in range(bodies.shape[1]):
            now = present[:, body]
            with np.errstate(invalid="ignore", divide="ignore"):
                bone = (b - a)[now, body, None, None]  # (t, 1, 1, B, 2)
                away = pixels[now, ..., None, :] - a[now, body, None, None]
                length = (bone**2).sum(axis=-1)
                along = np.clip(np.where(length > 0, (away * bone).sum(axis=-1) / length, 0.0), 0, 1)
                at = near[now, body, None, None] + along * (far - near)[now, body, None, None]
                away = away - along[..., None] * bone
                aside = np.hypot(away[..., 0], away[..., 1]) * at / focal
                front = depth[now, ..., None] - at + np.sqrt(_FLESH**2 - aside**2)  # NaN beside the bone
            own = np.arange(people) == body
            hides = front > np.where(own[:, None], _SKIN, 0.0)[..., None]
            hides[:, own, :5] &= ~_OF_HEAD  # which has a rule of its own
            hidden = hides.any(axis=-1)
            theirs = label[now]
            theirs[hidden & own[:, None] & (theirs == VISIBLE)] = SELF_OCCLUDED
            theirs[hidden & ~own[:, None]] = OCCLUDED
            label[now] = theirs
        ray = camera.center - joints[..., :5, :]
        away = (looks * ray).sum(axis=-1) < _TURNED_AWAY * np.linalg.norm(ray, axis=-1)
        face = label[..., :5]
        face[away & (face == VISIBLE)] = SELF_OCCLUDED
        label[~camera.inside(pixels)] = OUTSIDE
    return result


def _points(joints: Floats) -> Floats:
    """Joints (..., 17, 3) and the middles that bones hang on, (..., 20, 3)."""
    middle = [joints[..., [5, 6], :].mean(axis=-2), joints[..., [11, 12], :].mean(axis=-2)]
    extra = [head(joints, height=_SKULL), *middle]
    return np.concatenate([joints, np.stack(extra, axis=-2)], axis=-2)
