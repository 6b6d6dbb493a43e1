"""What the simulation knows: where every joint and bone of every person is in every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array


@dataclass(frozen=True)
class Sequence:
    """The truth about T frames of P people; P may be 0.

    Attributes:
        joints: COCO-17 joints in the world, (T, P, 17, 3), metres.
        ids: the people's numbers, (P,) int.
        time: seconds, (T,).
        bones: skinning transforms, rest pose to world, (T, P, B, 3, 4); what rendering needs.

    Raises:
        ValueError: a wrong shape or a value that is not finite.
    """

    joints: NDArray[np.float64]
    ids: NDArray[np.int64]
    time: NDArray[np.float64]
    bones: NDArray[np.float64]

    def __post_init__(self) -> None:
        time = as_array(self.time, ("T",), "sequence time")
        ids = as_array(self.ids, ("P",), "sequence ids", np.int64)
        joints = as_array(self.joints, (len(time), len(ids), 17, 3), "sequence joints")
        bones = as_array(self.bones, (len(time), len(ids), "B", 3, 4), "sequence bones")
        for key, value in (("joints", joints), ("ids", ids), ("time", time), ("bones", bones)):
            if not np.isfinite(value).all():
                raise ValueError(f"sequence {key} must be finite: the truth is never missing")
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(self.time)
