"""Stored trials after a change of code: the stages that run again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from trials import simulated

from mvpose import Estimate
from simharness.scenario.load import load, load_study
from simharness.scoring import assessment
from simharness.study.stored_trial import StoredTrial, run_stored_trial
from simharness.study.study_folder import plan
from simharness.study.study_run import run_study
from simharness.study.trial_store import EntryState, Store
from simharness.trial import identity, run_trial
from simharness.trial.archive import pack_detected, pack_estimates, unpack_detected, unpack_estimates
from simharness.trial.stages import estimation
from simharness.trial.stages.detected_sequence import DetectedSequence

QUICKSTART = Path(__file__).parents[3] / "scenarios" / "quickstart.toml"
CHEAP = ("rendering.renderer=rays", "duration=0.6", "rate=5", "people.count=2", "cameras.count=3")
VARIANTS = ["full", "fast"]


class Counter:
    """Counts the calls of a function and passes them on."""

    def __init__(self, function):
        self.function, self.calls = function, 0

    def __call__(self, *arguments, **options):
        self.calls += 1
        return self.function(*arguments, **options)


@pytest.fixture
def stages(monkeypatch):
    """Counters of simulation, estimation by variants, scoring and blame."""
    counters = {}
    for module, name in (
        (run_trial, "capture_trial"),
        (estimation, "EstimateFrames"),
        (run_trial, "assess"),
        (run_trial, "blame_frames"),
    ):
        counters[name] = Counter(getattr(module, name))
        monkeypatch.setattr(module, name, counters[name])
    return counters


@pytest.fixture
def code(monkeypatch):
    """Change digests of the code: ``code(scores="x")``."""
    current = identity.code()

    def change(**digests):
        changed = replace(current, **digests)
        for module in (identity, "simharness.study.trial_store", "simharness.study.study_run"):
            target = f"{module}.code" if isinstance(module, str) else "simharness.trial.identity.code"
            monkeypatch.setattr(target, lambda: changed)

    return change


@pytest.fixture
def run(tmp_path):
    """Run a study of three trials; all runs use the same store."""

    def again():
        study = load_study(QUICKSTART, overrides=CHEAP, seeds=3, variants=VARIANTS)
        return run_study(study, out=tmp_path, workers=1)

    return again


def calls(stages):
    found = {name: counter.calls for name, counter in stages.items()}
    for counter in stages.values():
        counter.calls = 0
    return found


def without_times(table):
    return table.select(column for column in table.columns if not column.startswith("time_"))


@pytest.mark.slow
def test_a_changed_score_is_computed_without_simulation(run, stages, code, monkeypatch):
    before = run()
    assert calls(stages)["capture_trial"] == 3
    assert (before.info["kept"], before.info["run"]) == (0, 3)

    def halved(*arguments, **options):
        result = assess(*arguments, **options)
        return replace(result, scores={**result.scores, "pcp": result.scores["pcp"] / 2})

    assess = assessment.assess
    monkeypatch.setattr(run_trial, "assess", halved)
    code(scores="changed")
    after = run()
    assert (after.info["kept"], after.info["run"]) == (0, 3)
    counted = calls(stages)
    assert (counted["capture_trial"], counted["EstimateFrames"], counted["blame_frames"]) == (0, 0, 0)
    assert after.trials["pcp"].to_list() == [score / 2 for score in before.trials["pcp"]]
    assert without_times(after.people).equals(without_times(before.people))
    assert after.failures.equals(before.failures)
    assert after.trials["time_ms"].to_list() == before.trials["time_ms"].to_list()  # estimates are the stored ones
    again = run()
    assert (again.info["kept"], again.info["run"]) == (3, 0)


@pytest.mark.slow
def test_unchanged_code_scores_stored_estimates_as_it_scored_them_fresh(run, stages, code):
    before = run()
    calls(stages)
    code(scores="another", failures="another")
    after = run()
    counted = calls(stages)
    assert (counted["capture_trial"], counted["assess"]) == (0, 6)
    assert counted["blame_frames"] > 0
    assert after.trials.drop("seconds").equals(before.trials.drop("seconds"))
    for table in ("frames", "people", "failures"):
        assert getattr(after, table).equals(getattr(before, table))


@pytest.mark.slow
def test_a_changed_method_estimates_anew_from_the_stored_detections(run, stages, code):
    before = run()
    calls(stages)
    code(method="another")
    after = run()
    counted = calls(stages)
    assert counted["capture_trial"] == 0
    assert counted["EstimateFrames"] >= 3
    assert without_times(after.people).equals(without_times(before.people))


@pytest.mark.slow
def test_changed_simulation_or_lost_detections_run_everything_again(run, stages, code, tmp_path):
    run()
    calls(stages)
    code(simulation="another")
    assert run().info["run"] == 3
    assert calls(stages)["capture_trial"] == 3
    for file in (tmp_path / "store").glob("??/*.detections"):
        file.write_bytes(file.read_bytes()[:-30])
    code(simulation="another", scores="another")
    assert run().info["run"] == 3
    assert calls(stages)["capture_trial"] == 3


@pytest.mark.slow
def test_an_entry_knows_its_state(run, code, tmp_path):
    run()
    study = load_study(QUICKSTART, overrides=CHEAP, seeds=1, variants=["full"])
    store, (planned,) = Store(tmp_path / "store"), plan(study)
    entry = planned.entries["full"]
    assert store.state(entry) is EntryState.CURRENT
    assert store.state(entry[::-1]) is EntryState.MISSING
    code(failures="another")
    assert store.state(entry) is EntryState.OUTDATED


@pytest.mark.parametrize(
    "more",
    [
        [],
        ["detector.heatmaps.size=64x48"],
        ["appearance.source=drawn", 'method.variants=["full"]'],
        ["people.count=0"],
        ["detector.boxes.missed=1.0"],
    ],
)
def test_archives_restore_every_bit(more):
    scenario = load(QUICKSTART, overrides=[*CHEAP, *more])
    result = run_trial.run_trial(scenario, until="estimate")
    restored = unpack_detected(pack_detected(result.detected), scenario)
    assert np.array_equal(restored.time, result.detected.time)
    for camera, same in zip(result.detected.rig, restored.rig, strict=True):
        for key in ("K", "R", "t", "distortion", "size", "name"):
            assert np.array_equal(getattr(camera, key), getattr(same, key))
    for frame, same in zip(result.detected.frames, restored.frames, strict=True):
        for part in ("detections", "truth", "peaks"):
            identical(getattr(frame, part), getattr(same, part))
    for estimates in result.estimates.values():
        for estimate, same in zip(estimates, unpack_estimates(pack_estimates(estimates), restored), strict=True):
            identical(estimate, same, but={"matching"})
            identical(estimate.matching, same.matching, but={"P"})


def identical(one, other, but=frozenset()):
    """Assert that both are None, or that all fields except ``but`` are the same bytes."""
    assert (one is None) == (other is None)
    for key in getattr(one, "__dataclass_fields__", {}).keys() - but:
        first, second = getattr(one, key), getattr(other, key)
        if isinstance(first, np.ndarray):
            assert first.dtype == second.dtype, key
            assert first.tobytes() == second.tobytes(), key
        else:
            assert first == second, key


def test_estimates_without_labels_are_restored_as_they_were():
    scenario = load(QUICKSTART, overrides=CHEAP)
    _, frames = simulated(scenario)
    detected = DetectedSequence(np.arange(float(len(frames))), None, tuple(frames))
    estimates = [Estimate.of_joints(np.zeros((1, 17, 3))) for _ in frames]
    for estimate in unpack_estimates(pack_estimates(estimates), detected):
        assert len(estimate.matching.labels) == 0


def test_variants_that_were_not_stored_are_estimated_beside_those_that_were():
    scenario = load(QUICKSTART, overrides=CHEAP)
    first = run_stored_trial(scenario, ["full"])
    both = run_stored_trial(scenario, ["full", "fast"], StoredTrial(first.archive))
    assert both.archive.detected == b""
    assert both.archive.estimates["full"] == first.archive.estimates["full"]
    fresh = run_stored_trial(scenario, ["full", "fast"])
    for variant in VARIANTS:
        assert without_times(both.results[variant].people).equals(without_times(fresh.results[variant].people))
    assert isinstance(both.results["fast"].failures, pl.DataFrame)
