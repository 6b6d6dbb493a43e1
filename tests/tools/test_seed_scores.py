"""Scores of a scenario at many seeds by the protocol of recordings."""

import json

import numpy as np
import pytest

from simharness.scenario.load import load
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.score_summary import VariantScores
from simharness.trial.identity import PROVENANCE
from simharness.trial.run_trial import run_trial
from tools.paper_tables.seed_scores import annotate, evaluate_seeds, main, pcp_interval

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


def test_errors_of_the_annotation_are_those_of_the_scenario(scenario, recorded):
    annotation = scenario.annotation.model_copy(update={"shift": 0.03, "random": 0.01})
    erring = annotate(run_trial(scenario.model_copy(update={"annotation": annotation}), until="detect"))
    np.testing.assert_array_equal(np.isnan(erring.truth), np.isnan(recorded.truth))
    away = (erring.truth - recorded.truth)[np.isfinite(recorded.truth)]
    assert np.sqrt((away**2).mean()) == pytest.approx(np.hypot(0.03, 0.01), rel=0.15)
    for one, same in zip(erring.detections, recorded.detections, strict=True):
        np.testing.assert_array_equal(one.keypoints, same.keypoints)  # the truth alone is another


def test_pcp_is_a_mean_over_people_and_intervals_widen_with_variance():
    rng = np.random.default_rng(0)
    truth = rng.uniform(-1, 1, (2, 14, 3))

    def recording(correct):
        """Return frames in which person 0 is always correct and person 1 with probability ``correct``."""
        estimates = []
        for good in rng.random(100) < correct:
            estimates.append(truth.copy())
            estimates[-1][1] += 0.0 if good else 50.0
        return VariantScores(score_frames(np.stack([truth] * 100), estimates))

    half = pcp_interval([recording(0.5)], (0, 1), rate=10.0)
    assert half.pcp == pytest.approx(75, abs=8)
    assert half.low < half.pcp < half.high
    certain = pcp_interval([recording(1.0)], (0, 1), rate=10.0)
    assert (certain.low, certain.pcp, certain.high) == (100.0, 100.0, 100.0)
    many = pcp_interval([recording(0.5) for _ in range(8)], (0, 1), rate=10.0)
    assert many.high - many.low < half.high - half.low


@pytest.mark.slow
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


@pytest.mark.slow
def test_the_command_prints_a_table_and_writes_all_results(tmp_path, capsys):
    file = tmp_path / "seeds.json"
    quick = [
        "duration=0.4",
        "rate=5",
        "people.count=2",
        "rendering.renderer=rays",
        'method.variants=["fast", "no-3dps"]',
    ]
    words = [word for each in quick for word in ("--set", each)]
    assert main(["quickstart", *words, "--seeds", "2", "--json", str(file)]) == 0
    assert "PCP over 2 seeds" in capsys.readouterr().out
    summary = json.loads(file.read_text())
    assert summary["seeds"] == [7, 8]
    assert summary["command"].startswith("python -m tools.paper_tables.seed_scores quickstart --set ")
    assert summary.keys() >= set(PROVENANCE)
    assert summary["variants"] == ["fast", "no-3dps"]
    for scores in summary["pcp"].values():
        assert scores["low"] <= scores["pcp"] <= scores["high"]
    assert main(["nobody"]) == 2
    assert capsys.readouterr().err.startswith("error: ")
