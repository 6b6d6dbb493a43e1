"""Classes of failures: each by its definition, and invariants for arbitrary estimates."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moments import crowd, estimate_of, moment, recorded, ring

from mvpose import COCO17, Detections
from simharness.scoring.failure_classes import FailureKind, failures_of_frame, find_failures
from simharness.scoring.pairing import pair
from simharness.types.views import Visibility

RIG = ring(4)
PEOPLE = crowd(3)
DETECTIONS, TRUTH = moment(RIG, PEOPLE)
WRIST, ANKLE = COCO17.index("left_wrist"), COCO17.index("right_ankle")
ARM = [COCO17.index(f"left_{joint}") for joint in ("elbow", "wrist")]
SEEDS = st.integers(0, 2**32 - 1)


def classify(joints, labels=TRUTH.person, *, truth=TRUTH, detections=DETECTIONS):
    """Return the failures of one frame as (person, kind, joints)."""
    failures = failures_of_frame(RIG, detections, truth, estimate_of(np.asarray(joints), labels))
    return [(failure.person, failure.kind, failure.joints) for failure in failures]


def moved(person, joint, by):
    joints = PEOPLE.copy()
    joints[person, joint] += by
    return joints


def relabelled(*changes):
    """Return the true labels with some (view, person, label) changed."""
    labels = TRUTH.person.copy()
    for view, person, label in changes:
        labels[(DETECTIONS.view == view) & (TRUTH.person == person)] = label
    return labels


class TestClasses:
    def test_a_person_without_an_estimate_is_missed(self):
        assert classify(PEOPLE[:2], relabelled(*((view, 2, -1) for view in range(4)))) == [(2, FailureKind.MISSED, ())]

    def test_a_person_whose_estimate_is_too_far_is_missed_and_the_estimate_is_a_ghost(self):
        far = PEOPLE + np.array([0, 0, 0.51]) * (np.arange(3) == 1)[:, None, None]
        assert classify(far) == [(1, FailureKind.MISSED, ()), (-1, FailureKind.GHOST, ())]

    def test_an_estimate_that_matches_no_person_is_a_ghost(self):
        failures = failures_of_frame(
            RIG, DETECTIONS, TRUTH, estimate_of(np.concatenate([PEOPLE[:1] + 5.0, PEOPLE]), TRUTH.person + 1), frame=8
        )
        assert [(each.frame, each.person, each.estimate, each.kind) for each in failures] == [(8, -1, 0, "ghost")]
        assert failures[0].error_mm is None

    def test_a_person_without_estimate_with_a_detection_in_another_estimate_is_merged(self):
        labels = relabelled((0, 2, 1), *((view, 2, -1) for view in (1, 2, 3)))
        assert classify(PEOPLE[:2], labels) == [(2, FailureKind.MERGED, ())]

    def test_a_joint_drawn_by_another_persons_keypoint_is_merged(self):
        labels = relabelled((0, 2, 1), (0, 1, -1))
        towards = PEOPLE[2, WRIST] - PEOPLE[1, WRIST]
        for share, kind in ((0.9, FailureKind.MERGED), (0.25, FailureKind.DISPLACED_JOINT)):
            assert classify(moved(1, WRIST, share * towards), labels) == [(1, kind, (WRIST,))]
        # The same error without the other person's detection, and another error with it.
        halfway = moved(1, WRIST, 0.75 * towards)
        assert classify(halfway, labels) == [(1, FailureKind.MERGED, (WRIST,))]
        assert classify(halfway) == [(1, FailureKind.DISPLACED_JOINT, (WRIST,))]
        assert classify(moved(1, WRIST, [0, 0, 0.6]), labels) == [(1, FailureKind.DISPLACED_JOINT, (WRIST,))]

    def test_a_phantom_in_an_estimate_does_not_make_it_merged(self):
        labels = relabelled((0, 2, 1), (0, 1, -1))
        phantom = replace(TRUTH, person=np.where((DETECTIONS.view == 0) & (TRUTH.person == 2), -1, TRUTH.person))
        joints = moved(1, WRIST, 0.75 * (PEOPLE[2, WRIST] - PEOPLE[1, WRIST]))
        assert classify(joints, labels, truth=phantom) == [(1, FailureKind.DISPLACED_JOINT, (WRIST,))]

    def test_a_second_estimate_of_a_person_is_one_split(self):
        twice = np.concatenate([PEOPLE, PEOPLE[:1] + 0.1])
        labels = relabelled((0, 0, 3), (1, 0, 3))
        assert classify(twice, labels) == [(0, FailureKind.SPLIT, ())]
        # A second estimate made of another person's detections is a ghost, wherever it lies.
        assert classify(twice, relabelled((0, 1, 3), (1, 1, 3))) == [(-1, FailureKind.GHOST, ())]
        far = np.concatenate([PEOPLE, PEOPLE[:1] + 5.0])
        assert classify(far, labels) == [(-1, FailureKind.GHOST, ())]

    def test_an_estimate_of_phantoms_alone_is_a_ghost_wherever_it_lies(self):
        phantom = replace(TRUTH, person=np.where((DETECTIONS.view < 2) & (TRUTH.person == 2), -1, TRUTH.person))
        twice = np.concatenate([PEOPLE, PEOPLE[2:] + 0.1])
        assert classify(twice, relabelled((0, 2, 3), (1, 2, 3)), truth=phantom) == [(-1, FailureKind.GHOST, ())]

    def test_two_further_estimates_of_a_person_are_one_split(self):
        thrice = np.concatenate([PEOPLE, PEOPLE[:1] + 0.1, PEOPLE[:1] - 0.1])
        assert classify(thrice, relabelled((0, 0, 3), (1, 0, 4))) == [(0, FailureKind.SPLIT, ())]

    def test_a_person_without_estimate_with_detections_in_two_is_split(self):
        far = np.concatenate([PEOPLE[1:], PEOPLE[:1] + 5.0, PEOPLE[:1] + 9.0])
        labels = np.choose(TRUTH.person, [2, 0, 1])
        labels[(TRUTH.person == 0) & (DETECTIONS.view > 1)] = 3
        assert classify(far, labels) == [(0, FailureKind.SPLIT, ()), *2 * [(-1, FailureKind.GHOST, ())]]

    def test_left_and_right_exchanged_is_a_swapped_limb(self):
        legs = [COCO17.index(f"{side}_{joint}") for joint in ("knee", "ankle") for side in ("left", "right")]
        joints = PEOPLE.copy()
        joints[0, legs] = PEOPLE[0, np.array(COCO17.mirror)[legs]]
        assert classify(joints) == [(0, FailureKind.SWAPPED_LIMB, tuple(legs))]

    def test_an_arm_at_another_persons_arm_is_a_swapped_limb(self):
        joints = PEOPLE.copy()
        joints[0, ARM] = PEOPLE[1, ARM] + 0.05
        assert classify(joints) == [(0, FailureKind.SWAPPED_LIMB, tuple(ARM))]
        joints[0, ARM] = PEOPLE[1, ARM] + 0.1  # 173 mm
        assert classify(joints) == [(0, FailureKind.DISPLACED_JOINT, tuple(ARM))]

    def test_a_joint_between_its_position_and_its_counterpart_is_not_swapped(self):
        ears = PEOPLE[0, COCO17.index("right_shoulder")] - PEOPLE[0, COCO17.index("left_shoulder")]
        for share, kind in ((0.6, FailureKind.DISPLACED_JOINT), (0.7, FailureKind.SWAPPED_LIMB)):
            assert classify(moved(0, COCO17.index("left_shoulder"), share * ears))[0][1] == kind

    @pytest.mark.parametrize(("off", "wrong"), [(0.149, False), (0.151, True)])
    def test_a_joint_is_displaced_from_150_mm(self, off, wrong):
        expected = [(2, FailureKind.DISPLACED_JOINT, (ANKLE,))] if wrong else []
        assert classify(moved(2, ANKLE, [0, 0, off])) == expected


class TestHiddenJoints:
    @pytest.mark.parametrize(
        ("seen", "wrong"),
        [
            (Visibility.VISIBLE, True),
            (Visibility.SELF_OCCLUDED, True),
            (Visibility.OCCLUDED_BY_PERSON, False),
            (Visibility.OCCLUDED_BY_CLUTTER, False),
            (Visibility.OUTSIDE, False),
        ],
    )
    def test_a_missing_joint_is_displaced_if_a_view_shows_it(self, seen, wrong):
        visibility = TRUTH.visibility.copy()
        visibility[:, 2, ANKLE] = Visibility.OCCLUDED_BY_CLUTTER
        visibility[3, 2, ANKLE] = seen
        truth = replace(TRUTH, visibility=visibility)
        expected = [(2, FailureKind.DISPLACED_JOINT, (ANKLE,))]
        assert classify(moved(2, ANKLE, np.nan), truth=truth) == (expected if wrong else [])
        assert (
            classify(moved(2, ANKLE, 0.3), truth=truth) == expected
        )  # an estimated joint with a large error is displaced

    def test_a_person_whom_no_camera_sees_is_missed(self):
        truth = replace(TRUTH, visibility=np.full_like(TRUTH.visibility, Visibility.OUTSIDE))
        assert (
            classify(PEOPLE[:2], relabelled(*((v, 2, -1) for v in range(4))), truth=truth)[0][1] == FailureKind.MISSED
        )

    def test_an_undefined_joint_is_not_classified(self):
        joints = PEOPLE.copy()
        joints[0, WRIST] = np.nan
        assert classify(moved(0, WRIST, 3.0), truth=replace(TRUTH, joints=joints)) == []


def random_estimate(seed):
    """Return a random estimate: people lost, doubled, invented and distorted, with arbitrary labels."""
    rng = np.random.default_rng(seed)
    chosen = rng.integers(0, 3, rng.integers(0, 6))
    joints = PEOPLE[chosen] + rng.choice([0.0, 0.1, 0.4, 3.0], len(chosen))[:, None, None]
    # Never zero, because identical estimates are ties, which the order of estimates decides.
    joints += rng.choice([1e-6, 0.02, 0.3]) * rng.standard_normal(joints.shape)
    joints[rng.random(joints.shape[:2]) < rng.choice([0.0, 0.1])] = np.nan
    person = np.where(rng.random(len(DETECTIONS)) < 0.1, -1, TRUTH.person)
    visibility = np.where(rng.random(TRUTH.visibility.shape) < 0.3, TRUTH.visibility, Visibility.OCCLUDED_BY_PERSON)
    truth = replace(TRUTH, person=person, visibility=visibility)
    return truth, joints, rng.integers(-1, len(joints), len(DETECTIONS))


class TestInvariants:
    @given(SEEDS)
    def test_exact_estimates_in_any_order_have_no_failures(self, seed):
        order = np.random.default_rng(seed).permutation(3)
        assert classify(PEOPLE[order], np.argsort(order)[TRUTH.person]) == []

    @given(SEEDS)
    def test_failures_are_the_wrong_people_and_the_ghosts(self, seed):
        truth, joints, labels = random_estimate(seed)
        pairing = pair(PEOPLE, joints)
        wrong, spare = set(), set(range(len(joints))) - set(pairing.estimate.tolist())
        for estimate in list(spare):
            offs = [np.nanmean(np.linalg.norm(joints[estimate] - true, axis=-1)) for true in PEOPLE]
            contained = {p for p in truth.person[labels == estimate].tolist() if p >= 0 and pairing.estimate[p] >= 0}
            if contained and min(offs[p] for p in contained) <= 0.5:
                wrong.add(min(contained, key=lambda p: offs[p]))
                spare.remove(estimate)
        for person, estimate in enumerate(pairing.estimate):
            for joint in range(17):
                off = np.linalg.norm(joints[estimate, joint] - PEOPLE[person, joint]) if estimate >= 0 else np.inf
                hidden = (truth.visibility[:, person, joint] > Visibility.SELF_OCCLUDED).all()
                if off > 0.15 or (np.isnan(off) and not hidden):
                    wrong.add(person)
        failures = failures_of_frame(RIG, DETECTIONS, truth, estimate_of(joints, labels))
        assert [each.person for each in failures if each.person >= 0] == sorted(wrong)
        assert [each.estimate for each in failures if each.person < 0] == sorted(spare)
        for each in failures:
            assert (each.person < 0) == (each.kind is FailureKind.GHOST)
            assert (each.error_mm is None) == (each.person < 0 or each.estimate < 0)
            if each.person >= 0:
                assert each.estimate == pairing.estimate[each.person]
            if each.kind in (FailureKind.SWAPPED_LIMB, FailureKind.DISPLACED_JOINT):
                assert each.joints

    @given(SEEDS)
    def test_the_order_of_people_estimates_and_detections_does_not_matter(self, seed):
        truth, joints, labels = random_estimate(seed)
        rng = np.random.default_rng(seed + 1)
        people, order, rows = rng.permutation(3), rng.permutation(len(joints)), rng.permutation(len(DETECTIONS))
        new_person = np.append(np.argsort(people), -1)  # -1 stays
        new_label = np.append(np.argsort(order), -1)
        fields = ("view", "keypoints", "scores", "boxes", "box_scores")
        shuffled = replace(
            truth,
            joints=truth.joints[people],
            pixels=truth.pixels[:, people],
            visibility=truth.visibility[:, people],
            boxes=truth.boxes[:, people],
            person=new_person[truth.person][rows],
        )
        reordered = Detections(*(getattr(DETECTIONS, key)[rows] for key in fields))
        before = failures_of_frame(RIG, DETECTIONS, truth, estimate_of(joints, labels))
        after = failures_of_frame(RIG, reordered, shuffled, estimate_of(joints[order], new_label[labels][rows]))
        expected = {(new_person[each.person], new_label[each.estimate], each.kind, each.joints) for each in before}
        assert {(each.person, each.estimate, each.kind, each.joints) for each in after} == expected
        assert len(after) == len(before)


class TestInput:
    def test_frames_are_counted(self):
        recording = recorded(RIG, *3 * [(DETECTIONS, TRUTH)])
        good = estimate_of(PEOPLE, TRUTH.person)
        lost = estimate_of(PEOPLE[1:], TRUTH.person - 1)
        assert [(each.frame, each.person) for each in find_failures(recording, [lost, good, lost])] == [(0, 0), (2, 0)]
        with pytest.raises(ValueError, match="estimates must be 3, one for each frame, got 2"):
            find_failures(recording, [good, good])

    def test_a_frame_without_people_or_detections(self):
        detections, truth = moment(RIG, np.zeros((0, 17, 3)))
        assert failures_of_frame(RIG, detections, truth, estimate_of(np.zeros((0, 17, 3)), [])) == []
        ghosts = failures_of_frame(RIG, detections, truth, estimate_of(PEOPLE, []))
        assert [each.kind for each in ghosts] == 3 * [FailureKind.GHOST]

    def test_inputs_that_do_not_fit_are_refused(self):
        with pytest.raises(ValueError, match="labels must be"):
            classify(PEOPLE, TRUTH.person[1:])
        with pytest.raises(ValueError, match=r"estimated joints must be \(n, 17, 3\), got \(3, 14, 3\)"):
            classify(PEOPLE[:, :14])
