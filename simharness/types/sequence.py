"""Sequence: true landmarks of all people in all frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array
from mvpose.skeleton import COCO17, Skeleton
from simharness.types.landmarks import LANDMARKS, of_skeleton


@dataclass(frozen=True)
class Sequence:
    """Ground truth of T frames with P people; P may be 0.

    Attributes:
        landmarks: positions of ``simharness.types.landmarks.LANDMARKS`` in the world, (T, P, L, 3), metres; finite in
            all frames: an absent person waits somewhere outside of the scene.
        ids: numbers of the people, (P,) int.
        time: times of the frames, (T,), seconds.
        present: who is in the scene in each frame, (T, P); by default everyone in all frames.

    Raises:
        ValueError: a wrong shape or a value that is not finite.
    """

    landmarks: Floats
    ids: NDArray[np.int64]
    time: Floats
    present: Bools = field(default_factory=lambda: np.zeros((0, 0), bool))

    def __post_init__(self) -> None:
        time = as_array(self.time, ("T",), "sequence time")
        ids = as_array(self.ids, ("P",), "sequence ids", np.int64)
        landmarks = as_array(self.landmarks, (len(time), len(ids), len(LANDMARKS), 3), "sequence landmarks")
        for key, value in (("landmarks", landmarks), ("ids", ids), ("time", time)):
            if not np.isfinite(value).all():
                raise ValueError(f"sequence {key} must be finite: no true value may be missing")
            object.__setattr__(self, key, value)
        present = self.present if np.size(self.present) else np.ones(landmarks.shape[:2], bool)
        object.__setattr__(self, "present", as_array(present, landmarks.shape[:2], "sequence present", np.bool_))

    def __len__(self) -> int:
        return len(self.time)

    @property
    def joints(self) -> Floats:
        """COCO-17 joints in the world, (T, P, 17, 3), metres; finite even where a person is absent."""
        return self.landmarks[:, :, : len(COCO17)]

    def of_skeleton(self, skeleton: Skeleton) -> Floats:
        """Return the joints of a skeleton in the world, (T, P, J, 3), metres; NaN where a person is absent.

        They are landmarks, not computed from COCO joints.

        Raises:
            ValueError: the skeleton has a joint for which the body has no landmark.
        """
        return np.where(self.present[..., None, None], self.landmarks[:, :, of_skeleton(skeleton)], np.nan)
