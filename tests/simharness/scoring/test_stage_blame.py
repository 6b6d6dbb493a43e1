"""Stages to blame for failures: frames with a known cause, and the substitutes for stages."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moments import crowd, estimate_of, moment, recorded, ring
from trials import simulated

from mvpose import COCO17, Camera, Detections, Estimate, Rig, preset
from mvpose.estimate import Matching
from mvpose.matching import Matcher
from mvpose.reconstruction import PictorialStructure, Triangulation
from simharness.scenario.load import load
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scoring.catalogue import SCORES
from simharness.scoring.failure_classes import FailureKind, find_failures
from simharness.scoring.stage_blame import (
    FAILURE_SCHEMA,
    Stage,
    blame_frames,
    failure_scores,
    failure_table,
    perfect_detections,
    true_labels,
    with_labels,
)

RIG = ring(4)
PEOPLE = crowd(3, spacing=1.2)
MOMENT = moment(RIG, PEOPLE)
FAST = preset("fast")
VARIANTS = ("full", "fast", "no-matching")


def with_keypoints(where, keypoints, *, moment=MOMENT):
    """Return a frame with changed keypoints in some of its detections."""
    detections, truth = moment
    changed = detections.keypoints.copy()
    changed[where] = keypoints
    return replace(detections, keypoints=changed), truth


def only(keep, *, moment=MOMENT):
    """Return a frame with only some of its detections."""
    detections, truth = moment
    fields = ("view", "keypoints", "scores", "boxes", "box_scores")
    kept = Detections(*(getattr(detections, key)[keep] for key in fields))
    return kept, replace(truth, person=truth.person[keep], error=truth.error[keep])


def joined(one, other, *, person):
    """Return a frame with the detections of another one added, as detections of ``person``."""
    (a, truth), (b, _) = one, other
    fields = ("view", "keypoints", "scores", "boxes", "box_scores")
    both = Detections(*(np.concatenate([getattr(a, key), getattr(b, key)]) for key in fields))
    of = np.full(len(b), person)
    return both, replace(truth, person=np.append(truth.person, of), error=np.zeros((len(both), 17), np.int8))


def blame(recording, estimator, estimates):
    """Return the failures of estimates with their stages."""
    return list(blame_frames(recording, estimator, estimates, recording.detections.__getitem__))


def blamed(estimator, *moments, rig=RIG):
    """Return (person, kind, stage, matching alone) of each failure."""
    recording = recorded(rig, *moments)
    estimates = [estimator.estimate(rig, detections) for detections in recording.detections]
    result = blame(recording, estimator, estimates)
    return [(each.failure.person, str(each.failure.kind), str(each.stage), each.matching_alone) for each in result]


def exchanging(affinity, view):
    """Match with the labels of the first two people exchanged in half of the views."""
    labels = Matcher(method="clustering")(affinity, view).labels.copy()
    exchanged = (view < 2) & (labels >= 0) & (labels < 2)
    labels[exchanged] = 1 - labels[exchanged]
    return Matching(labels)


class Foreign:
    """Estimator of another package: it takes no labels, and returns them or not."""

    def __init__(self, pipeline, *, labelled=True, shift=0.0):
        self.pipeline, self.labelled, self.shift = pipeline, labelled, np.array([0.0, 0.0, shift])

    def estimate(self, rig, detections):
        found = self.pipeline.estimate(rig, detections)
        labels = found.matching.labels if self.labelled else None
        return Estimate.of_joints(found.joints + self.shift, labels=labels)


class TestForeignStages:
    def test_wrong_labels_of_perfect_detections_are_blamed_on_matching(self):
        ours = blamed(replace(FAST, matching=exchanging), MOMENT)
        foreign = blamed(Foreign(replace(FAST, matching=exchanging)), MOMENT)
        assert [each[:3] for each in foreign] == [each[:3] for each in ours]
        assert {(stage, alone) for *_, stage, alone in foreign} == {("matching", None)}

    def test_right_labels_and_wrong_joints_are_blamed_on_reconstruction(self):
        result = blamed(Foreign(FAST, shift=0.3), MOMENT)
        assert {stage for _, _, stage, _ in result} == {"reconstruction"}
        assert len(result) == len(PEOPLE)

    def test_a_wrong_match_does_not_blame_matching_for_the_other_people(self):
        result = blamed(Foreign(replace(FAST, matching=exchanging), shift=0.3), MOMENT)
        stages = {person: stage for person, _, stage, _ in result if person >= 0}
        assert sorted(stages.values()) == ["matching", "matching", "reconstruction"]

    def test_a_phantom_is_blamed_on_detection(self):
        phantom = moment(RIG, crowd(1, seed=9) + [0.0, 1.4, 0.0])
        assert blamed(Foreign(FAST), joined(MOMENT, phantom, person=-1)) == [(-1, "ghost", "detection", None)]

    def test_without_labels_the_method_is_blamed(self):
        assert {each[2] for each in blamed(Foreign(FAST, labelled=False, shift=0.3), MOMENT)} == {"method"}


class TestStages:
    @pytest.mark.parametrize("variant", VARIANTS)
    def test_exact_detections_have_no_failures(self, variant):
        assert blamed(preset(variant), MOMENT) == []

    @pytest.mark.parametrize("variant", VARIANTS)
    def test_a_phantom_in_all_views_is_blamed_on_detection_and_removed_by_true_labels(self, variant):
        phantom = moment(RIG, crowd(1, seed=9) + [0.0, 1.4, 0.0])
        assert blamed(preset(variant), joined(MOMENT, phantom, person=-1)) == [(-1, "ghost", "detection", True)]

    @pytest.mark.parametrize("variant", VARIANTS)
    def test_a_person_without_detections_is_blamed_on_detection_and_not_removed_by_true_labels(self, variant):
        assert blamed(preset(variant), only(MOMENT[1].person != 1)) == [(1, "missed", "detection", False)]

    def test_left_and_right_exchanged_in_most_views_is_blamed_on_detection(self):
        legs = np.array([COCO17.index(f"{side}_{part}") for part in ("knee", "ankle") for side in ("left", "right")])
        where = np.flatnonzero((MOMENT[1].person == 2) & (MOMENT[0].view < 3))
        exchanged = MOMENT[0].keypoints[where][:, np.array(COCO17.mirror)[legs]]
        frame = with_keypoints((where[:, None], legs), exchanged)
        assert blamed(FAST, frame) == [(2, "swapped_limb", "detection", False)]

    def test_people_exchanged_in_half_of_the_views_are_blamed_on_matching(self):
        result = blamed(replace(FAST, matching=exchanging), MOMENT)
        assert len(result) > 1
        assert {person for person, *_ in result} & {0, 1, 2}
        assert {stage for _, _, stage, _ in result} == {"matching"}
        assert {alone for *_, alone in result} == {True}
        assert "merged" in {kind for _, kind, *_ in result}

    def test_a_wrong_calibration_is_blamed_on_reconstruction(self):
        rig = ring(3)
        turn = np.deg2rad(15)
        turned = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        believed = Rig(
            [Camera(each.K, turned @ each.R, turned @ each.t, each.distortion, each.size, each.name) for each in rig]
        )
        result = blamed(FAST, moment(rig, PEOPLE), rig=believed)
        assert {0, 1, 2} <= {person for person, *_ in result}
        assert {(stage, alone) for _, _, stage, alone in result} == {("reconstruction", False)}

    def test_a_person_outside_all_pictures_is_blamed_on_reconstruction(self):
        frame = moment(RIG, np.concatenate([PEOPLE, PEOPLE[:1] + [0.0, 0.0, 9.0]]))
        assert blamed(FAST, frame) == [(3, "missed", "reconstruction", False)]

    def test_several_failures_have_separate_stages(self):
        recording = [MOMENT, only(MOMENT[1].person != 0), MOMENT]
        result = blamed(replace(FAST, matching=exchanging), *recording)
        assert {stage for _, _, stage, _ in result} == {"detection", "matching"}


class Fixed:
    """User-defined estimator that returns ``exact`` for perfect detections, else ``rough``."""

    def __init__(self, rough, exact):
        self._rough, self._exact = rough, exact

    def estimate(self, rig, detections):
        joints = self._exact if (detections.box_scores == 1).all() else self._rough
        return estimate_of(joints, np.full(len(detections), -1))


class Slow:
    """Tracker that reports the people of the frame before; its labels are as wrong as its pipeline's."""

    def __init__(self, pipeline, *, labelled=True):
        self.pipeline, self.labelled = pipeline, labelled

    def track(self, rig, frames):
        before = None
        for detections in frames:
            found = self.pipeline.estimate(rig, detections)
            joints, before = found.joints if before is None else before, found.joints
            labels = np.where(found.matching.labels < len(joints), found.matching.labels, -1)
            yield Estimate.of_joints(joints, labels=labels if self.labelled else None)

    def blamed(self, *moments):
        """Return (frame, person, stage, matching alone) of each failure."""
        recording = recorded(RIG, *moments)
        estimates = list(self.track(RIG, recording.detections))
        result = blame(recording, self, estimates)
        return [(each.failure.frame, each.failure.person, str(each.stage), each.matching_alone) for each in result]

    def estimate(self, rig, detections):
        raise AssertionError("a tracker is not estimated frame by frame")


class TestTrackers:
    def test_a_miss_of_an_earlier_frame_is_blamed_on_detection(self):
        assert Slow(FAST).blamed(MOMENT, only(MOMENT[1].person != 1), MOMENT, MOMENT) == [(2, 1, "detection", None)]

    @pytest.mark.parametrize(("labelled", "stage"), [(True, "reconstruction"), (False, "method")])
    def test_people_who_have_moved_on_since_are_blamed_on_what_is_left(self, labelled, stage):
        moved = moment(RIG, PEOPLE + [0.3, 0.0, 0.0])
        result = Slow(FAST, labelled=labelled).blamed(MOMENT, MOMENT, moved)
        assert set(result) == {(2, person, stage, None) for person in range(3)}

    def test_wrong_labels_are_blamed_on_matching(self):
        result = Slow(replace(FAST, matching=exchanging)).blamed(MOMENT, MOMENT)
        assert {stage for *_, stage, _ in result} == {"matching"}
        assert {frame for frame, *_ in result} == {0, 1}


class TestRemoval:
    def test_a_user_defined_estimator_takes_no_labels(self):
        assert blamed(Fixed(PEOPLE[1:], PEOPLE), MOMENT) == [(0, "missed", "detection", None)]
        assert blamed(Fixed(PEOPLE[1:], PEOPLE[1:]), MOMENT) == [(0, "missed", "method", None)]

    def test_the_stages_of_a_user_defined_estimator_are_unknown(self):
        recording = recorded(RIG, MOMENT, MOMENT)
        for exact, stages in ((PEOPLE, (100, 0, 0, 0)), (PEOPLE[1:], (0, None, None, 100))):
            method = Fixed(PEOPLE[1:], exact)
            estimates = [method.estimate(RIG, detections) for detections in recording.detections]
            table = failure_table(blame(recording, method, estimates))
            scores = failure_scores(table, 2)
            assert tuple(scores[f"blame_{stage}"] for stage in Stage) == stages

    def test_as_many_ghosts_are_removed_as_there_are_fewer(self):
        near, far = PEOPLE[:1] + [9.0, 0, 0], PEOPLE[:1] + [-9.0, 0, 0]
        two = np.concatenate([PEOPLE, far, near])
        one = np.concatenate([PEOPLE, PEOPLE[:1] + [7.0, 0, 0]])  # at the place of neither, but nearer to one
        detection, remaining = (-1, "ghost", "detection", None), (-1, "ghost", "method", None)
        assert blamed(Fixed(two, one), MOMENT) == [detection, remaining]
        assert blamed(Fixed(two, PEOPLE), MOMENT) == [detection, detection]
        assert blamed(Fixed(one, two), MOMENT) == [remaining]
        nowhere = np.full((1, 17, 3), np.nan)
        assert blamed(Fixed(two, np.concatenate([PEOPLE, nowhere])), MOMENT).count(detection) == 1

    def test_a_found_person_with_a_wrong_joint_is_removed_and_a_second_wrong_joint_is_not(self):
        bent, stray = PEOPLE.copy(), PEOPLE.copy()
        bent[0, COCO17.index("nose")] += 0.3
        stray[0, COCO17.index("left_knee")] += 0.3
        assert blamed(Fixed(PEOPLE[1:], bent), MOMENT) == [(0, "missed", "detection", None)]
        assert blamed(Fixed(bent, stray), MOMENT) == [(0, "displaced_joint", "method", None)]
        assert blamed(Fixed(bent, PEOPLE[1:]), MOMENT) == [(0, "displaced_joint", "method", None)]

    def test_only_frames_with_failures_are_estimated_again_and_three_times_at_most(self):
        counted = []

        def counting(rays, labels, skeleton):
            counted.append(len(rays))
            return Triangulation()(rays, labels, skeleton)

        for matching, least in ((Matcher(method="clustering"), 2), (exchanging, 3)):
            pipeline = replace(FAST, matching=matching, reconstruction=counting)
            recording = recorded(RIG, MOMENT, only(MOMENT[1].person != 1))
            estimates = [pipeline.estimate(RIG, detections) for detections in recording.detections]
            failures = find_failures(recording, estimates)
            counted.clear()
            assert [each.failure for each in blame(recording, pipeline, estimates)] == failures
            assert len(counted) == least * len({each.frame for each in failures}) > 0


class TestSubstitution:
    def test_perfect_detections_are_those_of_the_perfect_profile(self):
        settings = ["rendering.renderer=rays", "duration=0.4", "rate=5", "people.count=3", "cameras.count=3"]
        scenario = load("scenarios/quickstart.toml", overrides=settings)
        _, real = simulated(scenario)
        _, perfect = simulated(scenario.model_copy(update={"detector": DetectorSection()}))
        hidden = 0
        for noisy, exact in zip(real, perfect, strict=True):
            detections, truth = perfect_detections(noisy.detections, noisy.truth)
            order = np.lexsort((exact.truth.person, exact.detections.view))  # the profile sorts by visibility
            np.testing.assert_array_equal(truth.person, exact.truth.person[order])
            np.testing.assert_array_equal(truth.error, exact.truth.error[order])
            for key in ("view", "keypoints", "scores", "boxes"):
                np.testing.assert_array_equal(
                    getattr(detections, key), getattr(exact.detections, key)[order], err_msg=key
                )
            assert (detections.box_scores == 1).all()
            assert len(noisy.detections)
            hidden += ((truth.visibility > 1) & (truth.visibility < 4)).sum()
        assert hidden

    def test_descriptors_are_those_of_the_same_person_and_view(self):
        detections, truth = joined(only(MOMENT[1].person != 1), only(MOMENT[1].person == 0), person=0)
        code = 10.0 * detections.view + truth.person
        sure = np.where(np.arange(len(detections)) < 8, 0.5, 0.8)  # the second time
        again = np.where(sure > 0.5, 100.0, 0.0)
        described = replace(detections, descriptors=np.column_stack([code, code + again]), box_scores=sure)
        perfect, true = perfect_detections(described, truth)
        for view, person, descriptor in zip(perfect.view, true.person, perfect.descriptors, strict=True):
            place = 10.0 * view + person
            expected = {0: [place, place + 100], 1: [np.nan, np.nan], 2: [place, place]}[person]
            np.testing.assert_array_equal(descriptor, expected)
        assert perfect_detections(detections, truth)[0].descriptors is None
        taken = np.array([0.0, np.nan, 0.02, 0.01])
        np.testing.assert_array_equal(perfect_detections(replace(detections, time=taken), truth)[0].time, taken)

    @given(st.integers(0, 2**32 - 1))
    def test_true_labels_are_of_the_highest_scored_detections_of_people_in_two_views(self, seed):
        rng = np.random.default_rng(seed)
        m = rng.integers(0, 15)
        view, person = rng.integers(0, 4, m), rng.integers(-1, 3, m)
        sure = rng.choice([0.3, 0.6, 0.9], m)
        scores = np.repeat(rng.choice([0.2, 0.7], m), 17).reshape(m, 17)
        detections = Detections(view, np.zeros((m, 17, 2)), scores, np.zeros((m, 4)), sure)
        labels = true_labels(detections, replace(MOMENT[1], person=person, error=np.zeros((m, 17))))
        found = [p for p in range(3) if len(set(view[person == p])) > 1]
        assert sorted(set(labels.tolist()) - {-1}) == list(range(len(found)))
        for number, p in enumerate(found):
            best = {
                min(np.flatnonzero((person == p) & (view == v)), key=lambda d: (-sure[d], -scores[d, 0], d))
                for v in set(view[person == p])
            }
            assert set(np.flatnonzero(labels == number)) == best

    def test_a_pipeline_with_given_labels_keeps_its_other_stages(self):
        labels = np.arange(4)
        labelled = with_labels(preset("fast"), labels)
        assert labelled.reconstruction == Triangulation()
        np.testing.assert_array_equal(labelled.labels, labels)
        assert isinstance(with_labels(preset("no-matching"), labels).reconstruction, PictorialStructure)
        assert with_labels(Fixed(PEOPLE, PEOPLE), labels) is None

    def test_people_with_true_labels_are_not_suppressed_as_duplicates(self):
        # Two people at one place in every picture: the suppression of duplicates must not overrule true labels.
        frame = moment(RIG, np.concatenate([PEOPLE[:1], PEOPLE[:1] + 0.001]))
        labelled = with_labels(FAST, true_labels(*frame))
        assert len(FAST.estimate(RIG, frame[0])) == 1
        assert np.isfinite(labelled.estimate(RIG, frame[0]).joints).all()
        assert len(labelled.estimate(RIG, frame[0])) == 2


class TestTable:
    def test_rows_and_scores(self):
        moments = [only(MOMENT[1].person != 1), MOMENT, only(MOMENT[1].person != 2)]
        recording = recorded(RIG, *moments)
        pipeline = replace(FAST, matching=exchanging)
        estimates = [pipeline.estimate(RIG, detections) for detections, _ in moments]
        failures = find_failures(recording, estimates)
        result = blame(recording, pipeline, estimates)
        assert [each.failure for each in result] == failures
        table = failure_table(result)
        assert table.schema == pl.Schema(FAILURE_SCHEMA)
        assert table.height == len(failures)
        for row, failure in zip(table.iter_rows(named=True), failures, strict=True):
            assert (row["frame"], row["person"], row["kind"]) == (failure.frame, failure.person, failure.kind)
            assert row["joints"] == [COCO17.joints[joint] for joint in failure.joints]
            assert row["error_mm"] == failure.error_mm
        scores = failure_scores(table, 3)
        assert sum(scores[f"failures_{kind}"] for kind in FailureKind) == pytest.approx(len(failures) / 3)
        assert sum(scores[f"blame_{stage}"] for stage in Stage) == pytest.approx(100)
        assert min(scores[f"blame_{stage}"] for stage in (Stage.DETECTION, Stage.MATCHING)) > 0

    def test_without_failures(self):
        table = failure_table([])
        assert table.schema == pl.Schema(FAILURE_SCHEMA)
        scores = failure_scores(table, 5)
        assert all(scores[f"failures_{kind}"] == 0 for kind in FailureKind)
        assert all(scores[f"blame_{stage}"] is None for stage in Stage)
        with pytest.raises(ValueError, match="one frame or more, got 0"):
            failure_scores(table, 0)

    def test_failures_without_blame_have_no_stage(self):
        frame = only(MOMENT[1].person != 1)
        recording = recorded(RIG, frame)
        table = failure_table(find_failures(recording, [FAST.estimate(RIG, frame[0])]))
        assert table.select("person", "stage", "matching_alone").rows() == [(1, None, None)]
        scores = failure_scores(table, 1)
        assert scores["failures_missed"] == 1
        assert scores["blame_detection"] is None

    def test_the_scores_are_those_of_the_catalogue(self):
        named = {key for key in SCORES if key.startswith(("failures_", "blame_"))}
        assert failure_scores(failure_table([]), 1).keys() == named
