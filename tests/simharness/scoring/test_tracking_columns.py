"""Columns of tables and entries of summaries: what they are with identities, without, and under wrong ones."""

import json
from dataclasses import replace

import numpy as np
import pytest
from recordings import perfect_estimates, record, with_ghost

from mvpose.skeleton import coco17_to_shelf14
from simharness.scoring.assessment import assess
from simharness.scoring.catalogue import SCORES
from simharness.scoring.tracking.identity_figures import tracking_of_some, tracking_summary

OF_IDENTITIES = [
    *("hota", "deta", "assa", "loca", "idf1", "idp", "idr", "mota", "pcp_tracked", "mpjpe_tracked_mm"),
    *("id_switches", "switches_per_minute", "fragmentations"),
]


def truth_of(recording):
    return np.stack([true.joints for true in recording.truth])


def exchanged(estimates, *, start):
    """Return the estimates with the first two identities exchanged from a frame on."""
    order = [1, 0, *range(2, len(estimates[0]))]
    return [replace(each, ids=each.ids[order]) if k >= start else each for k, each in enumerate(estimates)]


def test_all_columns_are_scores():
    assert set(OF_IDENTITIES) | {"velocity_mm_s", "jerk_ratio"} <= set(SCORES)


def test_without_identities_only_motion_is_scored():
    recording = record(8)
    tracked = perfect_estimates(recording, noise=0.01)
    plain = [replace(each, ids=None) for each in tracked]
    with_ids, without = assess(recording, tracked).scores, assess(recording, plain).scores
    assert {key for key in SCORES if with_ids.get(key) != without.get(key)} == set(OF_IDENTITIES)
    assert all(without[key] is None for key in OF_IDENTITIES)
    assert without["jerk_ratio"] > 1.0 < without["velocity_mm_s"]
    assert assess(recording, [*tracked[:-1], plain[-1]]).scores["hota"] is None


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_motion_is_scored_where_frames_are_in_a_row(frames):
    recording = record(frames)
    summary = tracking_summary(truth_of(recording), perfect_estimates(recording, noise=0.01), recording.time)
    assert (summary["velocity_mm_s"] is None) == (frames < 2)
    assert (summary["jerk_m_s3"]["truth"] is None) == (summary["jerk_m_s3"]["estimate"] is None) == (frames < 4)


def test_identities_that_are_exchanged_cost_identity_scores_alone():
    recording = record(10, 3)
    right = perfect_estimates(recording, noise=0.01)
    before, after = (assess(recording, each).scores for each in (right, exchanged(right, start=5)))
    assert {key for key in SCORES if before.get(key) != after.get(key)} == {
        *("hota", "assa", "idf1", "idp", "idr", "mota", "pcp_tracked", "mpjpe_tracked_mm"),
        *("id_switches", "switches_per_minute"),
    }
    assert after["pcp_tracked"] == pytest.approx(100 * 2 / 3)
    assert after["idf1"] == pytest.approx(100 * 2 / 3)
    assert after["id_switches"] == 2
    assert after["switches_per_minute"] == pytest.approx(2 * 60 * 25 / 30)
    assert after["mpjpe_tracked_mm"] == pytest.approx(before["mpjpe_mm"], rel=0.1)


def test_under_the_right_identities_tracked_scores_are_the_others():
    recording = record(6, 3)
    found = assess(recording, [with_ghost(each) for each in perfect_estimates(recording, noise=0.08)]).scores
    assert found["pcp_tracked"] == pytest.approx(found["pcp"])
    assert found["mpjpe_tracked_mm"] == pytest.approx(found["mpjpe_mm"])
    assert found["idr"] == found["recall"]
    assert found["idp"] == found["precision"]


def test_a_summary_holds_the_columns():
    recording = record(9, 3)
    estimates = exchanged(perfect_estimates(recording, noise=0.15), start=3)
    found, scores = (
        tracking_summary(truth_of(recording), estimates, recording.time),
        assess(recording, estimates).scores,
    )
    at = found["mean_joint"]["0.5"]
    for key in OF_IDENTITIES:
        value = found[key] if key in found else at[key]
        assert scores[key] == pytest.approx(value * (100 if key in OF_IDENTITIES[:8] else 1)), key
    assert list(found["root"]) == list(found["mean_joint"]) == ["0.25", "0.5", "1"]
    assert at["loca"] < found["mean_joint"]["1"]["loca"] < found["root"]["1"]["loca"]
    assert found["jerk_m_s3"]["estimate"] / found["jerk_m_s3"]["truth"] == pytest.approx(scores["jerk_ratio"])
    json.dumps(found, allow_nan=False)
    plain = tracking_summary(truth_of(recording), [replace(each, ids=None) for each in estimates], recording.time)
    assert plain == found | dict.fromkeys(("mean_joint", "root", "pcp_tracked", "mpjpe_tracked_mm"))


def test_people_who_are_not_annotated_cost_nothing():
    recording = record(9, 3)
    estimates = exchanged(perfect_estimates(recording, noise=0.02), start=6)
    truth = coco17_to_shelf14(truth_of(recording))
    everybody = tracking_of_some(truth, estimates, recording.time, actors=[1, 2])
    assert everybody["root"]["0.5"]["id_switches"] == 2
    truth[:, 0] = np.nan
    found = tracking_of_some(truth, estimates, recording.time)
    assert found["pcp_tracked"] == everybody["pcp_tracked"]
    ghosts = tracking_of_some(truth, [with_ghost(each) for each in estimates], recording.time)
    assert ghosts == found
    at = found["mean_joint"]["0.5"]
    assert set(at) == {"idr", "id_switches", "interruptions", "switches_per_minute"}
    assert (at["id_switches"], at["idr"]) == (1, pytest.approx(15 / 18))
    assert found["pcp_tracked"] == pytest.approx(100 * 15 / 18)
    assert tracking_of_some(truth, [replace(each, ids=None) for each in estimates], recording.time) is None
