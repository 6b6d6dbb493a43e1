import json

import numpy as np
import pytest

from simharness.scoring.frame_scores import FrameScores, score_frames
from simharness.scoring.matching import PairCounts
from simharness.scoring.pcp import GROUPS
from simharness.scoring.score_summary import STAGES, VariantScores, summarize

KEYS = {
    "pcp",
    "pcp_parts",
    "pcp_actors",
    "precision",
    "recall",
    "ghosts_per_frame",
    "missed_per_frame",
    "mpjpe_mm",
    "matching",
    "timings_ms",
}


def frame(parts, errors, *, estimates, matching=None):
    """Return a frame with all people present; a NaN error is a missed person."""
    errors = np.array(errors, float)[None]
    found = np.isfinite(errors)
    return FrameScores(
        np.array(parts, np.int8).reshape(1, -1, 10),
        np.where(found, np.cumsum(found, axis=1) - 1, -1),
        np.zeros((*errors.shape, 17)),
        errors,
        np.ones(errors.shape, bool),
        np.array([estimates]),
        None if matching is None else (matching,),
    )


def scores_of(*frames, timings=()):
    return VariantScores(FrameScores.joined(frames), timings)


NOTHING = score_frames(np.zeros((0, 0, 17, 3)), [])


RIGHT, WRONG, ABSENT = [1] * 10, [0] * 10, [-1] * 10
HEAD_WRONG = [1] * 8 + [0, 1]


def test_all_people_have_equal_weight_in_however_many_frames():
    frames = (
        frame([RIGHT, ABSENT], [0.01, np.nan], estimates=1),
        frame([RIGHT, ABSENT], [0.01, np.nan], estimates=1),
        frame([RIGHT, WRONG], [0.01, 0.02], estimates=2),
    )
    summary = scores_of(*frames).summary()
    assert summary["pcp_actors"] == [100.0, 0.0]
    assert summary["pcp"] == 50.0
    assert scores_of(*frames).summary(actors=[0])["pcp"] == 100.0
    assert scores_of(*frames).summary(actors=[0])["pcp_actors"] == [100.0]


def test_parts_are_named_by_group():
    summary = scores_of(frame([HEAD_WRONG], [0.1], estimates=1), frame([RIGHT], [0.1], estimates=1)).summary()
    assert summary["pcp"] == 95.0
    assert summary["pcp_parts"] == {group: 50.0 if group == "head" else 100.0 for group in GROUPS}


def test_people_are_pooled_over_frames():
    frames = (
        frame([RIGHT, RIGHT], [0.010, 0.020], estimates=2, matching=PairCounts(8, 0, 0)),
        frame([RIGHT, WRONG], [0.060, np.nan], estimates=3, matching=PairCounts(1, 1, 5)),
    )
    summary = scores_of(*frames).summary()
    assert summary["precision"] == 3 / 5
    assert summary["recall"] == 3 / 4
    assert summary["ghosts_per_frame"] == 1.0
    assert summary["missed_per_frame"] == 0.5
    assert summary["mpjpe_mm"] == pytest.approx({"mean": 30.0, "median": 20.0})
    assert summary["matching"] == pytest.approx({"precision": 0.9, "recall": 9 / 14, "f1": 18 / 24})


def test_timings_are_in_milliseconds_by_stage():
    timings = tuple({"affinity": 0.001 * k, "total": 0.002 * k} for k in range(101))
    timed = VariantScores(NOTHING, timings).summary()["timings_ms"]
    assert tuple(timed) == STAGES
    assert timed["affinity"] == pytest.approx({"median": 50.0, "p99": 99.0})
    assert timed["total"] == pytest.approx({"median": 100.0, "p99": 198.0})
    assert timed["matching"] == {"median": None, "p99": None}


def test_scores_that_do_not_apply_are_null_and_never_nan():
    no_people = frame([], [], estimates=0)
    for variant in (VariantScores(NOTHING), VariantScores(no_people)):
        summary = summarize("empty", {"full": variant}, frames=len(variant.frames), seeds=1)
        scores = json.loads(json.dumps(summary, allow_nan=False))["variants"]["full"]
        assert set(scores) == KEYS
        for key in ("pcp", "precision", "recall"):
            assert scores[key] is None
        assert scores["mpjpe_mm"] == {"mean": None, "median": None}
        assert scores["matching"] == {"precision": None, "recall": None, "f1": None}
    assert VariantScores(no_people).summary()["ghosts_per_frame"] == 0.0


def test_summaries_have_the_shared_keys_and_further_ones():
    summary = summarize("x", {"a": VariantScores(NOTHING)}, frames=3, seeds=2, head="2019")
    assert set(summary) == {"name", "frames", "seeds", "code", "variants", "head"}
    assert (summary["name"], summary["frames"], summary["seeds"], summary["head"]) == ("x", 3, 2, "2019")
    assert summary["code"]
