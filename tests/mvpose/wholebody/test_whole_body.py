"""Hands, face and feet: the body stays the same to the bit, the rest lies where it is; skeletons from TOML files."""

import pickle
import time

import numpy as np
import pytest
from people import ring
from whole_people import seen, standing

import mvpose
from mvpose import COCO17, SHELF14, Detections, Estimate, Skeleton
from mvpose.estimators import SequenceEstimator
from mvpose.skeleton import Skeleton as _Skeleton
from mvpose.wholebody import SKELETONS, body_part, read_skeleton, skeleton_by_name, whole_body, with_body_boxes

EXACT = ("joints", "scores", "covariance", "freedom", "ids")


def body_alone(detections):
    """The detections as they would be if the detector had only COCO17."""
    rows = [detections.skeleton.joints.index(joint) for joint in COCO17.joints]
    return Detections.from_keypoints(detections.view, detections.keypoints[:, rows], detections.scores[:, rows])


def same(one, other):
    for key in EXACT:
        a, b = getattr(one, key), getattr(other, key)
        assert (a is None) == (b is None), key
        if a is not None:
            rows = slice(None) if a.shape[1:] == b.shape[1:] else None
            np.testing.assert_array_equal(a[rows] if rows else a, b, err_msg=key)


def on_body(estimate, skeleton):
    """The part of an estimate on COCO17."""
    rows = [skeleton.joints.index(joint) for joint in COCO17.joints]
    parts = (None if each is None else each[:, rows] for each in (estimate.covariance, estimate.freedom))
    covariance, freedom = parts
    return Estimate(
        estimate.joints[:, rows], estimate.scores[:, rows], estimate.matching, covariance, {}, freedom, estimate.ids
    )


# Rows in Pose2Sim's skeletons.py: right and left shoulder, elbow, wrist, hip, knee, ankle; toes and heels; others.
# Hands of BODY_135 are from poseParameters.cpp of OpenPose: 20 points each, from row 25 and 45, then the face.
PUBLISHED = [
    ("body25", "2 3 4 9 10 11 5 6 7 12 13 14", "22 23 24 19 20 21", {"nose": 0, "neck": 1, "mid_hip": 8}),
    ("body25b", "6 8 10 12 14 16 5 7 9 11 13 15", "22 23 24 19 20 21", {"nose": 0, "neck": 17, "head": 18}),
    ("body135", "6 8 10 12 14 16 5 7 9 11 13 15", "22 23 24 19 20 21",
     {"neck": 17, "head": 18, "left_hand_1": 25, "right_hand_1": 45, "face_0": 65, "face_69": 134}),
    ("halpe26", "6 8 10 12 14 16 5 7 9 11 13 15", "21 23 25 20 22 24", {"head": 17, "neck": 18, "hip": 19}),
    ("halpe68", "6 8 10 12 14 16 5 7 9 11 13 15", "21 23 25 20 22 24",
     {"left_hand_2": 28, "left_hand_5": 31, "left_hand_17": 43, "right_hand_2": 49, "right_hand_17": 64}),
    ("halpe136", "6 8 10 12 14 16 5 7 9 11 13 15", "21 23 25 20 22 24",
     {"left_hand_2": 96, "left_hand_5": 99, "left_hand_17": 111, "right_hand_2": 117, "right_hand_17": 132}),
    ("wholebody133", "6 8 10 12 14 16 5 7 9 11 13 15", "20 21 22 17 18 19",
     {"face_0": 23, "left_hand_2": 93, "left_hand_17": 108, "right_hand_5": 117, "right_hand_17": 129}),
    ("blazepose33", "12 14 16 24 26 28 11 13 15 23 25 27", "30 29",
     {"nose": 0, "right_eye": 5, "left_pinky": 17, "right_index": 20, "left_foot_index": 31}),
    ("coco18", "2 3 4 8 9 10 5 6 7 11 12 13", "", {"nose": 0, "neck": 1}),
    ("mpii15", "2 3 4 8 9 10 5 6 7 11 12 13", "", {"head_bottom": 1, "chest": 14}),
]  # fmt: skip


class TestSkeletons:
    @pytest.mark.parametrize(("name", "limbs", "feet", "others"), PUBLISHED)
    def test_joints_are_in_the_order_of_the_detectors(self, name, limbs, feet, others):
        skeleton = skeleton_by_name(name)
        ends = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        found = [skeleton.index(f"{side}_{end}") for side in ("right", "left") for end in ends]
        assert found == [int(each) for each in limbs.split()]
        toes = [f"{side}_{end}" for side in ("right", "left") for end in ("big_toe", "small_toe", "heel")]
        assert [skeleton.index(joint) for joint in toes if joint in skeleton.joints] == [int(k) for k in feet.split()]
        assert {joint: skeleton.index(joint) for joint in others} == others

    @pytest.mark.parametrize("name", SKELETONS)
    def test_sides_mirror_each_other_and_every_joint_hangs_on_its_own_side(self, name):
        skeleton = skeleton_by_name(name)
        for row, joint in enumerate(skeleton.joints):
            side, _, part = joint.partition("_")
            if side in ("left", "right"):
                other = {"left": "right", "right": "left"}[side]
                assert skeleton.joints[skeleton.mirror[row]] == f"{other}_{part}"
                parent = skeleton.joints[skeleton.parents[row]] if skeleton.parents[row] >= 0 else ""
                assert not parent.startswith(other) or joint == "right_shoulder"

    def test_sizes_and_sigmas_as_published(self):
        whole = skeleton_by_name("wholebody133")
        assert [len(skeleton_by_name(name)) for name in SKELETONS] == [25, 26, 137, 133, 25, 135, 68, 136, 18, 15, 33]
        assert whole.sigmas[:17] == COCO17.sigmas
        # Sums of myeval_wholebody.py of COCO-WholeBody: feet, face, a hand.
        sums = [sum(whole.sigmas[a:b]) for a, b in ((17, 23), (23, 91), (91, 112), (112, 133))]
        np.testing.assert_allclose(sums, [0.480, 1.137, 0.553, 0.553], atol=5e-4)

    def test_the_mirror_of_the_face_keeps_its_parts(self):
        whole = skeleton_by_name("wholebody133")
        face = whole.index("face_0")
        parts = [range(17), range(17, 27), range(27, 31), range(31, 36), range(36, 48), range(48, 60), range(60, 68)]
        for part in parts:  # contour, brows, bridge and base of the nose, eyes, outer and inner lips
            assert {whole.mirror[face + k] - face for k in part} == set(part)

    def test_a_skeleton_of_a_user(self, tmp_path):
        file = tmp_path / "mine.toml"
        file.write_text(
            'name = "mine"\n[joints]\nleft_shoulder = {}\nright_shoulder = {}\n'
            'cap = { parent = "left_shoulder", sigma = 0.05 }\n'
            'left_tip = { parent = "left_shoulder", sigma = 1e-1 }\n'
            'right_tip = { parent = "right_shoulder", sigma = 0.1 }\n'
        )
        wanted = ("left_shoulder", "right_shoulder", "cap", "left_tip", "right_tip")
        expected = _Skeleton("mine", wanted, (-1, 0, 0, 0, 1), (1, 0, 2, 4, 3), (0.079, 0.079, 0.05, 0.1, 0.1))
        assert read_skeleton(file) == expected

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("name = 3", "expected a skeleton"),
            ('name = "x"\njoints = 4', "expected a skeleton"),
            ('name = "x"\n[joints]\ntoe = { sigma = 0.1 }', "joints.toe: needs parent, because it is no"),
            ('name = "x"\n[joints]\ntoe = { parent = "", sigma = "wide" }', "joints.toe: sigma must be a number"),
            ('name = "x"\n[joints]\ntoe = { parent = "", sigma = 0 }', "sigmas must be positive"),
            ('name = "x"\n[joints]\ntoe = { parent = "foot", sigma = 1 }', "joints.toe: parent 'foot' is no joint"),
            ('name = "x"\n[joints]\nleft_toe = { parent = "", sigma = 1 }', "mirror 'right_toe' is no joint"),
            ('name = "x"\n[joints]\ntoe = { up = 1 }', "joints.toe: expected a table with parent, sigma, mirror"),
            ("name = ", "no TOML"),
        ],
    )
    def test_a_wrong_file_is_named_with_its_joint(self, tmp_path, text, message):
        file = tmp_path / "wrong.toml"
        file.write_text(text)
        with pytest.raises(ValueError, match=f"wrong.toml: .*{message}"):
            read_skeleton(file)

    def test_unknown_names_and_missing_files(self, tmp_path):
        with pytest.raises(ValueError, match="unknown skeleton 'coco133'; expected one of body25"):
            skeleton_by_name("coco133")
        with pytest.raises(ValueError, match=r"none\.toml"):
            read_skeleton(tmp_path / "none.toml")


class TestBody:
    @pytest.mark.parametrize("preset", ["full", "fast", "no-matching"])
    @pytest.mark.parametrize("name", ["wholebody133", "body25"])
    def test_it_is_the_same_to_the_bit_with_and_without_other_joints(self, preset, name):
        skeleton, rig = skeleton_by_name(name), ring(4)
        detections, _ = seen(rig, standing(skeleton), skeleton)
        alone = mvpose.preset(preset).estimate(rig, body_alone(detections))
        whole = whole_body(mvpose.preset(preset)).estimate(rig, detections)
        assert len(alone) == 3
        same(on_body(whole, skeleton), alone)
        np.testing.assert_array_equal(whole.matching.labels, alone.matching.labels)

    def test_tracks_are_the_same_to_the_bit(self):
        skeleton, rig = skeleton_by_name("halpe26"), ring(4)
        frames = [seen(rig, standing(skeleton, shift=0.02 * k), skeleton, seed=k)[0] for k in range(12)]
        tracker = mvpose.preset("track-fast")
        alone = list(tracker.track(rig, map(body_alone, frames)))
        whole = list(whole_body(tracker).track(rig, iter(frames)))
        assert isinstance(whole_body(tracker), SequenceEstimator)
        assert not isinstance(whole_body(mvpose.preset("fast")), SequenceEstimator)
        assert len(whole) == len(alone) == 12
        for one, other in zip(whole, alone, strict=True):
            same(on_body(one, skeleton), other)
            assert one.time == other.time
        truth = standing(skeleton, shift=0.02 * 8)
        toe = skeleton.index("left_big_toe")
        nearest = np.linalg.norm(whole[8].joints[:, None, toe] - truth[None, :, toe], axis=-1).min(axis=1)
        assert nearest.max() < 0.03  # of the pictures of this frame, not of a later one

    def test_detections_on_coco17_pass_through(self):
        rig = ring(4)
        detections = body_alone(seen(rig, standing(skeleton_by_name("body25")), skeleton_by_name("body25"))[0])
        assert body_part(detections) is detections
        pipeline = mvpose.preset("fast")
        same(whole_body(pipeline).estimate(rig, detections), pipeline.estimate(rig, detections))


class TestOtherJoints:
    @pytest.mark.parametrize("name", SKELETONS)
    def test_they_are_where_they_are_without_noise(self, name):
        skeleton, rig = skeleton_by_name(name), ring(5)
        joints = standing(skeleton)
        detections, person = seen(rig, joints, skeleton, noise=0.0)
        estimate = whole_body(mvpose.preset("fast")).estimate(rig, detections)
        assert estimate.joints.shape == joints.shape
        for row in range(3):
            (true,) = set(person[estimate.matching.labels == row])
            np.testing.assert_allclose(estimate.joints[row], joints[true], atol=2e-3)

    def test_covariances_are_as_large_as_the_errors(self):
        skeleton, rig = skeleton_by_name("wholebody133"), ring(5)
        joints = standing(skeleton)
        squares, shares = [], []
        for seed in range(6):
            detections, person = seen(rig, joints, skeleton, noise=2.0, seed=seed)
            estimate = whole_body(mvpose.preset("fast")).estimate(rig, detections)
            for row in range(len(estimate)):
                true = person[np.flatnonzero(estimate.matching.labels == row)[0]]
                error = estimate.joints[row, 17:] - joints[true, 17:]
                inverse = np.linalg.inv(estimate.covariance[row, 17:])
                squares.append(np.einsum("ji,jik,jk->j", error, inverse, error))
                shares.append(np.isfinite(error).all())
        assert np.mean(shares) > 0.9
        assert 0.3 < np.nanmedian(squares) / 2.366 < 1.5  # the median of chi-square with 3 degrees; cautious, not bold

    def test_a_joint_in_one_view_is_missing_and_its_score_is_0(self):
        skeleton, rig = skeleton_by_name("halpe26"), ring(4)
        detections, _ = seen(rig, standing(skeleton), skeleton)
        scores, toe = detections.scores.copy(), skeleton.index("right_small_toe")
        scores[detections.view > 0, toe] = 0.0
        fewer = with_body_boxes(detections.view, detections.keypoints, scores, skeleton=skeleton)
        estimate = whole_body(mvpose.preset("fast")).estimate(rig, fewer)
        assert np.isnan(estimate.joints[:, toe]).all()
        assert (estimate.scores[:, toe] == 0).all()
        assert np.isfinite(estimate.joints[:, toe - 1]).all()

    def test_nobody(self):
        skeleton, rig = skeleton_by_name("halpe26"), ring(3)
        estimate = whole_body(mvpose.preset("full")).estimate(rig, Detections.empty(skeleton))
        assert estimate.joints.shape == (0, 26, 3)
        assert pickle.loads(pickle.dumps(estimate)).covariance.shape == (0, 26, 3, 3)

    def test_time_of_a_frame_with_hands_and_faces(self):
        """Five views of four people: far below the time of a frame at 25 Hz, even on a busy machine."""
        skeleton, rig = skeleton_by_name("wholebody133"), ring(5)
        detections, _ = seen(rig, standing(skeleton, 4), skeleton)
        estimator = whole_body(mvpose.preset("fast"))
        estimator.estimate(rig, detections)
        taken = []
        for _ in range(20):
            start = time.process_time()
            estimator.estimate(rig, detections)
            taken.append(time.process_time() - start)
        assert estimator.estimate(rig, detections).timings["whole body"] < 0.04
        assert min(taken) < 0.01

    @pytest.mark.parametrize("skeleton", [Skeleton("odd", ("cap", "heel"), (-1, 0), (0, 1), (0.1, 0.1))])
    def test_a_skeleton_without_a_body_is_refused(self, skeleton):
        detections = Detections.from_keypoints([0], np.zeros((1, 2, 2)), np.ones((1, 2)), skeleton=skeleton)
        with pytest.raises(ValueError, match="skeleton 'odd' has no joint of COCO17"):
            whole_body(mvpose.preset("fast")).estimate(ring(2), detections)

    def test_an_estimator_without_labels_is_refused(self):
        class Foreign:
            def estimate(self, rig, detections):
                return Estimate.of_joints(np.zeros((1, 17, 3)))

        skeleton, rig = skeleton_by_name("halpe26"), ring(3)
        detections, _ = seen(rig, standing(skeleton), skeleton)
        with pytest.raises(ValueError, match="reports no labels"):
            whole_body(Foreign()).estimate(rig, detections)

    def test_shelf14_is_no_obstacle(self):
        detections = Detections.from_keypoints([0], np.ones((1, 14, 2)), np.ones((1, 14)), skeleton=SHELF14)
        assert (body_part(detections).scores[0, 5:] == 1).all()
        assert (body_part(detections).scores[0, :5] == 0).all()
