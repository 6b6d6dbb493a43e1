from dataclasses import replace

import numpy as np
import pytest

from mvpose import COCO17, PANOPTIC19, SHELF14
from mvpose.reconstruction.bone_graph import bone_graph, elimination, mirror_images, spans
from mvpose.reconstruction.bone_length_prior import bone_lengths

SKELETONS = pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19], ids=lambda skeleton: skeleton.name)


def bones(graph):
    """Ends of the bones, in any direction, with their indices."""
    return {
        frozenset((int(parent), int(child))): bone
        for bone, (parent, child) in enumerate(zip(graph.parents, graph.children, strict=True))
        if parent >= 0
    }


@SKELETONS
def test_the_bones_are_those_of_the_tree_and_of_its_mirror_image(skeleton):
    graph, mirror = bone_graph(skeleton), skeleton.mirror
    known = bones(graph)
    assert set(known) >= {frozenset(bone) for bone in skeleton.edges}
    assert {frozenset(mirror[joint] for joint in bone) for bone in known} == set(known)
    assert sum(graph.share[bone] for bone in known.values()) == len(skeleton) - 1 + len(spans(skeleton))
    length, deviation = bone_lengths(skeleton)
    for ends, bone in known.items():
        image = known[frozenset(mirror[joint] for joint in ends)]
        for array in (graph.share, length, deviation):
            assert array[bone] == array[image]


@SKELETONS
def test_every_order_is_the_same_for_left_and_right(skeleton):
    graph, mirror = bone_graph(skeleton), np.array(skeleton.mirror)
    place = np.argsort(graph.visits)
    for one, other in bones(graph):
        if mirror[one] != other:  # the two are visited in the order of their images
            assert (place[one] < place[other]) == (place[mirror[one]] < place[mirror[other]])
        else:
            assert graph.mate[one] == other
    for joint, inner in enumerate(graph.inner):
        images = {int(mirror[other]) for other in inner if other >= 0}
        assert images == {int(other) for other in graph.inner[mirror[joint]] if other >= 0}


def test_the_nose_hangs_from_both_shoulders():
    graph = bone_graph(COCO17)
    nose = COCO17.index("nose")
    held = [COCO17.joints[other] for other in graph.inner[nose]]
    assert held == ["left_shoulder", "right_shoulder"]
    assert mirror_images(PANOPTIC19) == []  # hangs from the neck


def test_hips_keep_their_distance_where_the_tree_does_not_join_them():
    assert [[COCO17.joints[joint] for joint in ends] for ends in spans(COCO17)] == [["left_hip", "right_hip"]]
    assert len(spans(SHELF14)) == 1
    assert spans(PANOPTIC19) == []  # both hang from the middle of the hips


def test_elimination_leaves_no_bone_out():
    order, later = elimination(4, [(0, 1), (1, 2), (2, 3), (3, 0)])  # a cycle
    place = {joint: index for index, joint in enumerate(order)}
    assert sorted(order) == [0, 1, 2, 3]
    joined = {frozenset((joint, other)) for joint in range(4) for other in later[joint]}
    assert joined >= {frozenset(edge) for edge in [(0, 1), (1, 2), (2, 3), (3, 0)]}
    assert all(place[other] > place[joint] for joint in range(4) for other in later[joint])
    assert elimination(4, [(a, b) for a in range(4) for b in range(a)]) is None  # all joined to all: width 3


def test_a_skeleton_whose_mirror_image_makes_wide_cycles_keeps_its_tree():
    """A chain through both sides in an order that has nothing to do with the body."""
    order = np.random.default_rng(2).permutation(17)
    parents = np.full(17, -1)
    parents[order[1:]] = order[:-1]
    chain = replace(COCO17, name="chain", parents=tuple(parents))
    assert elimination(17, [*chain.edges, *mirror_images(chain)]) is None
    graph = bone_graph(chain)
    assert set(bones(graph)) == {frozenset(bone) for bone in chain.edges}
    assert (graph.share == 1).all()
