import re

import numpy as np
import pytest

from mvpose import COCO17, SHELF14
from mvpose.formats.joint_names import KNOWN, JointNames, canonical, known_skeleton, to_coco17, to_shelf14
from mvpose.skeleton import PANOPTIC19, coco17_to_shelf14


@pytest.mark.parametrize("name", ["LHip", "l_hip", "leftHip", "hip_left", "Left hip", "Subject:LHip", "LEFT-HIP"])
def test_a_joint_has_one_name_however_it_is_written(name):
    assert canonical(name) == "left_hip"


def test_our_names_are_canonical():
    for joint in {*COCO17.joints, *SHELF14.joints, *PANOPTIC19.joints}:
        assert canonical(joint) == joint


def test_other_markers_keep_apart():
    assert canonical("LHJC") == "lhjc"
    assert canonical("RBigToe") == "right_big_toe"


@pytest.mark.parametrize("name", KNOWN)
def test_known_skeletons_have_as_many_different_joints_as_their_name_says(name):
    count = int(re.search(r"(\d+)b?$", name)[1])
    assert len(KNOWN[name]) == len(set(KNOWN[name].joints)) == count


def test_skeletons_are_known_by_several_spellings():
    assert known_skeleton("BODY_25") is known_skeleton("body25")
    with pytest.raises(ValueError, match="no skeleton 'coco71' is known; did you mean coco1"):
        known_skeleton("coco71")


class TestTo2D:
    def test_joints_are_found_by_name_in_any_order(self):
        random = np.random.default_rng(3)
        order = random.permutation(17)
        keypoints, scores = random.uniform(0, 100, (4, 17, 2)), random.uniform(0.1, 1, (4, 17))
        names = JointNames("mixed", tuple(COCO17.joints[k] for k in order))
        got = to_coco17(keypoints[:, order], scores[:, order], names)
        np.testing.assert_array_equal(got[0], keypoints)
        np.testing.assert_array_equal(got[1], scores)

    def test_what_the_skeleton_lacks_is_missing_and_scores_are_clipped(self):
        names = JointNames("two", ("nose", "tail"))
        keypoints, scores = to_coco17(np.ones((1, 2, 2)), np.array([[1.2, 0.9]]), names)
        assert scores[0, 0] == 1.0
        assert (scores[0, 1:] == 0).all()
        assert np.isnan(keypoints[0, 1:]).all()
        assert np.isfinite(keypoints[0, 0]).all()

    @pytest.mark.parametrize("score", [0.0, -0.1, np.nan])
    def test_no_score_is_missing(self, score):
        keypoints, scores = to_coco17(np.ones((1, 1, 2)), np.array([[score]]), JointNames("one", ("nose",)))
        assert scores[0, 0] == 0
        assert np.isnan(keypoints[0, 0]).all()

    def test_a_skeleton_of_other_joints_is_refused(self):
        with pytest.raises(ValueError, match="skeleton toes has no joint of COCO17: it has big_toe"):
            to_coco17(np.ones((1, 1, 2)), np.ones((1, 1)), JointNames("toes", ("big_toe",)))


class TestTo3D:
    @pytest.mark.parametrize("head", ["voxelpose", "2019"])
    def test_a_head_is_computed_by_the_rule_of_the_protocol(self, head):
        joints = np.random.default_rng(1).normal(size=(3, 2, 17, 3))
        for names in (KNOWN["coco17"], JointNames("reversed", COCO17.joints[::-1])):
            given = joints if names is KNOWN["coco17"] else joints[:, :, ::-1]
            np.testing.assert_array_equal(to_shelf14(given, names, head=head), coco17_to_shelf14(joints, head=head))

    def test_a_named_head_is_taken_as_it_is(self):
        joints = np.random.default_rng(2).normal(size=(5, 14, 3))
        np.testing.assert_array_equal(to_shelf14(joints, KNOWN["shelf14"]), joints)

    def test_without_face_the_head_is_undefined(self):
        joints = np.random.default_rng(2).normal(size=(5, 12, 3))
        got = to_shelf14(joints, JointNames("limbs", SHELF14.joints[:12]))
        np.testing.assert_array_equal(got[:, :12], joints)
        assert np.isnan(got[:, 12:]).all()


class TestMap:
    names = JointNames("markers", ("LHJC", "RHJC", "left_knee", "Tail"))

    def test_their_names_become_ours(self):
        renamed = self.names.renamed({"left_hip": "LHJC", "right_hip": "RHJC"})
        assert renamed.rows(("left_hip", "right_hip", "left_knee", "nose")).tolist() == [0, 1, 2, -1]

    def test_another_joint_takes_our_name(self):
        assert self.names.renamed({"left_knee": "Tail"}).rows(("left_knee",)).tolist() == [3]

    def test_unknown_names_are_refused(self):
        with pytest.raises(ValueError, match="no joint 'left_hipp' in COCO17 or SHELF14; did you mean left_hip"):
            self.names.renamed({"left_hipp": "LHJC"})
        with pytest.raises(ValueError, match="skeleton markers has no joint 'LHJX'; did you mean LHJC"):
            self.names.renamed({"left_hip": "LHJX"})
