"""Limbs of skeletons as they are drawn, which differ from the tree of the pictorial structure."""

from __future__ import annotations

from collections.abc import Sequence

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
