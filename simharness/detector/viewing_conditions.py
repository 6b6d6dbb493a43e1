"""Viewing conditions that make a person hard to detect: size, occlusion, neighbours, truncation by the border."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from simharness.types.views import Views, Visibility

BOX_SHARE = 0.53
"""Share of a person's box that the person covers (Ronchi & Perona): the area of OKS where no mask is given."""

VISIBLE, SELF_OCCLUDED, OCCLUDED, OUTSIDE = range(4)
"""Occlusion classes of a joint as far as a detector distinguishes them; OCCLUDED: by another person or an object."""

_BY_VISIBILITY = np.array([VISIBLE, SELF_OCCLUDED, OCCLUDED, OCCLUDED, OUTSIDE], np.int8)

OVERLAP_MIN = 0.1
"""Intersection over union above which two boxes overlap, so that their people may be confused."""


@dataclass(frozen=True)
class Conditions:
    """Viewing conditions of everyone, (T, V, P) people in pictures.

    Attributes:
        unit: OKS sigma x sqrt(area) of each joint, (T, V, P, J), pixels.
        area: BOX_SHARE of the box, (T, V, P), square pixels.
        occlusion: VISIBLE, SELF_OCCLUDED, OCCLUDED or OUTSIDE, (T, V, P, J).
        valid: number of joints that are visible or self-occluded, (T, V, P).
        cut: whether the border of the image cuts the person, (T, V, P).
        neighbour: person whose box overlaps most, (T, V, P); -1 where no box overlaps.
        crowded: at most 10 valid joints and an overlapping box, or at most 15 and three (PoseFix: Moon et al., CVPR
            2019), (T, V, P).
    """

    unit: Floats
    area: Floats
    occlusion: NDArray[np.int8]
    valid: NDArray[np.int64]
    cut: Bools
    neighbour: NDArray[np.int64]
    crowded: Bools

    @classmethod
    def of(cls, views: Views) -> Self:
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
