"""Run of a suite: every trial is measured beside the reference kernel."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from numba.core.registry import cpu_target
from threadpoolctl import threadpool_limits

from mvpose.commands.progress import Reporter, Silence
from mvpose.presets import TRACKING, without_repair
from simharness.gate.baseline import FRAMES, TIME, Measurement
from simharness.gate.frame_times import relative_times
from simharness.gate.gate_result import FailedCase
from simharness.gate.trial_command import TrialKey, setting_name, settings_at_seeds
from simharness.runtime.version import code_version
from simharness.scenario.load import Study
from simharness.scenario.sections.method_section import MethodSection
from simharness.scenario.sections.scenario import Scenario
from simharness.study.scheduler import TrialSuccess, Unit, run_units
from simharness.study.stored_trial import StoredTrial, TrialOutput
from simharness.trial.identity import trial_identity
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.estimators import estimators_of
from simharness.trial.stages.networks import ReadFrames

Scores = Mapping[str, float | None]


@dataclass(frozen=True)
class SuiteRun:
    """Scores and failed trials of a suite.

    Attributes:
        scores: scores of each trial: all of the catalogue, ``FRAMES`` and ``TIME``.
        failed: trials that could not be run.
    """

    scores: Mapping[TrialKey, Scores]
    failed: tuple[FailedCase, ...]

    def measurement(self, study: Study) -> Measurement:
        """Return the scores that a baseline keeps."""
        return Measurement(study.name, fingerprint(study), code_version(), processor(), self.scores)


def run_suite(study: Study, *, workers: int = 1, reporter: Reporter | None = None) -> SuiteRun:
    """Run all trials of a study. Nothing is stored, because times of an earlier run cannot be compared.

    Args:
        study: the suite.
        workers: processes that share the trials.
        reporter: receiver of progress, one step for each trial.

    Raises:
        ValueError: fewer than one worker, or a user-defined estimator that cannot be loaded.
    """
    estimators_of(study.base.method)  # report errors now rather than at every trial
    units: dict[str, Unit] = {}
    places: dict[str, list[tuple[str, int]]] = {}  # several settings may resolve to the same scenario
    for setting, seed in settings_at_seeds(study):
        scenario = study.at(setting, seed)
        unit = Unit(trial_identity(scenario), scenario, study.variants)
        units[unit.trial] = unit
        places.setdefault(unit.trial, []).append((setting_name(setting, study), seed))
    scores: dict[TrialKey, Scores] = {}
    failed: list[FailedCase] = []
    with (reporter or Silence()).stage("check", study.trials) as advance:
        for result in run_units(units.values(), measure_beside_reference, workers=workers):
            for case, seed in places[result.unit.trial]:
                if isinstance(result, TrialSuccess):
                    scores |= {TrialKey(case, seed, name): each.scores for name, each in result.output.results.items()}
                else:
                    failed.append(FailedCase(case, seed, result.error))
                advance(1, failed=int(not isinstance(result, TrialSuccess)))
    return SuiteRun(scores, tuple(failed))


def measure_beside_reference(
    scenario: Scenario, variants: Sequence[str], stored: StoredTrial | None = None
) -> TrialOutput:
    """Measure a trial; add its number of frames, ``FRAMES``, and the relative time of a frame, ``TIME``.

    Args:
        scenario: resolved, with its seed.
        variants: variants of the method.
        stored: not used, because stored times cannot be compared.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    trial = run_trial(scenario, variants=variants, until="classify")
    with threadpool_limits(1):
        times = relative_times(trial.detected, trial.pipelines)
    return TrialOutput(
        {
            name: replace(each, scores={**each.scores, FRAMES: float(len(trial.detected.frames)), TIME: times[name]})
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
