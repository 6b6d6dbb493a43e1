"""Gate check: run a suite and compare it with its baseline."""

from __future__ import annotations

import time
from pathlib import Path

from mvpose.commands.progress import Reporter
from simharness.gate.baseline import Measurement, read_baseline
from simharness.gate.compare import Comparison, compare
from simharness.gate.gate_result import GateResult
from simharness.gate.required_seeds import require_seeds
from simharness.gate.suite import SuiteRun, fingerprint, run_suite
from simharness.gate.trial_command import TrialKey, command_of, setting_name, settings_at_seeds
from simharness.scenario.load import Study


def baseline_of(study: Study, path: Path) -> Measurement:
    """Read the baseline of a suite.

    Raises:
        ValueError: the file is missing, damaged, or the baseline of another suite; or the suite has so few seeds that
            no change could be significant.
    """
    require_seeds(study)
    baseline = read_baseline(path)
    now = fingerprint(study)
    if baseline.fingerprint != now:
        raise ValueError(
            f"--baseline {path}: this is the baseline of suite {baseline.suite} ({baseline.fingerprint}), but "
            f"{study.path} is suite {study.name} ({now}): {_describe_differences(baseline, study)}; write a baseline "
            "of this suite with --update-baseline"
        )
    return baseline


def check(
    study: Study,
    baseline: Measurement,
    *,
    workers: int = 1,
    accept_better: bool = False,
    reporter: Reporter | None = None,
) -> GateResult:
    """Run a suite and compare it with its baseline.

    Args:
        study: the suite.
        baseline: from :func:`baseline_of`.
        workers: processes that share the trials.
        accept_better: whether unexpected improvements fail nothing.
        reporter: receiver of progress, one step for each trial.
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
        accept_better=accept_better,
    )


def _worst_trial(done: SuiteRun, comparison: Comparison, variant: str) -> TrialKey:
    """Return the trial to inspect first: one that could not be run, else the largest loss, else the lowest PCP."""
    if done.failed:
        return TrialKey(done.failed[0].case, done.failed[0].seed, variant)
    if worse := comparison.with_verdict("worse"):
        return worse[0].worst
    scores = {trial: scores["pcp"] for trial, scores in done.scores.items() if trial.variant == variant}
    return min(scores, key=lambda trial: (scores[trial] is None, scores[trial] or 0.0))


def _describe_differences(baseline: Measurement, study: Study) -> str:
    """Return in a few words how the trials of a suite and a baseline differ."""
    now = {
        TrialKey(setting_name(setting, study), seed, name)
        for setting, seed in settings_at_seeds(study)
        for name in study.variants
    }
    gone, new = sorted(baseline.scores.keys() - now), sorted(now - baseline.scores.keys())
    parts = [
        f"{len(trials)} trials {what}, the first {trials[0]}"
        for trials, what in ((gone, "are only in the baseline"), (new, "are not in it"))
        if trials
    ]
    return " and ".join(parts) or "the trials have the same names, but different settings"
