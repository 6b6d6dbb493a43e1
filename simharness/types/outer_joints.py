"""Ground truth and detections of people on skeletons with feet and hands, beside those on COCO17."""

from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mvpose import Detections
from mvpose.arrays import Floats
from mvpose.checks import set_arrays
from mvpose.skeleton import Skeleton
from mvpose.wholebody.estimator import rows_of


@dataclass(frozen=True)
class OuterViews:
    """Outer joints in the pictures that V cameras deliver: E joints of a skeleton beyond COCO17, in T frames."""

    pixels: Floats
    """Pixel of each joint, (T, V, P, E, 2); NaN behind the camera, of absent people, in pictures that never arrive, and
    of joints that the body model does not have."""
    visibility: NDArray[np.int8]
    """:class:`simharness.types.views.Visibility`, (T, V, P, E) int8; OUTSIDE where the pixel is unknown."""

    def __post_init__(self) -> None:
        set_arrays(self, pixels=("T", "V", "P", "E", 2), visibility=(("T", "V", "P", "E"), np.int8))

    @classmethod
    def concatenate(cls, parts: Many[Self]) -> Self:
        """Join the views of consecutive frames."""
        return cls(*(np.concatenate([getattr(part, key) for part in parts]) for key in ("pixels", "visibility")))


@dataclass(frozen=True)
class OuterTruth:
    """True outer joints of a sequence."""

    skeleton: Skeleton
    """Skeleton whose joints beyond COCO17 they are."""
    joints: Floats
    """In the world, (T, P, E, 3), metres; NaN of absent people and of joints that the body model does not have."""
    views: OuterViews
    """The same joints in the pictures."""


@dataclass(frozen=True)
class WholeFrame:
    """Detections and truth of one frame on a skeleton with feet and hands.

    Raises:
        ValueError: joints of another skeleton than the detections.
    """

    detections: Detections
    """The detections of the frame, in the order and with the body of those on COCO17."""
    joints: Floats
    """True joints, (P, J, 3), metres; NaN of absent people and of joints that the body model does not have."""

    def __post_init__(self) -> None:
        set_arrays(self, joints=("P", len(self.detections.skeleton), 3))


def whole_joints(body: Floats, outer: Floats, skeleton: Skeleton) -> Floats:
    """Return values of the joints of a skeleton, (..., J, k), from those of COCO17, (..., 17, k), and the others."""
    rows, others = rows_of(skeleton)
    known = rows >= 0
    whole = np.empty((*body.shape[:-2], len(skeleton), body.shape[-1]))
    whole[..., rows[known], :], whole[..., others, :] = body[..., known, :], outer
    return whole
