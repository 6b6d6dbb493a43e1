"""Evaluations over seeds give the method the same detections as studies do, heat maps included."""

import numpy as np
import pytest

import mvpose.pipeline
from simharness.scenario.load import load
from simharness.trial.run_trial import run_trial
from tools.paper_tables import seed_scores

CHEAP = ("rendering.renderer=rays", "duration=0.4", "rate=5", "people.count=2", "cameras.count=3")


@pytest.mark.slow
@pytest.mark.parametrize("size", ["none", "64x48"])
def test_heat_maps_reach_the_method(monkeypatch, size):
    scenario = load("quickstart", overrides=[*CHEAP, f"detector.heatmaps.size={size}", 'method.variants=["full"]'])
    given = []
    estimate = mvpose.pipeline.Pipeline.estimate

    def recorded(self, rig, detections):
        given.append(detections.likelihoods is not None)
        return estimate(self, rig, detections)

    monkeypatch.setattr(mvpose.pipeline.Pipeline, "estimate", recorded)
    seed_scores.evaluate_seeds(scenario, 1)
    assert given
    assert all(given) is (size != "none")


def test_seeds_are_scored_on_the_estimates_of_a_trial():
    scenario = load("quickstart", overrides=[*CHEAP, "detector.heatmaps.size=64x48", 'method.variants=["full"]'])
    result = run_trial(scenario, until="estimate")
    evaluation = seed_scores.evaluate_seeds(scenario, 1)
    scores = evaluation.variant_scores("full")[0]
    expected = seed_scores.score_estimates(seed_scores.annotate(result), result.estimates)
    np.testing.assert_array_equal(scores.frames.parts, expected.variants["full"].frames.parts)
