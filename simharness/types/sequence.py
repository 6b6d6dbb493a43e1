"""What the simulation knows: where every joint of every person is in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.checks import as_array
from mvpose.skeleton import COCO17, Skeleton
from simharness.types.landmarks import LANDMARKS, of_skeleton


@dataclass(frozen=True)
class Sequence:
    """The truth about T frames of P people; P may be 0.

    Attributes:
        landmarks: of ``simharness.types.landmarks.LANDMARKS`` in the world, (T, P, L, 3), metres.
        ids: the people's numbers, (P,) int.
        time: seconds, (T,).

    Raises:
        ValueError: a wrong shape or a value that is not finite.
    """

    landmarks: Floats
    ids: NDArray[np.int64]
    time: Floats

    def __post_init__(self) -> None:
        time = as_array(self.time, ("T",), "sequence time")
        ids = as_array(self.ids, ("P",), "sequence ids", np.int64)
        landmarks = as_array(self.landmarks, (len(time), len(ids), len(LANDMARKS), 3), "sequence landmarks")
        for key, value in (("landmarks", landmarks), ("ids", ids), ("time", time)):
            if not np.isfinite(value).all():
                raise ValueError(f"sequence {key} must be finite: the truth is never missing")
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def joints(self) -> Floats:
        """COCO-17 joints in the world, (T, P, 17, 3), metres."""
        return self.landmarks[:, :, : len(COCO17)]

    def of_skeleton(self, skeleton: Skeleton) -> Floats:
        """The joints of a skeleton in the world, (T, P, J, 3), metres: the body's own points, not made from COCO's.

        Raises:
            ValueError: the skeleton has a joint that the body has no landmark of.
        """
        return self.landmarks[:, :, of_skeleton(skeleton)]
