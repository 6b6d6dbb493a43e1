"""What makes a person hard to detect: size, what hides them, who is near, what the image's border cuts off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17
from mvpose.arrays import Bools, Floats
from simharness.types.views import Views
from simharness.types.visibility import Visibility

BOX_SHARE = 0.53
"""Of a person's box is the person (Ronchi & Perona): OKS areas where no mask is given."""

VISIBLE, OWN, HIDDEN, OUTSIDE = range(4)
"""How a joint is seen, as far as a detector cares: what hides it, its own body or anything else."""

_AS_SEEN = np.array([VISIBLE, OWN, HIDDEN, HIDDEN, OUTSIDE], np.int8)  # by Visibility

MEETS = 0.1
"""Intersection over union from which boxes overlap, and people may be taken for each other."""


@dataclass(frozen=True)
class Conditions:
    """How everyone is seen, (T, V, P) people in pictures.

    Attributes:
        unit: OKS sigma x sqrt(area) of each joint, (T, V, P, J), pixels.
        area: BOX_SHARE of the box, (T, V, P), square pixels.
        seen: VISIBLE, OWN, HIDDEN or OUTSIDE, (T, V, P, J).
        valid: how many joints neither somebody else, a thing nor the border hides, (T, V, P).
        cut: whether the border cuts the person, (T, V, P).
        neighbour: whose box overlaps most, (T, V, P); -1 where none does.
        crowded: at most 10 valid joints and a box that overlaps, or at most 15 and three (PoseFix: Moon et al., CVPR
            2019), (T, V, P).
    """

    unit: Floats
    area: Floats
    seen: NDArray[np.int8]
    valid: NDArray[np.int64]
    cut: Bools
    neighbour: NDArray[np.int64]
    crowded: Bools

    @classmethod
    def of(cls, views: Views) -> Self:
        """The conditions in the pictures of a film."""
        seen = _AS_SEEN[views.visibility]
        area = BOX_SHARE * views.boxes[..., 2] * views.boxes[..., 3]
        outside = views.visibility == Visibility.OUTSIDE
        valid = (seen <= OWN).sum(axis=-1)
        overlap = overlaps(views.boxes)
        near = (overlap > MEETS).sum(axis=-1)
        some = near > 0
        nearest = overlap.argmax(axis=-1) if overlap.shape[-1] else np.zeros(area.shape, np.int64)
        return cls(
            unit=oks_units(views.boxes),
            area=area,
            seen=seen,
            valid=valid,
            cut=outside.any(axis=-1) & ~outside.all(axis=-1),
            neighbour=np.where(some, nearest, -1),
            crowded=(some & (valid <= 10)) | ((near >= 3) & (valid <= 15)),
        )


def oks_units(boxes: Floats) -> Floats:
    """OKS sigma x sqrt(area) of each joint, (..., 17) pixels, of people in boxes x, y, width, height (..., 4)."""
    return np.sqrt(BOX_SHARE * boxes[..., 2] * boxes[..., 3])[..., None] * np.asarray(COCO17.sigmas)


def overlaps(boxes: Floats) -> Floats:
    """Intersection over union of the boxes (..., P, 4) of a picture, (..., P, P); 0 of one with itself."""
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
