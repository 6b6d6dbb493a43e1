"""Comparison of a recording with its simulated twin, and evaluation at many seeds."""

import numpy as np
import pytest

from simharness.reality.seed_evaluation import PcpInterval, annotate, evaluate_seeds, pcp_interval
from simharness.reality.twin import TwinComparison, compare
from simharness.scenario.load import load
from simharness.scoring.frame import score_frame
from simharness.scoring.summary import VariantScores
from simharness.trial.run_trial import run_trial

SHORT = ["duration=0.4", 'method.variants=["fast", "no-3dps"]']


@pytest.fixture(scope="module")
def scenario():
    return load("scenarios/shelf.toml", overrides=SHORT)


@pytest.fixture(scope="module")
def recorded(scenario):
    return annotate(run_trial(scenario, until="detect"))


def test_people_inside_most_pictures_are_annotated(recorded):
    known = np.isfinite(recorded.truth).all(axis=(2, 3))
    assert known.any()
    assert (known == np.isfinite(recorded.truth).any(axis=(2, 3))).all()
    for frame, person in np.argwhere(known):
        limbs = recorded.truth[frame, person, :12]
        assert sum(camera.inside(camera.project(limbs)).all() for camera in recorded.rig) >= len(recorded.rig) - 1


def test_a_twin_of_a_simulated_recording_has_similar_scores(recorded, scenario):
    comparison = compare(recorded, scenario, count=2)
    assert len(comparison.seeds) == 2
    assert comparison.seeds[0] == scenario.seed
    assert set(comparison.real) == set(comparison.simulated) == {"fast", "no-3dps"}
    for name, real in comparison.real.items():
        assert real.low <= real.pcp <= real.high
        assert abs(real.pcp - comparison.simulated[name].pcp) < 25
    summary = comparison.summary()
    assert summary["apart"] == pytest.approx(
        max(abs(each["real"]["pcp"] - each["simulated"]["pcp"]) for each in summary["pcp"].values())
    )


def test_the_order_counts_only_for_clear_differences_in_reality():
    def comparison(real, simulated):
        scores = [{name: PcpInterval(pcp, pcp, pcp) for name, pcp in each.items()} for each in (real, simulated)]
        return TwinComparison("x", "y", (1, 1), (0, 1), "voxelpose", *scores, {})

    assert comparison({"a": 90.0, "b": 80.0}, {"a": 70.0, "b": 60.0}).same_order
    assert not comparison({"a": 90.0, "b": 80.0}, {"a": 60.0, "b": 70.0}).same_order
    assert comparison({"a": 80.05, "b": 80.0}, {"a": 60.0, "b": 70.0}).same_order
    assert comparison({"a": 90.0, "b": 80.0}, {"a": 93.0, "b": 81.0}).largest_difference == 3.0


def test_pcp_is_a_mean_over_people_and_intervals_widen_with_variance():
    rng = np.random.default_rng(0)
    truth = rng.uniform(-1, 1, (2, 14, 3))

    def recording(correct):
        """Return frames in which person 0 is always correct and person 1 with probability ``correct``."""
        frames = []
        for good in rng.random(100) < correct:
            estimate = truth.copy()
            estimate[1] += 0.0 if good else 50.0
            frames.append(score_frame(truth, estimate))
        return VariantScores(tuple(frames))

    half = pcp_interval([recording(0.5)], (0, 1), rate=10.0)
    assert half.pcp == pytest.approx(75, abs=8)
    assert half.low < half.pcp < half.high
    certain = pcp_interval([recording(1.0)], (0, 1), rate=10.0)
    assert (certain.low, certain.pcp, certain.high) == (100.0, 100.0, 100.0)
    many = pcp_interval([recording(0.5) for _ in range(8)], (0, 1), rate=10.0)
    assert many.high - many.low < half.high - half.low


def test_people_who_fit_at_no_seed_are_an_error(recorded, scenario):
    crowded = scenario.model_copy(update={"people": scenario.people.model_copy(update={"area": 0.72})})
    with pytest.raises(ValueError, match="do not fit"):
        compare(recorded, crowded, count=2)


def test_seeds_are_paired_between_variants(scenario):
    result = evaluate_seeds(scenario, 3)
    assert len(result.seeds) == 3
    difference = result.difference("no-3dps", "fast")
    assert difference.pcp == pytest.approx(result.pcp("no-3dps").pcp - result.pcp("fast").pcp)
    same = result.difference("fast", "fast")
    assert (same.low, same.pcp, same.high) == (0.0, 0.0, 0.0)
    summary = result.summary()
    assert summary["seeds"] == list(result.seeds)
    assert len(summary["pcp_people"]["fast"]) == 4
    assert len(result.pooled("fast").frames) == sum(each.annotated for each in result.evaluations.values())
