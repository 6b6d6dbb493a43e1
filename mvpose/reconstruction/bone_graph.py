"""Bones of a skeleton for the pictorial structure: those of its tree and their mirror images.

A kinematic tree cannot always be symmetric: that of COCO hangs the nose on the left shoulder. If its bones alone had a
prior, a pose would change when left and right are renamed. So the log-prior is the mean of those of the tree and of the
tree in the mirror: a bone whose mirror image is in the tree as well has its whole weight, and any other shares it with
its image. The nose is then held by both shoulders, each with half of the weight.

Both hips hang from their shoulders, and no bone of the tree says how far they are from each other: a hip that only one
view sees could lie a metre beside the other one. So the distance of the hips is one more bone.

The bones then form a graph with short cycles (both shoulders, and the nose or the hips). Inference stays exact: joints
are eliminated one after another, and each is joined to at most two of those that remain (tree-width 2; Bertele &
Brioschi, "Nonserial Dynamic Programming", 1972). On a tree this is the usual passing of messages from the leaves to the
root.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.skeleton import Skeleton

_SPANS = frozenset({"hip"})  # parts whose two sides keep their distance, beside those that the tree joins
_Ends = list[tuple[int, int]]  # parents and children of bones
_WIDTH = 2  # most joints that remain when a joint is eliminated and that it is joined to


class BoneGraph(NamedTuple):
    """Bones of a skeleton of J joints as arrays for the kernels.

    The first J of the B bones join each joint to its parent (the root has none: its bone joins nothing), and the rest
    are mirror images and the distance of the hips.
    """

    parents: Integers
    """Joint at the inner end of each bone, (B,), -1 for the bone of the root."""
    children: Integers
    """Joint at the outer end of each bone, (B,)."""
    share: Floats
    """Weight of the prior of each bone, (B,): 1, or 1/2 where the mirror image of a bone is not in the tree."""
    neighbours: Integers
    """Joints at the other ends of each joint's bones, (J, D), -1 where there are fewer."""
    bones: Integers
    """These bones, (J, D), -1 where there are fewer."""
    inner: Integers
    """Parent of each joint in the tree and in its mirror image, each once, (J, 2), -1 where there are fewer."""
    mate: Integers
    """Mirror counterpart of each joint if a bone joins the two, else the joint itself, (J,)."""
    visits: Integers
    """Joints from the outermost to the innermost, (J,), in an order that left and right share."""
    order: Integers
    """Joints in the order of elimination, (J,)."""
    later: Integers
    """Joints that are joined to each joint when it is eliminated, the first to be eliminated of them first, (J, 2), -1
    where there are fewer."""
    joint_bones: Integers
    """Bones that join each joint to these, (J, 2), -1 where none does."""


@cache
def bone_graph(skeleton: Skeleton) -> BoneGraph:
    """Return the graph of bones of a skeleton.

    Where the mirror images would make cycles too wide for exact inference, the graph is the tree alone.
    """
    tree = [(parent, child) for child, parent in enumerate(skeleton.parents)]
    images, across = mirror_images(skeleton), spans(skeleton)
    if elimination(len(skeleton), [*skeleton.edges, *images, *across]) is None:
        return _graph(skeleton, tree, [], [], tuple(range(len(skeleton))))
    return _graph(skeleton, tree, images, across, skeleton.mirror)


def mirror_images(skeleton: Skeleton) -> _Ends:
    """Return the mirror images (parent, child) of bones of the tree that are not in the tree."""
    known = {frozenset(bone) for bone in skeleton.edges}
    images = [(skeleton.mirror[parent], skeleton.mirror[child]) for parent, child in skeleton.edges]
    return [image for image in images if frozenset(image) not in known]


def spans(skeleton: Skeleton) -> _Ends:
    """Return the two sides of parts that keep their distance and hang from different joints of the tree."""
    return [
        (joint, other)
        for joint, other in enumerate(skeleton.mirror)
        if joint < other
        and skeleton.parts[joint] in _SPANS
        and len({skeleton.parents[joint], skeleton.parents[other], joint, other}) == 4
    ]


def _graph(skeleton: Skeleton, tree: _Ends, images: _Ends, across: _Ends, mirror: Sequence[int]) -> BoneGraph:
    joints, bones = len(skeleton), [*tree, *images, *across]
    known = {frozenset(bone): index for index, bone in enumerate(bones) if bone[0] >= 0}
    whole = [
        parent < 0 or not images or frozenset((mirror[parent], mirror[child])) in map(frozenset, tree)
        for parent, child in tree
    ]
    share = np.where([*whole, *(False for _ in images), *(True for _ in across)], 1.0, 0.5)
    ends: list[list[tuple[int, int]]] = [[] for _ in range(joints)]
    for index, (parent, child) in enumerate(bones):
        if parent >= 0:
            ends[child].append((parent, index))
            ends[parent].append((child, index))
    inner: list[list[int]] = [[] for _ in range(joints)]
    for joint, other in enumerate(mirror):
        parent, image = skeleton.parents[joint], skeleton.parents[other]
        for candidate in (parent, mirror[image] if image >= 0 else -1):
            if candidate >= 0 and candidate not in inner[joint]:
                inner[joint].append(candidate)
    mate = [other if frozenset((joint, other)) in known else joint for joint, other in enumerate(mirror)]
    depth = [_depth(skeleton, joint) for joint in range(joints)]
    visits = sorted(
        range(joints), key=lambda joint: (-min(depth[joint], depth[mirror[joint]]), min(joint, mirror[joint]), joint)
    )
    eliminated = elimination(joints, [bone for bone in bones if bone[0] >= 0])
    assert eliminated is not None  # a tree has width 1
    order, later = eliminated
    joint_bones = [[known.get(frozenset((joint, other)), -1) for other in later[joint]] for joint in range(joints)]
    parents, children = np.array(bones).T
    widest = max(map(len, ends))
    return BoneGraph(
        parents.copy(),
        children.copy(),
        share,
        _padded([[other for other, _ in each] for each in ends], widest),
        _padded([[bone for _, bone in each] for each in ends], widest),
        _padded(inner, _WIDTH),
        np.array(mate),
        np.array(visits),
        np.array(order),
        _padded(later, _WIDTH),
        _padded(joint_bones, _WIDTH),
    )


def elimination(joints: int, edges: Sequence[tuple[int, int]]) -> tuple[list[int], list[list[int]]] | None:
    """Return an order of elimination, and the joints that each joint is joined to at that time, in the same order.

    The joint with the fewest neighbours comes first; its neighbours are joined to each other when it is gone, which
    finds an order for every graph of tree-width 2. The result is None for a wider graph.
    """
    around: list[set[int]] = [set() for _ in range(joints)]
    for one, other in edges:
        around[one].add(other)
        around[other].add(one)
    order: list[int] = []
    left = set(range(joints))
    while left:
        joint = min(left, key=lambda each: (len(around[each]), each))
        if len(around[joint]) > _WIDTH:
            return None
        left.remove(joint)
        order.append(joint)
        for other in around[joint]:
            around[other] |= around[joint] - {other}
            around[other].remove(joint)
    return order, [sorted(around[joint], key=order.index) for joint in range(joints)]


def _depth(skeleton: Skeleton, joint: int) -> int:
    """Return the number of bones between a joint and the root."""
    parent = skeleton.parents[joint]
    return 0 if parent < 0 else 1 + _depth(skeleton, parent)


def _padded(rows: list[list[int]], width: int) -> Integers:
    """Return rows of different lengths as an array filled up by -1."""
    return np.array([[*row, *[-1] * (width - len(row))] for row in rows], np.int64).reshape(len(rows), width)
