"""Tree of parts of bottom-up detectors: a joint is joined to its person along the limb that leads to it.

A wrist hangs on the elbow, the elbow on the shoulder; an ankle on the knee, the knee on the hip. In every set of
detections of OpenPose and RTPose looked at, no joint is reported whose parent is not. The joints of the face are found
independently of each other.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Bools

PARENT = np.array([-1, -1, -1, -1, -1, -1, -1, 5, 6, 7, 8, -1, -1, 11, 12, 13, 14])
"""Parent of each COCO-17 joint in the tree of parts, (17,); -1 without a parent. Parents come before children."""

IN_TREE = np.arange(len(PARENT)) >= 5
"""Which COCO-17 joints belong to the tree, (17,): those of the limbs."""


def with_parents(reported: Bools) -> Bools:
    """Return which of the reported joints (..., 17) remain when each needs its parent, (..., 17)."""
    result = reported.copy()
    for joint in np.flatnonzero(PARENT >= 0):
        result[..., joint] &= result[..., PARENT[joint]]
    return result
