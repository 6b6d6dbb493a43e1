"""Estimators with planted faults, user-defined as anybody's are, beside the method without them.

All are variants of one suite, which is run once; each is compared with the faultless one.
"""

import json

import pytest
from suites import QUICKSTART

from simharness.gate.baseline import FRAMES, TIME
from simharness.gate.compare import compare
from simharness.gate.suite import run_suite
from simharness.scenario.load import load_study
from simharness.scenario.sections.gate_section import GateSection

SUITE = f"""
extends = {json.dumps(str(QUICKSTART))}
name = "planted"
seed = 0
seeds = 12
variants = ["fast", "same", "forgetful", "unsure", "humble", "upside_down", "shaky"]
duration = 2.0
rate = 40.0
rendering.renderer = "rays"
people.count = 3
cameras.count = 4
clutter.boxes = 0
clutter.shelves = 0
detector.phantoms.rate = 1.0

[method.estimators]
same = "planted.py:Same"
forgetful = "planted.py:Forgetful"
unsure = "planted.py:Unsure"
humble = "planted.py:Humble"
upside_down = "planted.py:UpsideDown"
shaky = "planted.py:Shaky"
"""

ESTIMATORS = '''
import zlib
from dataclasses import replace

import numpy as np

from mvpose import Estimate, Matching, preset


class Same:
    def __init__(self):
        self.method = preset("fast")

    def estimate(self, rig, detections):
        return self.spoil(self.method.estimate(rig, detections), zlib.crc32(detections.keypoints.tobytes()))

    def spoil(self, estimate, frame):
        return estimate


class Forgetful(Same):
    """Loses one person in a frame of fifty."""

    def spoil(self, estimate, frame):
        if frame % 50 or not len(estimate):
            return estimate
        lost = int(np.argmax(estimate.scores.mean(axis=1)))
        labels = estimate.matching.labels
        labels = np.where(labels == lost, -1, labels - (labels > lost))
        joints, scores, covariance = (
            np.delete(values, lost, axis=0) for values in (estimate.joints, estimate.scores, estimate.covariance)
        )
        return Estimate(joints, scores, Matching(labels), covariance)


class Unsure(Same):
    """Gives covariances twice as large."""

    def spoil(self, estimate, frame):
        return replace(estimate, covariance=2 * estimate.covariance)


class Humble(Same):
    """Halves the scores of joints."""

    def spoil(self, estimate, frame):
        return replace(estimate, scores=0.5 * estimate.scores)


class UpsideDown(Same):
    """Reverses the order of the scores of people."""

    def spoil(self, estimate, frame):
        mean = estimate.scores.mean(axis=1, keepdims=True)
        return replace(estimate, scores=np.clip(estimate.scores + 1.0 - 2 * mean, 0.0, 1.0))


class Shaky(Same):
    """Moves every joint by about two centimetres."""

    def spoil(self, estimate, frame):
        moved = estimate.joints + np.random.default_rng(frame).normal(0, 0.02, estimate.joints.shape)
        return replace(estimate, joints=moved)
'''

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The scores of each variant, as a measurement of a suite of one variant."""
    folder = tmp_path_factory.mktemp("planted")
    (folder / "planted.py").write_text(ESTIMATORS)
    (folder / "planted.toml").write_text(SUITE)
    study = load_study(folder / "planted.toml")
    done = run_suite(study)
    assert not done.failed

    def of(variant):
        rows = done.scores.items()
        return {trial._replace(variant="method"): scores for trial, scores in rows if trial.variant == variant}

    whole = done.measurement(study)
    return {variant: type(whole)("planted", "0", "1", "zen", of(variant)) for variant in study.variants}


def verdicts(before, after):
    """Return verdict by score, of scores with one; times of a few frames are left out."""
    changes = compare(before, after, GateSection()).changes
    return {change.score: change.verdict for change in changes if change.verdict != "same" and change.score != TIME}


def test_the_same_estimates_have_the_same_scores(measured):
    assert verdicts(measured["same"], measured["same"]) == {}
    assert verdicts(measured["fast"], measured["same"]) == {}
    frames = {scores[FRAMES] for scores in measured["same"].scores.values()}
    assert (len(measured["same"].scores), frames) == (12, {80.0})


@pytest.mark.parametrize(("variant", "score", "where"), [("shaky", "mpjpe_mm", "in reconstruction")])
def test_the_changed_stage_is_named(measured, variant, score, where):
    changes = compare(measured["same"], measured[variant], GateSection()).with_verdict("worse")
    assert {change.where.split(",")[0] for change in changes if change.score == score} == {where}


@pytest.mark.parametrize(
    ("fault", "score"),
    [("forgetful", "missed"), ("humble", "score_brier"), ("upside_down", "map"), ("shaky", "mpjpe_mm")],
)
def test_a_planted_fault_is_a_regression(measured, fault, score):
    assert verdicts(measured["same"], measured[fault]).get(score) == "worse"


def test_covariances_twice_as_large_fail(measured):
    """Where coverage was below 90 % it may come nearer to it, which is as unexpected."""
    assert verdicts(measured["same"], measured["unsure"]).get("coverage_90") in ("worse", "unexpected")


def test_a_method_that_is_too_good_is_unexpected(measured):
    assert verdicts(measured["shaky"], measured["same"])["mpjpe_mm"] == "unexpected"
