"""Landmarks of the body that define its true joints: the 17 of COCO, then additional joints of other skeletons.

All are anatomical points of the body model; head and neck are not computed from COCO joints:

- the 17 of COCO: centres of joints and features of the face, as anny regresses them from its vertices;
- ``head_bottom``: on the axis of the neck at the level of the chin, halfway up the bone ``Neck`` (C7 to C4);
  "bottom head" in Shelf and Campus;
- ``head_top``: the crown, the highest point of the skull without hair; "top head" in Shelf and Campus;
- ``neck``: the root of the neck, at the vertebra C7, where the bone ``Neck`` begins; "Neck" in Panoptic;
- ``mid_hip``: midway between the centres of the hip joints; "BodyCenter" in Panoptic.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mvpose.skeleton import COCO17, Skeleton

LANDMARKS: tuple[str, ...] = (*COCO17.joints, "head_bottom", "head_top", "neck", "mid_hip")
"""Names of the landmarks in the order of all landmark arrays; the joints of COCO17 come first, in its order."""


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
