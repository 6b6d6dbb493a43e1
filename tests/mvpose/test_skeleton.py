import numpy as np
import pytest
from people import STANDING

from mvpose import COCO17, PANOPTIC19, SHELF14, Skeleton
from mvpose.skeleton import coco17_to_shelf14


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19])
def test_mirror_swaps_left_and_right_and_nothing_else(skeleton):
    for joint, mirrored in enumerate(skeleton.mirror):
        swapped = skeleton.joints[joint].replace("left", "?").replace("right", "left").replace("?", "right")
        assert skeleton.joints[mirrored] == swapped
        assert skeleton.sigmas[joint] == skeleton.sigmas[mirrored]


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19])
def test_edges_join_all_joints(skeleton):
    assert len(skeleton.edges) == len(skeleton) - 1
    reached = {skeleton.parents.index(-1)}
    while True:
        more = reached | {c for p, c in skeleton.edges if p in reached}
        if more == reached:
            break
        reached = more
    assert len(reached) == len(skeleton)


BAD = {
    "a loop": ({"parents": (-1, 2, 1)}, "must form one tree"),
    "two roots": ({"parents": (-1, -1, 0)}, r"must have one root \(-1\)"),
    "a joint that is not there": ({"parents": (-1, 0, 3)}, "joint indices below 3"),
    "a parent short": ({"parents": (-1, 0)}, "parents must have 3 entries, got 2"),
    "one name twice": ({"joints": ("a", "b", "b")}, "joints must be one or more different names"),
    "no joints": ({"joints": ()}, "joints must be one or more different names"),
    "a mirror of one side": ({"mirror": (0, 2, 2)}, r"mirror must hold pairs .*; 'b' \(1\) has 2"),
    "a mirror beyond": ({"mirror": (0, 1, 5)}, r"'c' \(2\) has 5"),
    "a sigma of zero": ({"sigmas": (0.1, 0.0, 0.1)}, "sigmas must be positive"),
    "a sigma unknown": ({"sigmas": (0.1, float("nan"), 0.1)}, "sigmas must be positive"),
}


@pytest.mark.parametrize("name", BAD)
def test_an_invalid_skeleton_is_refused(name):
    changes, message = BAD[name]
    good = {"joints": ("a", "b", "c"), "parents": (-1, 0, 1), "mirror": (0, 2, 1), "sigmas": (0.1, 0.1, 0.1)}
    assert len(Skeleton("limb", **good)) == 3
    with pytest.raises(ValueError, match=message) as error:
        Skeleton("limb", **{**good, **changes})
    assert "skeleton 'limb'" in str(error.value)


def test_panoptic_is_in_the_order_of_its_files():
    """joints19 of the CMU Panoptic dataset: checks of the published order, and equal sigmas for each kind of joint."""
    order = {
        0: "neck",
        1: "nose",
        2: "mid_hip",
        5: "left_wrist",
        8: "left_ankle",
        9: "right_shoulder",
        14: "right_ankle",
    }
    order |= {15: "left_eye", 16: "left_ear", 17: "right_eye", 18: "right_ear"}
    assert {i: PANOPTIC19.joints[i] for i in order} == order
    for joint in set(PANOPTIC19.joints) & set(COCO17.joints):
        assert PANOPTIC19.sigmas[PANOPTIC19.index(joint)] == COCO17.sigmas[COCO17.index(joint)]


def test_a_skeleton_can_be_made_from_lists():
    lists = {key: list(getattr(SHELF14, key)) for key in ("joints", "parents", "mirror", "sigmas")}
    assert Skeleton("shelf14", **lists) == SHELF14
    assert hash(Skeleton("shelf14", **lists)) == hash(SHELF14)


def test_oks_variances_are_those_of_coco():
    """A keypoint off by 2 sigma sqrt(area) has a similarity of exp(-1/2) (the definition, cocodataset.org)."""
    assert COCO17.variances[COCO17.index("left_hip")] == pytest.approx((2 * 0.107) ** 2)
    assert not COCO17.variances.flags.writeable


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
    for shape in [(14, 3), (17, 2), (17,), ()]:
        with pytest.raises(ValueError, match=r"joints must be \(\.\.\., (17, )?3\)"):
            coco17_to_shelf14(np.zeros(shape))
