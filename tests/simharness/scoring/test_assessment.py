import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings import NO_PEOPLE, PERSON, perfect_estimates, record, with_ghost

from mvpose import COCO17, Estimate, Matching
from simharness.scoring.assessment import assess, score_variant
from simharness.scoring.catalogue import SCORES
from simharness.scoring.feet_and_hands import WHOLE_BODY_SCORES
from simharness.scoring.joint_errors import pck
from simharness.types.recording import Recording
from simharness.types.truth import Truth
from simharness.types.views import Visibility

ASSESSED = [key for key in SCORES if not key.startswith(("failures_", "blame_"))]
POSE_SHARES = [key for key in ASSESSED if key.startswith(("pcp", "ap", "pck"))] + ["recall", "precision", "map"]
NEEDED = {"velocity_mm_s": 2, "switches_per_minute": 2, "jitter_mm": 3, "jerk_ratio": 4}  # frames
WRONG = [key for key in ASSESSED if SCORES[key].better == "lower" and not key.startswith("time_")]


def permuted(recording, estimates, rng):
    """Return the same recording and estimates with people, estimates and detections in another order."""
    people, detections, truth, reordered = rng.permutation(recording.people), [], [], []
    number = np.append(np.argsort(people), -1)  # new index of each person; -1 stays
    for detected, true, estimate in zip(recording.detections, recording.truth, estimates, strict=True):
        order, order_3d = rng.permutation(len(detected)), rng.permutation(len(estimate))
        label = np.append(np.argsort(order_3d), -1)
        fields = {key: getattr(detected, key)[order] for key in ("view", "keypoints", "scores", "boxes", "box_scores")}
        detections.append(replace(detected, **fields))
        views = (each[:, people] for each in (true.pixels, true.visibility, true.boxes))
        truth.append(Truth(true.joints[people], *views, number[true.person][order], true.error[order]))
        labels = label[estimate.matching.labels][order]
        joints, scores, ids = (getattr(estimate, key)[order_3d] for key in ("joints", "scores", "ids"))
        reordered.append(replace(estimate, joints=joints, scores=scores, ids=ids, matching=Matching(labels)))
    return Recording(recording.time, recording.rig, tuple(detections), tuple(truth)), reordered


def test_the_scores_are_those_of_the_catalogue():
    recording = record()
    assert list(assess(recording, perfect_estimates(recording)).scores) == ASSESSED


@given(st.integers(1, 5), st.integers(1, 3), st.integers(2, 4), st.integers(0, 2), st.integers(0, 99))
@settings(max_examples=15, deadline=None)
def test_the_truth_itself_is_perfect(frames, people, views, phantoms, seed):
    recording = record(frames, people, views, phantoms=phantoms, seed=seed)
    scores = assess(recording, perfect_estimates(recording, seed=seed)).scores
    for key in ASSESSED:
        if key.startswith("phantoms"):
            assert scores[key] == (None if not phantoms else 100.0 if key == "phantoms_pruned" else 0.0), key
        elif key == "coverage_90" or key in WHOLE_BODY_SCORES or frames < NEEDED.get(key, 1):
            assert scores[key] is None
        elif key == "jerk_ratio":
            assert scores[key] == pytest.approx(1.0)
        elif SCORES[key].better == "higher":
            assert scores[key] == pytest.approx(100.0), key
        elif key in WRONG and key not in ("detection_px", "phantoms_admitted", "score_brier"):
            assert scores[key] == pytest.approx(0.0, abs=1e-9), key


@given(st.integers(0, 999), st.floats(0.0, 0.2))
@settings(max_examples=15, deadline=None)
def test_the_order_of_people_estimates_and_detections_does_not_matter(seed, noise):
    rng = np.random.default_rng(seed)
    recording = record(4, 3, noise=3.0, phantoms=2, seed=seed)
    estimates = [with_ghost(each, score=0.7) for each in perfect_estimates(recording, noise=noise, seed=seed)]
    for index, estimate in enumerate(estimates):
        labels = rng.integers(-1, 4, len(estimate.matching.labels))
        estimates[index] = replace(estimate, matching=Matching(labels))
    before, after = assess(recording, estimates), assess(*permuted(recording, estimates, rng))
    for key in ASSESSED:
        assert after.scores[key] == pytest.approx(before.scores[key], nan_ok=False), key
    shared = [column for column in before.frames.columns if column not in ("pcp", "mpjpe_mm")]
    assert after.frames.select(shared).equals(before.frames.select(shared))
    assert sorted(after.people["worst_joint"]) == sorted(before.people["worst_joint"])


@given(st.integers(0, 999), st.floats(0.0, 0.3), st.floats(0.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_a_ghost_never_raises_a_score_and_pcp_ignores_it(seed, noise, score):
    recording = record(3, 2, seed=seed)
    estimates = perfect_estimates(recording, noise=noise, seed=seed)
    before = assess(recording, estimates).scores
    estimates[1] = with_ghost(estimates[1], score=score)
    after = assess(recording, estimates).scores
    assert after["precision"] < before["precision"] or before["precision"] == 0.0
    assert after["ghosts"] == pytest.approx(before["ghosts"] + 1 / 3)
    for key in POSE_SHARES:
        if key.startswith(("ap", "map", "precision")):
            assert after[key] <= before[key] + 1e-9, key
        else:
            assert after[key] == before[key], key


def test_a_ghost_with_the_lowest_score_costs_no_average_precision():
    recording = record()
    after = assess(recording, [with_ghost(each, score=0.1) for each in perfect_estimates(recording)]).scores
    assert after["ap25"] == after["map"] == 100.0
    before = assess(recording, [with_ghost(each, score=1.0) for each in perfect_estimates(recording)]).scores
    assert before["map"] == pytest.approx(100 * 2 / 3)  # five ghosts, then ten people


@given(st.integers(0, 999), st.floats(0.0, 0.3), st.integers(0, 3), st.integers(0, 2))
@settings(max_examples=20, deadline=None)
def test_moving_an_estimate_away_never_raises_a_share(seed, noise, frame, person):
    recording = record(4, 3, seed=seed)
    estimates = perfect_estimates(recording, noise=noise, seed=seed)
    before = assess(recording, estimates).scores
    joints = estimates[frame].joints.copy()
    joints[person] += [0.0, 0.0, 20.0]
    estimates[frame] = replace(estimates[frame], joints=joints)
    after = assess(recording, estimates).scores
    for key in POSE_SHARES:
        assert after[key] <= before[key] + 1e-9, key
    assert after["recall"] < before["recall"] or before["recall"] < 100.0


def test_a_shift_is_the_error_of_all_joints_and_no_jitter():
    recording = record(6, 3)
    shifted = [replace(each, joints=each.joints + [0.0, 0.06, 0.08]) for each in perfect_estimates(recording)]
    assessed = assess(recording, shifted)
    scores = assessed.scores
    for key in ("mpjpe_mm", "mpjpe_median_mm", *(f"mpjpe_{joint}_mm" for joint in COCO17.joints)):
        assert scores[key] == pytest.approx(100.0), key
    assert (scores["ap75"], scores["ap125"]) == (0.0, 100.0)
    assert (scores["pck50"], scores["pck150"]) == (0.0, 100.0)
    assert scores["pck_auc"] == pytest.approx(100 / 3)
    assert scores["bone_mm"] == pytest.approx(0.0, abs=1e-9)
    assert scores["jitter_mm"] == pytest.approx(0.0, abs=1e-9)
    assert scores["reprojection_px"] > 1.0 > scores["detection_px"]
    np.testing.assert_allclose(assessed.people["error_mm"], 100.0)
    np.testing.assert_allclose(pck(assessed.errors, [0.0999, 0.1001]), [0.0, 100.0])


def test_joints_are_scored_separately():
    recording = record()
    moved = np.zeros((17, 3))
    moved[COCO17.index("left_wrist"), 2] = 0.2
    scores = assess(
        recording, [replace(each, joints=each.joints + moved) for each in perfect_estimates(recording)]
    ).scores
    assert scores["mpjpe_left_wrist_mm"] == pytest.approx(200.0)
    assert scores["mpjpe_right_wrist_mm"] == scores["mpjpe_left_elbow_mm"] == 0.0
    assert scores["pck150"] == pytest.approx(100 * 16 / 17)
    # The limit of the lower arm is 125 mm: a wrist 200 mm off makes a mean error of 100 mm, one 300 mm off 150 mm.
    assert scores["pcp_lower_arms"] == 100.0
    scores = assess(
        recording, [replace(each, joints=each.joints + 1.5 * moved) for each in perfect_estimates(recording)]
    ).scores
    assert (scores["pcp_lower_arms"], scores["pcp_upper_arms"]) == (50.0, 100.0)


def test_a_missed_person_has_wrong_joints_and_no_error():
    recording = record(4, 2)
    estimates = [
        replace(each, **{key: getattr(each, key)[:1] for key in ("joints", "scores", "ids")})
        for each in perfect_estimates(recording)
    ]
    assessed = assess(recording, estimates)
    assert assessed.scores["recall"] == assessed.scores["pck150"] == assessed.scores["ap150"] == 50.0
    assert (assessed.scores["mpjpe_mm"], assessed.scores["missed"]) == (0.0, 1.0)
    missed = assessed.people.filter(pl.col("person") == 1)
    assert missed["found"].to_list() == [False] * 4
    for column in ("error_mm", "worst_joint", "worst_mm"):
        assert missed[column].null_count() == 4, column
    assert assessed.people.filter(pl.col("person") == 0)["error_mm"].to_list() == [0.0] * 4


def test_frames_without_estimates_and_without_people():
    empty = [NO_PEOPLE] * 5
    unmatched = [replace(each, matching=Matching(np.full(6, -1))) for each in empty]
    nothing = assess(record(), unmatched).scores
    assert (nothing["recall"], nothing["precision"], nothing["map"], nothing["pck_auc"]) == (0.0, None, 0.0, 0.0)
    assert nothing["mpjpe_mm"] is nothing["jitter_mm"] is nothing["reprojection_px"] is nothing["time_ms"] is None
    empty_room = record(people=0)
    no_people = assess(empty_room, empty)
    known = {key: value for key, value in no_people.scores.items() if value is not None}
    assert known == dict.fromkeys(["ghosts", "missed", "violations", "merged", "split"], 0.0)
    assert no_people.people.is_empty()
    assert no_people.people.schema == assess(record(), perfect_estimates(record())).people.schema
    assert no_people.frames.schema == assess(record(), perfect_estimates(record())).frames.schema
    ghosts = assess(empty_room, [replace(each, matching=NO_PEOPLE.matching) for each in map(with_ghost, empty)]).scores
    assert (ghosts["precision"], ghosts["map"], ghosts["ghosts"]) == (0.0, None, 1.0)


def test_the_worst_joint_and_the_visible_views_of_a_person():
    recording = record(1, 2, 3)
    visibility = recording.truth[0].visibility.copy()
    visibility[0, 0, :9] = Visibility.OCCLUDED_BY_CLUTTER  # more than half of person 0 in view 0
    visibility[1, 0, :8] = Visibility.OUTSIDE  # less than half
    visibility[2, 0] = Visibility.SELF_OCCLUDED
    recording = replace(recording, truth=(replace(recording.truth[0], visibility=visibility),))
    (estimate,) = perfect_estimates(recording)
    joints = estimate.joints.copy()
    joints[0, 9] += [0.0, 0.3, 0.0]
    joints[0, 3] = np.nan
    people = assess(recording, [replace(estimate, joints=joints)]).people
    assert people["worst_joint"][0] == "left_wrist"
    assert people["worst_mm"][0] == pytest.approx(300.0)
    assert people["error_mm"][0] == pytest.approx(300.0 / 16)
    assert people["visible_views"].to_list() == [2, 3]


def test_matching_errors_are_counted_per_frame():
    recording = record(2, 2, 3, phantoms=2)
    right, wrong = perfect_estimates(recording)
    labels = np.array([0, 1, 0, 1, 1, 1, 0, -1])  # person 0 in view 2 and a phantom have the label of person 1 or 0
    scores = assess(recording, [right, replace(wrong, matching=Matching(labels))])
    assert (scores.scores["merged"], scores.scores["split"], scores.scores["violations"]) == (0.5, 0.5, 1.0)
    assert (scores.scores["phantoms_admitted"], scores.scores["phantoms_pruned"]) == (25.0, 75.0)
    assert scores.frames["merged"].to_list() == scores.frames["split"].to_list() == [0, 1]
    assert scores.frames["phantoms"].to_list() == [2, 2]
    assert scores.frames["admitted"].to_list() == [0, 1]


@pytest.mark.parametrize("unlabelled", [(0, 1, 2), (1,)])
def test_a_method_without_labels_has_no_matching_scores(unlabelled):
    recording = record(3, phantoms=1, noise=2.0)
    labelled = perfect_estimates(recording, noise=0.05)
    partly = [replace(each, matching=Matching([])) if k in unlabelled else each for k, each in enumerate(labelled)]
    without, full = assess(recording, partly), assess(recording, labelled)
    unknown = {key for key in ASSESSED if full.scores[key] is not None and without.scores[key] is None}
    matching_scores = {"violations", "merged", "split", "phantoms_admitted", "phantoms_pruned"}
    assert unknown == matching_scores | {f"match_{key}" for key in ("precision", "recall", "f1")}
    assert all(without.scores[key] == full.scores[key] for key in ASSESSED if key not in unknown)
    assert without.frames.schema == full.frames.schema
    empty = {key for key in without.frames.columns if without.frames[key].is_null().all()}
    columns = {"pairs_correct", "pairs_wrong", "pairs_lost", "violations", "merged", "split", "phantoms", "admitted"}
    assert empty - {key for key in empty if key.startswith("time_")} == columns


def test_two_people_with_one_label_are_merged_and_not_split():
    recording = record(2)
    right, wrong = perfect_estimates(recording)
    labels = np.array([0, 0, 0, -1, 0, -1])  # both people in view 0, and person 0 in the others
    assessed = assess(recording, [right, replace(wrong, matching=Matching(labels))])
    assert (assessed.scores["merged"], assessed.scores["split"], assessed.scores["violations"]) == (0.5, 0.0, 0.5)
    assert assessed.frames.select("merged", "split", "violations").rows() == [(0, 0, 0), (1, 0, 1)]


def test_too_long_and_too_short_bones_do_not_cancel():
    recording = record(3)
    scaled = []
    for estimate in perfect_estimates(recording):
        middle = estimate.joints.mean(axis=1, keepdims=True)
        scale = np.array([0.9, 1.1])[:, None, None]
        scaled.append(replace(estimate, joints=middle + scale * (estimate.joints - middle)))
    lengths = [np.linalg.norm(PERSON[child] - PERSON[parent]) for parent, child in COCO17.edges]
    assert assess(recording, scaled).scores["bone_mm"] == pytest.approx(100.0 * np.mean(lengths))


def test_times_are_statistics_of_the_frames():
    recording = record(5)
    timed = [
        replace(each, timings={"affinity": k, "matching": 2 * k, "reconstruction": 3 * k, "total": 6 * k})
        for each, k in zip(perfect_estimates(recording), [0.001, 0.002, 0.003, 0.004, 0.1], strict=True)
    ]
    assessed = assess(recording, timed)
    times = [assessed.scores[f"time_{stage}ms"] for stage in ("affinity_", "matching_", "reconstruction_", "")]
    assert times == pytest.approx([3.0, 6.0, 9.0, 18.0])
    assert assessed.scores["time_p99_ms"] == pytest.approx(24 + 0.96 * 576)  # between the last two of five
    assert assessed.frames["time_ms"].to_list() == pytest.approx([6, 12, 18, 24, 600])


def test_tables_and_scores_agree():
    recording = record(6, 3, noise=2.0, phantoms=1)
    estimates = [with_ghost(each) if k % 2 else each for k, each in enumerate(perfect_estimates(recording, noise=0.1))]
    assessed = assess(recording, estimates)
    frames, people, scores = assessed.frames, assessed.people, assessed.scores
    assert frames["frame"].to_list() == list(range(6))
    assert people.height == frames["people"].sum() == 18
    assert people.group_by("frame").agg(pl.col("found").sum())["found"].sum() == frames["found"].sum()
    assert scores["precision"] == pytest.approx(100 * frames["found"].sum() / frames["estimates"].sum())
    assert scores["mpjpe_mm"] == pytest.approx(people["error_mm"].mean())
    assert scores["pcp"] == pytest.approx(people["pcp"].mean()) == pytest.approx(frames["pcp"].mean())
    assert scores["pcp"] < 100.0
    summary = score_variant(recording, estimates).summary()
    assert scores["match_f1"] == pytest.approx(100 * summary["matching"]["f1"])
    json.dumps([scores, frames.to_dicts(), people.to_dicts()], allow_nan=False)


def test_estimates_must_fit_the_recording():
    recording = record(3)
    with pytest.raises(ValueError, match="3 frames needs as many estimates, got 2"):
        assess(recording, perfect_estimates(recording)[:2])
    short = Estimate(np.zeros((0, 17, 3)), np.zeros((0, 17)), Matching([0, 0]))
    with pytest.raises(ValueError, match=r"labels must be \(6\), got \(2\)|labels must be \(6,\), got \(2,\)"):
        assess(recording, [short] * 3)


def test_the_fields_of_a_recording_must_agree():
    recording = record(3)
    with pytest.raises(ValueError, match="3 of time, 2 of detections, 3 of truth"):
        replace(recording, detections=recording.detections[:2])
    with pytest.raises(ValueError, match="at least one frame"):
        Recording([], recording.rig, (), ())
    with pytest.raises(ValueError, match=r"frame 1 has \(3, 17\)"):
        replace(recording, truth=(recording.truth[0], *record(2, 3).truth))
    other = record(3, 2, 4)
    with pytest.raises(ValueError, match="frame 0: 6 detections in 3 views, but truth for 8 detections in 4 views"):
        replace(recording, truth=other.truth)
