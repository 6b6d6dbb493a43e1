"""Variants that fail: the other variants keep their results."""

import os
import signal
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from fakes import made_up, study_of
from trials import Recorder

from mvpose.commands.errors import RunError
from simharness.gate import suite
from simharness.study.scheduler import ATTEMPTS, TrialFailure, TrialSuccess, Unit, run_units
from simharness.study.stored_trial import TrialOutput
from simharness.study.study_folder import plan
from simharness.study.study_run import run_study
from simharness.study.trial_store import Store
from simharness.trial.identity import entry_identity

VARIANTS = ("full", "fast", "no-3dps")


@dataclass(frozen=True)
class Broken:
    """Replacement of ``measure`` with variants that fail at odd seeds, together with all that are measured with them.

    Attributes:
        errors: error of each failing variant, or "kill".
        calls: file that gets a line "SEED VARIANTS" for each call.
        least: smallest number of variants in a call for one to fail.
    """

    errors: Mapping[str, Exception | str]
    calls: Path = field(default=Path(os.devnull))
    least: int = 1

    def __call__(self, scenario, variants, stored=None):
        with self.calls.open("a") as file:
            file.write(f"{scenario.seed} {'+'.join(variants)}\n")
        for variant in variants:
            if variant in self.errors and scenario.seed % 2 and len(variants) >= self.least:
                if self.errors[variant] == "kill":
                    os.kill(os.getpid(), signal.SIGKILL)
                raise self.errors[variant]
        return TrialOutput({variant: made_up(scenario, variant) for variant in variants})


def units_of(folder, seeds, variants=VARIANTS):
    return [Unit(each.trial, each.scenario, variants) for each in plan(study_of(folder, seeds=seeds))]


@pytest.fixture
def run(tmp_path):
    """Run a made-up study with variants that fail at odd seeds."""

    def run(errors, **options):
        study = study_of(tmp_path, variants=VARIANTS, seeds=options.pop("seeds", 3))
        return run_study(study, out=tmp_path / "out", measure=Broken(errors, run.calls), **options)

    run.calls = tmp_path / "calls"
    return run


class TestOneByOne:
    @pytest.mark.slow
    @pytest.mark.parametrize("error", [RunError("boom"), "kill"], ids=["raises", "kills its worker"])
    def test_a_variant_that_fails_in_a_worker_is_lost_alone(self, tmp_path, error):
        self.check(run_units(units_of(tmp_path, 2), Broken({"fast": error}), workers=2))

    def test_a_variant_that_fails_in_this_process_is_lost_alone(self, tmp_path):
        self.check(run_units(units_of(tmp_path, 2), Broken({"fast": RunError("boom")})))

    @staticmethod
    def check(results):
        results = list(results)
        assert sorted(result.unit.scenario.seed for result in results) == [0, 1]  # each once
        for result in results:
            assert isinstance(result, TrialFailure if result.unit.scenario.seed % 2 else TrialSuccess)
            assert result.unit.variants == VARIANTS
            measured = {}
            for part in result.parts:
                if isinstance(part, TrialSuccess):
                    measured |= part.output.results
                    assert part.seconds >= 0
                else:
                    assert part.unit.variants == ("fast",)
                    assert result.error == f"fast: {part.error}"
            expected = {"full", "no-3dps"} if isinstance(result, TrialFailure) else set(VARIANTS)
            assert set(measured) == expected
            for variant in expected:
                assert measured[variant].scores == made_up(result.unit.scenario, variant).scores

    def test_variants_that_fail_only_together_all_succeed(self, tmp_path):
        (result,) = run_units(units_of(tmp_path, 2)[1:], Broken({"fast": MemoryError()}, least=2))
        assert isinstance(result, TrialSuccess)
        assert tuple(result.output.results) == VARIANTS

    def test_a_failing_variant_costs_one_attempt_for_each_variant(self, tmp_path):
        list(run_units(units_of(tmp_path, 2)[1:], Broken({"fast": RunError("boom")}, tmp_path / "calls")))
        together = f"1 {'+'.join(VARIANTS)}"
        assert (tmp_path / "calls").read_text().splitlines() == [
            *[together] * ATTEMPTS,
            *(f"1 {variant}" for variant in VARIANTS),
        ]

    def test_an_error_of_the_scenario_is_tried_once(self, tmp_path):
        (result,) = run_units(units_of(tmp_path, 2)[1:], Broken({"fast": ValueError("no room")}, tmp_path / "calls"))
        assert (result.error, result.parts) == ("no room", (result,))
        assert len((tmp_path / "calls").read_text().splitlines()) == 1

    def test_a_single_variant_is_not_tried_again_alone(self, tmp_path):
        unit = units_of(tmp_path, 2, variants=("fast",))[1:]
        (result,) = run_units(unit, Broken({"fast": RunError("boom")}, tmp_path / "calls"))
        assert result.error == "boom"
        assert len((tmp_path / "calls").read_text().splitlines()) == ATTEMPTS

    @pytest.mark.parametrize(
        ("errors", "message"),
        [
            (dict.fromkeys(VARIANTS, RunError("dark")), "dark"),
            (dict.fromkeys(VARIANTS[:2], RunError("dark")), "full, fast: dark"),
            ({"full": RunError("dark"), "no-3dps": RunError("lost")}, "full: dark; no-3dps: lost"),
        ],
    )
    def test_errors_are_listed_with_their_variants(self, tmp_path, errors, message):
        (result,) = run_units(units_of(tmp_path, 2)[1:], Broken(errors))
        assert result.error == message


class TestStudies:
    def test_the_other_variants_are_stored_and_the_trial_counts_as_failed_once(self, tmp_path, run):
        recorder = Recorder()
        results = run({"fast": RunError("boom")}, reporter=recorder)
        assert [results.info[key] for key in ("trials", "kept", "run")] == [3, 0, 2]
        assert recorder.stages == [("trials", 3, 0)]
        assert sorted(recorder.steps) == [(1, 0), (1, 0), (1, 1)]
        (failed,) = results.info["failed"]
        assert (failed["seed"], failed["variants"], failed["error"]) == (1, ["fast"], "fast: boom")
        expected = {(seed, variant) for seed in range(3) for variant in VARIANTS} - {(1, "fast")}
        assert set(results.trials.select("seed", "variant").iter_rows()) == expected
        assert results.frames.select("trial", "variant").n_unique() == len(expected)

        store = Store(tmp_path / "out" / "store")
        failures = {variant: store.failure(entry_identity(failed["trial"], variant)) for variant in VARIANTS}
        assert {variant for variant, failure in failures.items() if failure} == {"fast"}
        assert failures["fast"]["error"] == "boom"
        assert failures["fast"]["traceback"].startswith("Traceback")

    def test_the_next_run_tries_what_is_missing_and_no_more(self, tmp_path, run):
        run({"fast": RunError("boom")})
        run.calls.unlink()
        again = run({"fast": RunError("boom")}).info["failed"]
        assert set(run.calls.read_text().splitlines()) == {"1 fast"}
        assert [(each["variants"], each["error"]) for each in again] == [(["fast"], "fast: boom")]
        whole = run({})
        assert [whole.info[key] for key in ("kept", "run", "failed")] == [2, 1, []]
        assert len(whole.trials) == 3 * len(VARIANTS)

    def test_whoever_fails_in_different_ways_is_told_once(self, run):
        (failed,) = run({"fast": RunError("boom"), "full": RunError("bang")}).info["failed"]
        assert failed["variants"] == ["full", "fast"]
        assert failed["error"] == "full: bang; fast: boom"


def test_a_suite_counts_such_a_trial_once(tmp_path, monkeypatch):
    recorder = Recorder()
    monkeypatch.setattr(suite, "measure_beside_reference", Broken({"fast": RunError("boom")}))
    done = suite.run_suite(study_of(tmp_path, variants=VARIANTS, seeds=3), reporter=recorder)
    assert [(each.seed, each.error) for each in done.failed] == [(1, "fast: boom")]
    assert sorted(recorder.steps) == [(1, 0), (1, 0), (1, 1)]
    assert {trial.seed for trial in done.scores} == {0, 2}
