"""Run of a suite: every trial is measured beside the reference kernel, and compared with the baseline."""

import contextlib
import hashlib
import json
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numba.core.registry import cpu_target
from threadpoolctl import threadpool_limits

from mvpose.commands.progress import Reporter
from mvpose.kernel_lock import locked
from mvpose.presets import TRACKING, without_repair
from simharness.gate.baseline import DETECTED, FRAMES, TIME, Measurement, read_baseline
from simharness.gate.compare import Comparison, FailedCase, GateResult, compare
from simharness.gate.frame_times import relative_times
from simharness.gate.score_tests import require_seeds
from simharness.gate.trial_command import TrialKey, command_of, setting_name
from simharness.runtime.version import code_version
from simharness.scenario.document import find_scenario
from simharness.scenario.load import Study
from simharness.scenario.sections.method_section import MethodSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.shipped import shipped_folder
from simharness.study.stored_trial import StoredTrial, TrialOutput
from simharness.study.study_folder import plan
from simharness.study.study_run import run_planned, stored_entries
from simharness.study.trial_store import Store
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.estimators import estimators_of
from simharness.trial.stages.networks import ReadFrames

Scores = Mapping[str, float | None]


@dataclass(frozen=True)
class SuiteRun:
    """Scores and failed trials of a suite."""

    scores: Mapping[TrialKey, Scores]
    """Scores of each trial: all of the catalogue, ``FRAMES`` and ``TIME``."""
    failed: tuple[FailedCase, ...]
    """Trials that could not be run."""

    def measurement(self, study: Study) -> Measurement:
        """Return the scores that a baseline keeps."""
        return Measurement(study.name, fingerprint(study), code_version(), processor(), self.scores)


def run_suite(
    study: Study, *, workers: int = 1, reporter: Reporter | None = None, store: Path | None = None
) -> SuiteRun:
    """Run all trials of a study.

    Args:
        study: the suite.
        workers: processes that share the trials.
        reporter: receiver of progress, one step for each trial.
        store: folder of trials that an interrupted run has finished, from :func:`kept_trials`; nothing is kept without.

    Raises:
        ValueError: fewer than one worker, or a user-defined estimator that cannot be loaded.
        Interrupted: Ctrl-C. Finished trials stay in the store.
    """
    estimators_of(study.base.method)  # report errors now rather than at every trial
    planned = plan(study)
    with tempfile.TemporaryDirectory() as spare:
        opened = Store(store or Path(spare) / "trials")
        outcome = run_planned(planned, opened, workers=workers, reporter=reporter, measure=measure_beside_reference)
        errors = {each.trial: each.error for each in outcome.failed}
        scores = {
            TrialKey(setting_name(each.setting, study), each.seed, entry.variant): entry.result.scores
            for each in planned
            if each.trial not in errors
            for entry in stored_entries(opened, each)
        }
    failed = [
        FailedCase(setting_name(each.setting, study), each.seed, errors[each.trial])
        for each in planned
        if each.trial in errors
    ]
    return SuiteRun(scores, tuple(failed))


@contextlib.contextmanager
def kept_trials(study: Study, baseline: Path) -> Iterator[Path | None]:
    """Give the store of a suite's finished trials, which stays if the run of the suite ends early, and only then.

    It lies beside the baseline. The next run continues, unless suite, code or processor have changed: times are
    relative to a reference that is measured with each trial, so those of one machine can be compared.

    Yields:
        The folder; None where it cannot be written, or another run of the suite is using it.
    """
    place = baseline.parent / f".{baseline.name}.trials"
    with contextlib.suppress(OSError):
        place.mkdir(exist_ok=True)
        (place / ".gitignore").write_text("*\n")
    with locked(place / "lock", patience=0.0) as alone:
        made_by = hashlib.blake2b(f"{fingerprint(study)} {code_version()} {processor()}".encode(), digest_size=8)
        yield place / made_by.hexdigest() if alone else None
        if alone:
            shutil.rmtree(place)


def measure_beside_reference(
    scenario: Scenario, variants: Sequence[str], stored: StoredTrial | None = None
) -> TrialOutput:
    """Measure a trial; add its number of frames, ``FRAMES``, ``DETECTED``, and the relative time of a frame, ``TIME``.

    Args:
        scenario: resolved, with its seed.
        variants: variants of the method.
        stored: not used: all variants are timed on detections of this run.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    trial = run_trial(scenario, variants=variants, until="classify")
    with threadpool_limits(1):
        times = relative_times(trial.detected, trial.pipelines)
    pixels = np.concatenate([each.detections.keypoints.ravel() for each in trial.detected.frames])
    detected = float(np.nanmean(pixels)) if np.isfinite(pixels).any() else None
    added = {FRAMES: float(len(trial.detected.frames)), DETECTED: detected}
    return TrialOutput(
        {
            name: replace(each, scores={**each.scores, **added, TIME: times[name]})
            for name, each in trial.results.items()
        }
    )


def processor() -> str:
    """Return the kind of this machine's processor, for which kernels are compiled, for example "sapphirerapids"."""
    _, name, _ = cpu_target.target_context.codegen().magic_tuple()
    return str(name)


def fingerprint(study: Study) -> str:
    """Return ten hexadecimal digits that change with the settings of a study, their files, its seeds and variants.

    Names do not count, nor do keys with default values, so that keys added by a later version change nothing; nor does
    the sensor where nothing reads pictures.
    """
    values = {
        "settings": {
            setting_name(setting, study): setting.scenario.model_dump(
                mode="json", exclude_defaults=True, exclude=_exclude(setting.scenario)
            )
            for setting in study.settings
        },
        "seeds": study.seeds,
        "variants": study.variants,
    }
    lags = {setting.scenario.method.lag for setting in study.settings}
    if TRACKING.intersection(map(without_repair, study.variants)) and lags != {MethodSection().lag}:
        values["lags"] = [setting.scenario.method.lag for setting in study.settings]
    text = json.dumps(values, sort_keys=True)
    digest = hashlib.blake2b(digest_size=5)
    for file in sorted({file for setting in study.settings for file in setting.scenario.files}):
        text = text.replace(json.dumps(str(file)), json.dumps(file.name))  # independent of the folder
        digest.update(file.read_bytes() if file.is_file() else b"")
    digest.update(text.encode())
    return digest.hexdigest()


def _exclude(scenario: Scenario) -> set[str]:
    """Return the sections of a scenario that cannot change its results, or that count elsewhere."""
    sensor = set() if ReadFrames.needed(scenario) else {"sensor"}
    return {"name", "description", "seed", "method"} | sensor


def shipped_baseline(study: Study) -> Path:
    """Return the file of the baseline that ships with a suite.

    Raises:
        ValueError: the suite does not ship, or has no baseline.
    """
    scenarios, suite = shipped_folder().resolve(), find_scenario(study.path).resolve()
    file = scenarios / "baselines" / f"{suite.stem}.json"
    if suite.parent != scenarios or not file.exists():
        names = ", ".join(sorted(each.stem for each in file.parent.glob("*.json")))
        raise ValueError(
            f"--baseline: no baseline ships with {study.path}, only with {names}; write one: --baseline "
            f"{study.name}.json --update-baseline"
        )
    return file


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
    store: Path | None = None,
) -> GateResult:
    """Run a suite and compare it with its baseline.

    Args:
        study: the suite.
        baseline: from :func:`baseline_of`.
        workers: processes that share the trials.
        accept_better: whether unexpected improvements fail nothing.
        reporter: receiver of progress, one step for each trial.
        store: as :func:`run_suite`.
    """
    start = time.perf_counter()
    done = run_suite(study, workers=workers, reporter=reporter, store=store)
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
        for setting in study.settings
        for seed in study.seeds
        for name in study.variants
    }
    gone, new = sorted(baseline.scores.keys() - now), sorted(now - baseline.scores.keys())
    parts = [
        f"{len(trials)} trials {what}, the first {trials[0]}"
        for trials, what in ((gone, "are only in the baseline"), (new, "are not in it"))
        if trials
    ]
    return " and ".join(parts) or "the trials have the same names, but different settings"
