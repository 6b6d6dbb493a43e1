"""Occlusion and boxes of people in the pictures, estimated from their joints: recordings contain neither.

People are modelled as capsules about their bones. A joint is hidden by a bone into whose capsule it projects and whose
near side is in front of it; for a bone of the same person, in front by more than the flesh about the joint. Objects are
unknown, so joints that they hide count as visible.
"""

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Rig
from mvpose.arrays import Bools, Floats
from simharness.detector.viewing_conditions import OCCLUDED, OUTSIDE, SELF_OCCLUDED, VISIBLE, body_axes
from simharness.reality.detector_fit.sample import LIMB_JOINTS

FLESH = 0.085
"""Margin about every limb joint and the crown, metres. With this margin and CROWN, the median error of width and height
of the boxes is 1 % for simulated, dressed people who walk, reach, point and turn; the error of the root of the area is
below 10 % for 90 % of them."""

CROWN = 0.6
"""Height of the crown above the middle of the shoulders, as a share of the trunk's length."""

_NEAR = 0.25  # metres from the middle of the skull within which triangulated joints of the face are accepted
_SKULL = 0.40  # height of the middle of the skull above the shoulders, in lengths of the trunk

_CHIN = 0.35
"""Height of the face on the same scale."""

_SHOULDERS, _HIPS = [5, 6], [11, 12]
# Points of a body: COCO-17, then the middles of skull, shoulders and hips. Bones: two points and a radius in metres.
_HEAD, _NECK, _PELVIS = 17, 18, 19
_BONES = (
    (_HEAD, _HEAD, 0.095), (_NECK, _HEAD, 0.06), (_NECK, _PELVIS, 0.13), (5, 11, 0.10), (6, 12, 0.10), (5, 6, 0.07),
    (5, 7, 0.05), (6, 8, 0.05), (7, 9, 0.04), (8, 10, 0.04),
    (11, 13, 0.08), (12, 14, 0.08), (13, 15, 0.055), (14, 16, 0.055),
)  # fmt: skip
# Distance by which the person's skin may be in front of a joint: twice the flesh about it and 4 cm, as of rendered
# bodies. For shoulders and hips, which lie in the trunk, less: so that they are hidden as often as in simulation.
_SKIN = np.array([0.04] * 5 + [0.14, 0.14, 0.13, 0.13, 0.10, 0.10, 0.19, 0.19, 0.16, 0.16, 0.12, 0.12])
# Usual face relative to the middle of the skull, forward, left and up in metres, where detections do not locate it.
_FACE = np.array([[0.10, 0, 0.0], [0.08, 0.03, 0.03], [0.08, -0.03, 0.03], [0.0, 0.075, 0.01], [0.0, -0.075, 0.01]])
# Outward directions of the joints of the face, and the cosine to the direction of a camera below which the head hides
# them.
_NORMALS = np.array([[1.0, 0, 0], [0.9, 0.44, 0], [0.9, -0.44, 0], [0, 1.0, 0], [0, -1.0, 0]])
_MIN_COSINE = np.array([-0.5, -0.28, -0.28, -0.1, -0.1])
_ENDS = np.array([bone[:2] for bone in _BONES])
_FLESH = np.array([bone[2] for bone in _BONES])
_OF_HEAD = (_ENDS == _HEAD).any(axis=1)


def complete_face(reference: Floats, consensus: Floats) -> tuple[Floats, Floats]:
    """Return the joints with a face, and the outward directions of the face.

    The joints of the face are those on which the detections agree. The others are those of a usual face, turned to fit
    these joints, or else as the trunk.

    Args:
        reference: true limb joints, (T, P, 17, 3) metres.
        consensus: joints triangulated from detections, (T, P, 17, 3); NaN where detections do not agree.

    Returns:
        Joints (T, P, 17, 3), and unit vectors away from the head at the five joints of the face, (T, P, 5, 3).
    """
    joints, axes = reference.copy(), body_axes(reference)
    skull = head(reference, height=_SKULL)[..., None, :]
    in_head = np.einsum("tpjc,tpkc->tpjk", consensus[..., :5, :] - skull, axes)  # forward, left, up
    near = np.linalg.norm(in_head, axis=-1) < _NEAR
    # Rotation of the head against the trunk that brings the usual face nearest to the joints found.
    x, y = np.moveaxis(np.where(near[..., None], in_head, 0.0)[..., :2], -1, 0)
    turn = np.arctan2(
        (_FACE[:, 0] * y - _FACE[:, 1] * x).sum(axis=-1), (_FACE[:, 0] * x + _FACE[:, 1] * y).sum(axis=-1)
    )
    cos, sin = np.cos(turn)[..., None], np.sin(turn)[..., None]
    forward, left, up = np.moveaxis(axes, -2, 0)
    turned = np.stack([cos * forward + sin * left, cos * left - sin * forward, up], axis=-2)
    joints[..., :5, :] = np.where(near[..., None], consensus[..., :5, :], skull + _FACE @ turned)
    return joints, _NORMALS @ turned


def occlusion_classes(joints: Floats, normals: Floats, unannotated: Floats, rig: Rig) -> NDArray[np.int8]:
    """Return the occlusion class of each joint, (T, V, P, 17); OUTSIDE also where the joint is unknown.

    Args:
        joints: joints of the known people, with the face, (T, P, 17, 3) metres; NaN where unknown.
        normals: outward unit vectors at the joints of the face, (T, P, 5, 3).
        unannotated: joints of the other people, (T, N, 17, 3) metres.
        rig: the V cameras.
    """
    people = joints.shape[1]
    bodies = _points(np.concatenate([joints, unannotated], axis=1))
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
            same = np.arange(people) == body
            hides = front > np.where(same[:, None], _SKIN, 0.0)[..., None]
            hides[:, same, :5] &= ~_OF_HEAD  # the head hides the face by the rule below
            hidden = hides.any(axis=-1)
            current = label[now]
            current[hidden & same[:, None] & (current == VISIBLE)] = SELF_OCCLUDED
            current[hidden & ~same[:, None]] = OCCLUDED
            label[now] = current
        ray = camera.center - joints[..., :5, :]
        away = (normals * ray).sum(axis=-1) < _MIN_COSINE * np.linalg.norm(ray, axis=-1)
        face = label[..., :5]
        face[away & (face == VISIBLE)] = SELF_OCCLUDED
        label[~camera.inside(pixels)] = OUTSIDE
    return result


def person_boxes(joints: Floats, rig: Rig) -> Floats:
    """Return the boxes x, y, width, height of people in the pictures, (T, V, P, 4); zeros where they are not visible.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres; only limb joints are used.
        rig: the V cameras.
    """
    points = np.concatenate([joints[..., LIMB_JOINTS, :], head(joints, height=CROWN)[..., None, :]], axis=-2)
    result = []
    for camera in rig:
        pixels = camera.project(points)
        focal = np.sqrt(camera.K[0, 0] * camera.K[1, 1])
        with np.errstate(invalid="ignore", divide="ignore"):
            around = (FLESH * focal / camera.depth(points))[..., None]
        limit = np.asarray(camera.size, float) - 1
        whole = np.all(np.isfinite(pixels), axis=(-1, -2))  # no box for people who are partly behind the camera
        low = np.clip(np.where(whole[..., None], (pixels - around).min(axis=-2), 0.0), 0, limit)
        high = np.clip(np.where(whole[..., None], (pixels + around).max(axis=-2), 0.0), 0, limit)
        result.append(np.concatenate([low, high - low], axis=-1))
    return np.stack(result, axis=1)


def in_picture(joints: Floats, rig: Rig) -> Bools:
    """Return which joints lie on the pictures, (T, V, P, 17); for joints of the face, the middle of the head."""
    points = joints.copy()
    points[..., : LIMB_JOINTS[0], :] = head(joints, height=_CHIN)[..., None, :]
    return np.stack([camera.inside(camera.project(points)) for camera in rig], axis=1)


def head(joints: Floats, *, height: float) -> Floats:
    """Return a point of the head, (..., 3), from COCO-17 joints (..., 17, 3).

    Args:
        joints: metres.
        height: height above the middle of the shoulders, in lengths of the trunk.
    """
    shoulders, hips = joints[..., _SHOULDERS, :].mean(axis=-2), joints[..., _HIPS, :].mean(axis=-2)
    return shoulders + height * (shoulders - hips)


def _points(joints: Floats) -> Floats:
    """Return joints (..., 17, 3) with the middles of skull, shoulders and hips, (..., 20, 3)."""
    middle = [joints[..., [5, 6], :].mean(axis=-2), joints[..., [11, 12], :].mean(axis=-2)]
    extra = [head(joints, height=_SKULL), *middle]
    return np.concatenate([joints, np.stack(extra, axis=-2)], axis=-2)
