"""The check itself: run the suite, compare it with its baseline."""

from __future__ import annotations

import time
from pathlib import Path

from simharness.gate.baseline import Measurement, read_baseline
from simharness.gate.compare import Comparison, compare
from simharness.gate.gate_result import GateResult
from simharness.gate.required_seeds import require_seeds
from simharness.gate.suite import SuiteRun, fingerprint, run_suite
from simharness.gate.trial_command import TrialKey, command_of, setting_name, settings_at_seeds
from simharness.runtime.progress import Reporter
from simharness.scenario.study_definition import Study


def baseline_of(study: Study, path: Path) -> Measurement:
    """Read the baseline of a suite.

    Raises:
        ValueError: there is none, it is damaged, or it is of another suite; or the suite has so few seeds that nothing
            could differ from a baseline significantly.
    """
    require_seeds(study)
    baseline = read_baseline(path)
    now = fingerprint(study)
    if baseline.fingerprint != now:
        raise ValueError(
            f"--baseline {path}: is of the suite {baseline.suite} ({baseline.fingerprint}), and {study.path} is "
            f"{study.name} ({now}): {_what_differs(baseline, study)}; measure this suite with --update-baseline"
        )
    return baseline


def check(study: Study, baseline: Measurement, *, workers: int = 1, reporter: Reporter | None = None) -> GateResult:
    """Run a suite and compare it with its baseline.

    Args:
        study: the suite.
        baseline: from :func:`baseline_of`.
        workers: processes that share the trials.
        reporter: receiver of progress, a step a trial.
    """
    start = time.perf_counter()
    done = run_suite(study, workers=workers, reporter=reporter)
    comparison = compare(baseline, done.measurement(study), study.gate)
    worst = _worst_trial(done, comparison, study.variants[0])
    return GateResult(
        suite=study.name,
        variants=study.variants,
        gate=study.gate,
        comparison=comparison,
        failed=done.failed,
        trials=study.trials,
        worst=worst,
        command=command_of(study, worst),
        seconds=time.perf_counter() - start,
    )


def _worst_trial(done: SuiteRun, comparison: Comparison, variant: str) -> TrialKey:
    """The trial to look at: one that could not be run, one that lost most, or else that of the lowest PCP."""
    if done.failed:
        return TrialKey(done.failed[0].case, done.failed[0].seed, variant)
    if worse := comparison.with_verdict("worse"):
        return worse[0].worst
    scores = {trial: scores["pcp"] for trial, scores in done.scores.items() if trial.variant == variant}
    return min(scores, key=lambda trial: (scores[trial] is None, scores[trial] or 0.0))


def _what_differs(baseline: Measurement, study: Study) -> str:
    """In a few words."""
    now = {
        TrialKey(setting_name(setting, study), seed, name)
        for setting, seed in settings_at_seeds(study)
        for name in study.variants
    }
    gone, new = sorted(baseline.scores.keys() - now), sorted(now - baseline.scores.keys())
    said = [
        f"{len(trials)} trials {what}, the first {trials[0]}"
        for trials, what in ((gone, "are only in the baseline"), (new, "are not in it"))
        if trials
    ]
    return " and ".join(said) or "the trials have the same names, but other settings"
