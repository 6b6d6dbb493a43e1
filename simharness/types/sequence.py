"""Sequence: true landmarks of all people in all frames.

Landmarks define the true joints: the 17 of COCO, then additional joints of other skeletons. All are anatomical points
of the body model; head and neck are not computed from COCO joints:

- the 17 of COCO: centres of joints and features of the face, as anny regresses them from its vertices;
- ``head_bottom``: on the axis of the neck at the level of the chin, halfway up the bone ``Neck`` (C7 to C4);
  "bottom head" in Shelf and Campus;
- ``head_top``: the crown, the highest point of the skull without hair; "top head" in Shelf and Campus;
- ``neck``: the root of the neck, at the vertebra C7, where the bone ``Neck`` begins; "Neck" in Panoptic;
- ``mid_hip``: midway between the centres of the hip joints; "BodyCenter" in Panoptic.
"""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import as_array
from mvpose.skeleton import COCO17, Skeleton

LANDMARKS: tuple[str, ...] = (*COCO17.joints, "head_bottom", "head_top", "neck", "mid_hip")
"""Names of the landmarks in the order of all landmark arrays; the joints of COCO17 come first, in its order."""


@dataclass(frozen=True)
class Sequence:
    """Ground truth of T frames with P people; P may be 0.

    Raises:
        ValueError: a wrong shape or a value that is not finite.
    """

    landmarks: Floats
    """Positions of ``simharness.types.sequence.LANDMARKS`` in the world, (T, P, L, 3), metres; finite in all frames: an
    absent person waits somewhere outside of the scene."""
    ids: Integers
    """Numbers of the people, (P,) int."""
    time: Floats
    """Times of the frames, (T,), seconds."""
    present: Bools = field(default_factory=lambda: np.zeros((0, 0), bool))
    """Who is in the scene in each frame, (T, P); by default everyone in all frames."""

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


@cache
def of_skeleton(skeleton: Skeleton) -> NDArray[np.intp]:
    """Return the landmark index of each joint of a skeleton, (J,).

    Raises:
        ValueError: the skeleton has a joint for which the body has no landmark.
    """
    unknown = [joint for joint in skeleton.joints if joint not in LANDMARKS]
    if unknown:
        raise ValueError(
            f"skeleton {skeleton.name!r} has joints for which the body has no landmark: {', '.join(unknown)}; "
            f"expected joints among {', '.join(LANDMARKS)}"
        )
    indices = np.array([LANDMARKS.index(joint) for joint in skeleton.joints])
    indices.flags.writeable = False
    return indices
