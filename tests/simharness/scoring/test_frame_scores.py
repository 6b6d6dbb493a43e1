import json

import numpy as np
import polars as pl
import pytest

from mvpose.skeleton import coco17_to_shelf14
from simharness.scoring.frame_scores import FrameScores, fill_face, score_by_rules, score_frames
from simharness.scoring.matching import PairCounts
from simharness.scoring.pairing import pair
from simharness.scoring.pcp import GROUPS, PARTS, Part

# A standing person on COCO17, metres.
# fmt: off
PERSON = np.array([
    [.1, 0, 1.6], [.08, .03, 1.64], [.08, -.03, 1.64], [0, .07, 1.62], [0, -.07, 1.62],
    [0, .2, 1.4], [0, -.2, 1.4], [0, .25, 1.1], [0, -.25, 1.1], [0, .25, .85], [0, -.25, .85],
    [0, .1, .95], [0, -.1, .95], [0, .1, .5], [0, -.1, .5], [0, .1, .08], [0, -.1, .08],
])
# fmt: on
PEOPLE = np.stack([PERSON, PERSON + np.array([1.0, 0, 0])])


def score_frame(truth, estimate, *, head="voxelpose", matching=None):
    """Return the scores of a single frame."""
    return score_frames(truth[None], [estimate], head=head, matching=None if matching is None else [matching])


def row_of(scores):
    return {key: values[0] for key, values in scores.columns().items()}


def test_a_shift_is_the_error_and_makes_short_parts_wrong():
    score = score_frame(PEOPLE, PEOPLE + np.array([0, 0, 0.13]), matching=PairCounts(3, 1, 2))
    row = row_of(score)
    assert row["errors_mm"] == pytest.approx([130, 130])
    assert row["mpjpe_mm"] == pytest.approx(130)
    assert (row["people"], row["estimates"], row["found"], row["missed"], row["ghosts"]) == (2, 2, 2, 0, 0)
    assert (row["pairs_correct"], row["pairs_wrong"], row["pairs_lost"]) == (3, 1, 2)
    # Lower arms are 0.25 m: half of that is less than 0.13. Upper arms (0.304 m) and legs stay correct.
    parts = np.array(row["parts"]).reshape(2, 10)
    assert (parts[:, list(GROUPS["lower_arms"])] == Part.WRONG).all()
    for group in ("upper_arms", "upper_legs", "lower_legs", "torso"):
        assert (parts[:, list(GROUPS[group])] == Part.CORRECT).all(), group
    assert row["pcp"] == 100.0 * (parts == Part.CORRECT).mean()


def test_pcp_ignores_ghosts_and_pairs_count_them():
    score = score_frame(PEOPLE, np.concatenate([PEOPLE[:1], PEOPLE[:1] + 0.01, PEOPLE[:1] + 5.0]))
    row = row_of(score)
    assert (row["found"], row["missed"], row["ghosts"]) == (1, 1, 2)
    assert (score.parts[0, 0] == Part.CORRECT).all()


@pytest.mark.parametrize("head", ["voxelpose", "2019"])
def test_coco_estimates_are_mapped_onto_a_shelf_truth(head):
    truth = coco17_to_shelf14(PEOPLE, head=head)
    score = score_frame(truth, PEOPLE, head=head)
    assert (score.parts == Part.CORRECT).all()
    np.testing.assert_allclose(score.error, 0, atol=1e-12)
    other = score_frame(truth, PEOPLE, head="2019" if head == "voxelpose" else "voxelpose")
    assert (other.error > 0.001).all()  # the head is one of the 14 joints: the mapping matters


def test_a_missing_ear_makes_the_head_wrong_and_adds_no_error():
    estimate = PEOPLE.copy()
    estimate[:, 3] = np.nan
    score = score_frame(PEOPLE, estimate)
    wrong = {PARTS[part] for part in np.flatnonzero((score.parts == Part.WRONG).all(axis=(0, 1)))}
    assert wrong == {"head", "torso"}
    np.testing.assert_array_equal(score.error, 0)


def test_rows_have_no_nan_and_make_a_table():
    truth = coco17_to_shelf14(PEOPLE)
    truth[1] = np.nan
    rows = [
        row_of(score_frame(truth, PEOPLE[:1])),
        row_of(score_frame(truth, np.zeros((0, 17, 3)))),
        row_of(score_frame(np.zeros((0, 17, 3)), PEOPLE, matching=PairCounts(1, 2, 3))),
    ]
    json.dumps(rows, allow_nan=False)
    table = pl.DataFrame(rows, infer_schema_length=None)
    assert table["pcp"].to_list() == [100.0, 0.0, None]
    assert table["errors_mm"].to_list() == [[0.0, None], [None, None], []]
    assert table["ghosts"].to_list() == [0, 0, 2]
    assert table["pairs_lost"].to_list() == [None, None, 3]


def test_an_unknown_skeleton_is_refused():
    with pytest.raises(ValueError, match="17 joints of COCO17 or the 14 of SHELF14, got 15"):
        score_frame(np.zeros((1, 15, 3)), np.zeros((1, 15, 3)))


def test_frames_are_scored_as_each_alone():
    """Estimates of another number in every frame, in more frames than are scored at once."""
    rng = np.random.default_rng(0)
    truth = PEOPLE + rng.normal(0, 0.5, (300, 2, 1, 3))
    truth[rng.random((300, 2)) < 0.1] = np.nan
    estimates = [
        np.concatenate([people, people + 3.0])[rng.random(4) < 0.6] + rng.normal(0, 0.05, (1, 17, 3))
        for people in truth
    ]
    together = score_frames(truth, estimates)
    for frame, each in enumerate(estimates):
        alone, paired = score_frame(truth[frame], each), pair(truth[frame], each)
        np.testing.assert_array_equal(together.parts[frame], alone.parts[0])
        np.testing.assert_array_equal(together.partner[frame], paired.estimate)
        np.testing.assert_array_equal(together.error[frame], paired.error)
        np.testing.assert_array_equal(together.present[frame], paired.present)
        assert together.ghosts[frame] == len(each) - (paired.estimate >= 0).sum()


def test_joined_recordings_are_the_frames_of_both():
    one, other = (score_frame(PEOPLE, PEOPLE[:k], matching=PairCounts(k, 0, 0)) for k in (1, 2))
    both = FrameScores.joined([one, other])
    assert (len(both), both.estimates.tolist(), both.matching) == (
        2,
        [1, 2],
        (PairCounts(1, 0, 0), PairCounts(2, 0, 0)),
    )
    with pytest.raises(ValueError, match="frames of 1 and of 2"):
        FrameScores.joined([one, score_frame(PEOPLE[:1], PEOPLE)])


def test_another_number_of_estimates_than_frames_is_refused():
    with pytest.raises(ValueError, match="2 frames needs as many estimates, got 1"):
        score_frames(np.stack([PEOPLE, PEOPLE]), [PEOPLE])


class TestFilledFaces:
    def test_a_missing_joint_is_at_the_mean_of_the_others(self):
        joints = PEOPLE[:1].copy()
        joints[0, [0, 3]] = np.nan
        filled = fill_face(joints)
        for joint in (0, 3):
            np.testing.assert_allclose(filled[0, joint], joints[0, [1, 2, 4]].mean(axis=0))
        np.testing.assert_array_equal(filled[0, [1, 2, *range(4, 17)]], joints[0, [1, 2, *range(4, 17)]])

    def test_a_face_without_joints_stays_missing(self):
        joints = PEOPLE[:1].copy()
        joints[0, :5] = np.nan
        assert np.isnan(fill_face(joints)[0, :5]).all()

    def test_limbs_are_never_filled(self):
        joints = PEOPLE[:1].copy()
        joints[0, 9] = np.nan
        assert np.isnan(fill_face(joints)[0, 9]).all()

    def test_rules_differ_in_the_head_alone(self):
        truth, estimate = coco17_to_shelf14(PEOPLE)[None], PEOPLE.copy()
        estimate[:, 3] = np.nan
        scores = score_by_rules(truth, [estimate])
        wrong = {str(rule): (each.parts == Part.WRONG).sum() for rule, each in scores.items()}
        assert wrong["voxelpose"] == 4
        assert wrong["voxelpose, filled"] < 4
        for rule, each in scores.items():
            same = score_frames(truth, [estimate], head=rule.mapping, filled=rule.filled)
            np.testing.assert_array_equal(each.parts, same.parts)
            np.testing.assert_array_equal(each.errors, same.errors)
