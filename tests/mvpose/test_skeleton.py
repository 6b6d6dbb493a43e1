import numpy as np
import pytest
from people import STANDING

from mvpose import COCO17, SHELF14, Skeleton
from mvpose.skeleton import coco17_to_shelf14


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14])
def test_mirror_swaps_left_and_right_and_nothing_else(skeleton):
    for joint, mirrored in enumerate(skeleton.mirror):
        swapped = skeleton.joints[joint].replace("left", "?").replace("right", "left").replace("?", "right")
        assert skeleton.joints[mirrored] == swapped
        assert skeleton.sigmas[joint] == skeleton.sigmas[mirrored]


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14])
def test_edges_join_all_joints(skeleton):
    assert len(skeleton.edges) == len(skeleton) - 1
    reached = {skeleton.parents.index(-1)}
    while True:
        more = reached | {c for p, c in skeleton.edges if p in reached}
        if more == reached:
            break
        reached = more
    assert len(reached) == len(skeleton)


def test_a_skeleton_that_is_no_tree_is_refused():
    with pytest.raises(ValueError, match="one tree"):
        Skeleton("loop", ("a", "b", "c"), (-1, 2, 1), (0, 1, 2), (0.1, 0.1, 0.1))


def test_limbs_map_by_name():
    mapped = coco17_to_shelf14(STANDING)
    for joint, name in enumerate(SHELF14.joints[:12]):
        np.testing.assert_array_equal(mapped[joint], STANDING[COCO17.index(name)])


def test_head_mappings_by_hand():
    joints = np.zeros((17, 3))
    joints[0] = [0.1, 0.0, 1.6]  # nose; mid-shoulder at the origin of x, y, height 1.4; ears at 1.65
    joints[3:5] = [[0.0, 0.08, 1.65], [0.0, -0.08, 1.65]]
    joints[5:7] = [[0.0, 0.2, 1.4], [0.0, -0.2, 1.4]]
    old = coco17_to_shelf14(joints, head="2019")
    np.testing.assert_allclose(old[12], [0.05, 0, 1.5])
    np.testing.assert_allclose(old[13], [0.075, 0, 1.7])
    new = coco17_to_shelf14(joints, head="voxelpose")
    np.testing.assert_allclose(new[12], 0.75 * old[12] + 0.25 * np.array([0, 0, 1.525]))
    np.testing.assert_allclose(new[13], 0.75 * old[13] + 0.25 * np.array([0, 0, 1.775]))
    with pytest.raises(ValueError, match="voxelpose"):
        coco17_to_shelf14(joints, head="2020")
