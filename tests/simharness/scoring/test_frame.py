import json

import numpy as np
import polars as pl
import pytest

from mvpose.skeleton import coco17_to_shelf14
from simharness.scoring.frame import score_frame
from simharness.scoring.matching import PairCounts
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


def test_a_shift_is_the_error_and_makes_short_parts_wrong():
    score = score_frame(PEOPLE, PEOPLE + np.array([0, 0, 0.13]), matching=PairCounts(3, 1, 2))
    row = score.row()
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
    row = score.row()
    assert (row["found"], row["missed"], row["ghosts"]) == (1, 1, 2)
    assert (score.parts[0] == Part.CORRECT).all()


@pytest.mark.parametrize("head", ["voxelpose", "2019"])
def test_coco_estimates_are_mapped_onto_a_shelf_truth(head):
    truth = coco17_to_shelf14(PEOPLE, head=head)
    score = score_frame(truth, PEOPLE, head=head)
    assert (score.parts == Part.CORRECT).all()
    np.testing.assert_allclose(score.pairing.error, 0, atol=1e-12)
    other = score_frame(truth, PEOPLE, head="2019" if head == "voxelpose" else "voxelpose")
    assert (other.pairing.error > 0.001).all()  # the head is one of the 14 joints: the mapping matters


def test_a_missing_ear_makes_the_head_wrong_and_adds_no_error():
    estimate = PEOPLE.copy()
    estimate[:, 3] = np.nan
    score = score_frame(PEOPLE, estimate)
    wrong = {PARTS[part] for part in np.flatnonzero((score.parts == Part.WRONG).all(axis=0))}
    assert wrong == {"head", "torso"}
    np.testing.assert_array_equal(score.pairing.error, 0)


def test_rows_have_no_nan_and_make_a_table():
    truth = coco17_to_shelf14(PEOPLE)
    truth[1] = np.nan
    rows = [
        score_frame(truth, PEOPLE[:1]).row(),
        score_frame(truth, np.zeros((0, 17, 3))).row(),
        score_frame(np.zeros((0, 17, 3)), PEOPLE, matching=PairCounts(1, 2, 3)).row(),
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
