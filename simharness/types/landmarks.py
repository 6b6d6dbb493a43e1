"""Which points of the body are its true joints: the 17 of COCO first, then what other skeletons have besides.

All are anatomical points of the body model; no head or neck is made from COCO's joints by a formula:

- the 17 of COCO: centres of joints and features of the face, as anny regresses them from its vertices;
- ``head_bottom``: on the axis of the neck at the level of the chin, halfway up the bone ``Neck`` (C7 to C4); the
  "bottom head" of Shelf and Campus;
- ``head_top``: the crown, the highest point of the bald skull; their "top head";
- ``neck``: the root of the neck, at the vertebra C7 (the bone ``Neck`` begins there); Panoptic's "Neck";
- ``mid_hip``: midway between the centres of the hip joints; Panoptic's "BodyCenter".
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mvpose.skeleton import COCO17, Skeleton

LANDMARKS: tuple[str, ...] = (*COCO17.joints, "head_bottom", "head_top", "neck", "mid_hip")
"""Names of the landmarks in the order of every array of them; the joints of COCO17 come first, in its order."""


@cache
def of_skeleton(skeleton: Skeleton) -> NDArray[np.intp]:
    """Where the joints of a skeleton are among the landmarks, (J,).

    Raises:
        ValueError: the skeleton has a joint that the body has no landmark of.
    """
    unknown = [joint for joint in skeleton.joints if joint not in LANDMARKS]
    if unknown:
        raise ValueError(
            f"skeleton {skeleton.name!r} has joints that the body has no landmark of: {', '.join(unknown)}; "
            f"take joints among {', '.join(LANDMARKS)}"
        )
    indices = np.array([LANDMARKS.index(joint) for joint in skeleton.joints])
    indices.flags.writeable = False
    return indices
