"""Viewing conditions that make a person hard to detect: size, occlusion, neighbours, truncation by the border.

Also the geometry of people in views: image axes in space, bearings, and shares of hidden joints.

A detector's joints have systematic offsets from the anatomical ones, e.g. annotated hips above the hip joints.

Circumstances in which a detector takes left for right, or one person for another: factors of the shares of errors.

A detector distinguishes left and right by the face and by which limb hides the other: from behind and from the side
they are inverted more often than from the front. A joint is taken for its counterpart, or for that of another person,
where both are near in the picture.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.scenario.sections.detector_section import FACTOR_BEARINGS, BiasSection
from simharness.types.views import Views, Visibility
from simharness.world.rigs.projection import project_to_image


def inversion_factors(joints: ArrayLike, rig: Rig, factors: tuple[float, ...] | None) -> Floats:
    """Return the factors of inversions of people, (T, V, P), by the bearing of the camera from the head.

    Args:
        joints: true joints in the world, (T, P, 17, 3) metres.
        rig: the V cameras.
        factors: factor at each of FACTOR_BEARINGS from straight ahead, with linear interpolation, to both sides alike;
            None: 1 everywhere.
    """
    joints = np.asarray(joints, float)
    if factors is None:
        return np.ones((len(joints), len(rig), joints.shape[1]))
    away = np.abs(np.mod(np.nan_to_num(head_bearings(joints, rig)) + np.pi, 2 * np.pi) - np.pi)
    return np.interp(away, np.deg2rad(FACTOR_BEARINGS), factors)


def distance_factors(target: Floats, other: Floats, height: Floats, reach: float) -> Floats:
    """Return the factors of inversions or swaps, (..., J): exp(-distance / (reach x height)); 1 with a reach of 0.

    Args:
        target: true places of the joints, (..., J, 2) pixels.
        other: places of their counterparts, or of the same joints of the other person, (..., J, 2) pixels.
        height: height of the person's box, (...) pixels.
        reach: distance at which a factor of 1 has fallen to 1 / e, heights.
    """
    if reach == 0:
        return np.ones(target.shape[:-1])
    with np.errstate(invalid="ignore"):
        far = np.hypot(*np.moveaxis(target - other, -1, 0)) / np.maximum(height, 1.0)[..., None]
    return np.nan_to_num(np.exp(-far / reach))


_LEFT_SHOULDER, _RIGHT_SHOULDER, _LEFT_HIP, _RIGHT_HIP = 5, 6, 11, 12
SIDE = np.array([1, *[1, -1] * 8])
"""Outward direction of each COCO-17 joint, (17,): 1 to the left (also of the nose), -1 to the right."""


def body_axes(joints: ArrayLike) -> Floats:
    """Return unit vectors forward, left and up of bodies, (..., 3, 3) as rows, from COCO-17 joints (..., 17, 3).

    Up goes from the middle of the hips to the middle of the shoulders. Left goes from the right shoulder and hip to
    the left ones, perpendicular to up.
    """
    joints = np.asarray(joints, float)
    shoulders, hips = joints[..., [_LEFT_SHOULDER, _RIGHT_SHOULDER], :], joints[..., [_LEFT_HIP, _RIGHT_HIP], :]
    up = unit(shoulders.mean(axis=-2) - hips.mean(axis=-2))
    across = shoulders[..., 0, :] - shoulders[..., 1, :] + hips[..., 0, :] - hips[..., 1, :]
    left = unit(across - (across * up).sum(axis=-1, keepdims=True) * up)
    return np.stack([np.cross(left, up), left, up], axis=-2)


def world_offsets(joints: ArrayLike, bias: BiasSection) -> Floats:
    """Return the offsets of the detector's joints from the anatomical joints (..., 17, 3), (..., 17, 3) metres."""
    in_body = np.array(bias.by_joint()) * np.stack([np.ones(17), SIDE, np.ones(17)], axis=1)
    return in_body @ body_axes(joints)


def pixel_offsets(joints: Floats, bias: BiasSection, rig: Rig) -> Floats:
    """Return the same offsets in the pictures of V cameras: joints (T, P, 17, 3) metres to (T, V, P, 17, 2) pixels.

    The cameras are those of the first frame. Where cameras drift, this is a small error of a small offset.
    """
    moved = joints + world_offsets(joints, bias)
    return np.stack([project_to_image(camera, moved) - project_to_image(camera, joints) for camera in rig], axis=1)


def unit(vector: Floats) -> Floats:
    """Return vectors (..., 3) at length 1; NaN for vectors without length."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


BOX_SHARE = 0.53
"""Share of a person's box that the person covers (Ronchi & Perona): the area of OKS where no mask is given."""

VISIBLE, SELF_OCCLUDED, OCCLUDED, OUTSIDE = range(4)
"""Occlusion classes of a joint as far as a detector distinguishes them; OCCLUDED: by another person or an object."""

_BY_VISIBILITY = np.array([VISIBLE, SELF_OCCLUDED, OCCLUDED, OCCLUDED, OUTSIDE], np.int8)

OVERLAP_MIN = 0.1
"""Intersection over union above which two boxes overlap, so that their people may be confused."""


@dataclass(frozen=True)
class Conditions:
    """Viewing conditions of everyone, (T, V, P) people in pictures."""

    unit: Floats
    """OKS sigma x sqrt(area) of each joint, (T, V, P, J), pixels."""
    area: Floats
    """BOX_SHARE of the box, (T, V, P), square pixels."""
    occlusion: NDArray[np.int8]
    """VISIBLE, SELF_OCCLUDED, OCCLUDED or OUTSIDE, (T, V, P, J)."""
    valid: NDArray[np.int64]
    """Number of joints that are visible or self-occluded, (T, V, P)."""
    cut: Bools
    """Whether the border of the image cuts the person, (T, V, P)."""
    neighbour: NDArray[np.int64]
    """Person whose box overlaps most, (T, V, P); -1 where no box overlaps."""
    crowded: Bools
    """At most 10 valid joints and an overlapping box, or at most 15 and three (PoseFix: Moon et al., CVPR 2019), (T, V,
    P)."""

    @classmethod
    def of_views(cls, views: Views) -> Self:
        """Return the viewing conditions in the pictures of a sequence."""
        occlusion = occlusion_classes(views.visibility)
        area = BOX_SHARE * views.boxes[..., 2] * views.boxes[..., 3]
        outside = views.visibility == Visibility.OUTSIDE
        valid = (occlusion <= SELF_OCCLUDED).sum(axis=-1)
        overlap = overlaps(views.boxes)
        near = (overlap > OVERLAP_MIN).sum(axis=-1)
        some = near > 0
        nearest = overlap.argmax(axis=-1) if overlap.shape[-1] else np.zeros(area.shape, np.int64)
        return cls(
            unit=oks_units(views.boxes),
            area=area,
            occlusion=occlusion,
            valid=valid,
            cut=outside.any(axis=-1) & ~outside.all(axis=-1),
            neighbour=np.where(some, nearest, -1),
            crowded=(some & (valid <= 10)) | ((near >= 3) & (valid <= 15)),
        )


def oks_units(boxes: Floats) -> Floats:
    """Return OKS sigma x sqrt(area) of each joint, (..., 17) pixels, for boxes x, y, width, height (..., 4)."""
    return np.sqrt(BOX_SHARE * boxes[..., 2] * boxes[..., 3])[..., None] * np.asarray(COCO17.sigmas)


def occlusion_classes(visibility: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return the occlusion classes of joints, VISIBLE to OUTSIDE, from their visibility (...)."""
    return _BY_VISIBILITY[visibility]


def overlaps(boxes: Floats) -> Floats:
    """Return the intersection over union of all boxes (..., P, 4) of a picture, (..., P, P); 0 on the diagonal."""
    low, high = boxes[..., :2], boxes[..., :2] + boxes[..., 2:]
    shared = np.minimum(high[..., :, None, :], high[..., None, :, :]) - np.maximum(
        low[..., :, None, :], low[..., None, :, :]
    )
    both = np.maximum(shared, 0.0).prod(axis=-1)
    area = boxes[..., 2] * boxes[..., 3]
    either = area[..., :, None] + area[..., None, :] - both
    result = np.divide(both, either, out=np.zeros_like(both), where=either > 0)
    people = np.arange(boxes.shape[-2])
    result[..., people, people] = 0.0
    return result


BESIDE = (*((joint, joint + 2) for joint in (5, 6, 7, 8, 11, 12, 13, 14)), (5, 11), (6, 12))
"""Pairs of limb joints of COCO-17 that are one bone apart along the skeleton."""

_BESIDE = np.zeros((17, 17), np.float32)
_BESIDE[tuple(np.array(BESIDE).T)] = _BESIDE[tuple(np.array(BESIDE).T[::-1])] = 1.0


def at_edges(occlusion: NDArray[np.int8]) -> Bools:
    """Return which joints (..., 17), of given occlusion classes, have a visible joint beside them, (..., 17)."""
    return np.asarray((occlusion == VISIBLE).astype(np.float32) @ _BESIDE > 0)


_TRUNK = (5, 6, 11, 12)


def trunk_depths(joints: ArrayLike, rig: Rig) -> Floats:
    """Return by how much joints (T, P, 17, 3) are on the far side of their trunk, (T, V, P, 17) metres.

    That is their depth behind the middle of the trunk, times the square of the cosine between view and shoulder line:
    from the side, the trunk hides limbs; from the front and from behind, the place of hidden ones is seen.
    """
    joints = np.asarray(joints, float)
    middle, left = joints[..., _TRUNK, :].mean(axis=-2), body_axes(joints)[..., 1, :]
    result = []
    for camera in rig:
        view = unit(middle - camera.center)
        depth = np.einsum("tpjc,tpc->tpj", joints - middle[..., None, :], view)
        result.append(depth * (view * left).sum(axis=-1)[..., None] ** 2)
    return np.stack(result, axis=1)


_HIDDEN = (Visibility.OCCLUDED_BY_PERSON, Visibility.OCCLUDED_BY_CLUTTER, Visibility.OUTSIDE)


def image_axes(centers: Floats, rig: Rig) -> Floats:
    """Return right and down in the pictures of V cameras, perpendicular to the direction to people's centers.

    Args:
        centers: positions of people, (T, P, 3) metres.
        rig: the V cameras.

    Returns:
        Unit vectors in the world, (T, V, P, 2, 3).
    """
    result = []
    for camera in rig:
        forward = centers - camera.center
        forward = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
        right = np.cross(camera.R[1], forward)
        right /= np.linalg.norm(right, axis=-1, keepdims=True)
        result.append(np.stack([right, np.cross(forward, right)], axis=-2))
    return np.stack(result, axis=1)


def bearings(joints: ArrayLike, rig: Rig) -> Floats:
    """Return the bearings of V cameras from people (T, P, 17, 3), radians to the left of straight ahead, (T, V, P)."""
    joints = np.asarray(joints, float)
    forward = body_axes(joints)[..., 0, :2]
    hips = joints[..., 11:13, :2].mean(axis=-2)
    result = []
    for camera in rig:
        toward = camera.center[:2] - hips
        result.append(np.arctan2(toward[..., 1], toward[..., 0]) - np.arctan2(forward[..., 1], forward[..., 0]))
    return np.stack(result, axis=1)


def hidden_shares(visibility: NDArray[np.int8]) -> Floats:
    """Return the share of joints (..., J) that other people or objects hide or the border cuts off, (...)."""
    return np.isin(visibility, _HIDDEN).mean(axis=-1)


def head_bearings(joints: ArrayLike, rig: Rig) -> Floats:
    """Return the bearings of V cameras from heads, radians to the left of straight ahead, (T, V, P); NaN where unknown.

    Ahead points from the middle of the ears to the nose, left from the right ear to the left one.

    Args:
        joints: COCO-17, (T, P, 17, 3) metres; NaN where unknown.
        rig: the V cameras.
    """
    joints = np.asarray(joints, float)
    nose, left_ear, right_ear = joints[..., 0, :], joints[..., 3, :], joints[..., 4, :]
    center = (left_ear + right_ear) / 2
    left = unit(left_ear - right_ear)
    ahead = nose - center
    ahead = unit(ahead - (ahead * left).sum(axis=-1, keepdims=True) * left)
    toward = np.stack([camera.center - center for camera in rig], axis=1)
    return np.arctan2((toward * left[:, None]).sum(axis=-1), (toward * ahead[:, None]).sum(axis=-1))
