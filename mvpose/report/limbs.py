"""Limbs of skeletons as they are drawn, which differ from the tree of the pictorial structure."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17, Skeleton

Edges = Sequence[tuple[int, int]]

# Both sides of the trunk, and no line through it.
COCO17_FACE: Edges = ((0, 1), (0, 2), (1, 3), (2, 4))
COCO17_BODY: Edges = (
    *((5, 6), (5, 11), (6, 12), (11, 12)),  # trunk
    *((5, 7), (7, 9), (6, 8), (8, 10)),  # arms
    *((11, 13), (13, 15), (12, 14), (14, 16)),  # legs
)
COCO17_LIMBS: Edges = (*COCO17_FACE, *COCO17_BODY)

_FACE = COCO17.joints[:5]
SMALL_FACE = 30.0
"""Extent in pixels of a picture 600 pixels high under which the dots of a face run into one patch."""


def face_of(skeleton: Skeleton) -> list[int]:
    """Return the joints of the face: nose, eyes, ears, and numbered points (``face_0``, ...)."""
    return [k for k, joint in enumerate(skeleton.joints) if joint in _FACE or joint.startswith("face_")]


def plain_face(joints: ArrayLike, *, least: float, face: Sequence[int] = tuple(range(len(_FACE)))) -> Floats:
    """Return a person's joints, (J, 2) pixels, with a plain face where it is small.

    The dots of a face that spans less than ``least`` pixels run into one patch. Of such a face only the joint
    nearest to the middle stays.

    Args:
        joints: pixels; NaN for a joint that is not known.
        least: extent of a face that is drawn whole, pixels.
        face: joints of the face (:func:`face_of`); by default those of COCO17.
    """
    joints = np.array(joints, float)
    points = joints[list(face)]
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(known) < 2 or float(np.ptp(points[known], axis=0).max()) >= least:
        return joints
    middle = known[np.linalg.norm(points[known] - points[known].mean(axis=0), axis=1).argmin()]
    joints[[face[k] for k in known.tolist() if k != middle]] = np.nan
    return joints


def limbs_of(skeleton: Skeleton) -> Edges:
    """Return the limbs of a skeleton: those of COCO17 by the names of joints, and bones of the tree to other joints.

    A bone from one side of the body to a joint on its midline is left out: it stands in the tree of SHELF14 and COCO17
    only because a tree needs it.
    """
    names = [(COCO17.joints[a], COCO17.joints[b]) for a, b in COCO17_LIMBS]
    named = [(skeleton.index(a), skeleton.index(b)) for a, b in names if {a, b} <= set(skeleton.joints)]
    reached = {joint for limb in named for joint in limb}
    others = [
        (parent, child)
        for parent, child in skeleton.edges
        if child not in reached and not (skeleton.mirror[parent] != parent and skeleton.mirror[child] == child)
    ]
    return (*named, *others)
