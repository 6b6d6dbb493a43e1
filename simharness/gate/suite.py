"""A suite run once: every trial measured, beside the reference kernel."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from simharness.gate.baseline import TIME, Measurement
from simharness.gate.gate_result import Failed
from simharness.gate.reference_kernel import time_reference
from simharness.gate.trial_command import Trial, name_of, scenes_of
from simharness.scenario.load import code_version
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.study_definition import Study
from simharness.study.scheduler import Success, Unit, work_off
from simharness.trial.identity import trial_identity
from simharness.trial.measure import Measured, measure
from simharness.trial.stages.estimators import estimators_of

Scores = Mapping[str, float | None]


@dataclass(frozen=True)
class SuiteRun:
    """What became of the trials of a suite.

    Attributes:
        scores: of each trial: all of the catalogue, and ``TIME``.
        failed: the trials that could not be run.
    """

    scores: Mapping[Trial, Scores]
    failed: tuple[Failed, ...]

    def measurement(self, study: Study) -> Measurement:
        """What a baseline keeps of it."""
        return Measurement(study.name, fingerprint(study), code_version(), self.scores)


def run_suite(study: Study, *, workers: int = 1, progress: Callable[[int], None] = lambda trials: None) -> SuiteRun:
    """Run all trials of a study. Nothing is stored: times of another day would say nothing.

    Args:
        study: the suite.
        workers: processes that share the trials.
        progress: is told of every trial that is done.

    Raises:
        ValueError: fewer than one worker, or a method of one's own that cannot be loaded.
    """
    estimators_of(study.base.method)  # better now than at every trial
    units: dict[str, Unit] = {}
    places: dict[str, list[tuple[str, int]]] = {}  # two settings may come to the same scenario
    for setting, seed in scenes_of(study):
        scenario = study.at(setting, seed)
        unit = Unit(trial_identity(scenario), scenario, study.variants)
        units[unit.trial] = unit
        places.setdefault(unit.trial, []).append((name_of(setting, study), seed))
    scores: dict[Trial, Scores] = {}
    failed: list[Failed] = []
    for result in work_off(units.values(), measure_beside_reference, workers=workers):
        for case, seed in places[result.unit.trial]:
            if isinstance(result, Success):
                scores |= {Trial(case, seed, name): each.scores for name, each in result.measured.items()}
            else:
                failed.append(Failed(case, seed, result.error))
            progress(1)
    return SuiteRun(scores, tuple(failed))


def measure_beside_reference(scenario: Scenario, variants: Sequence[str]) -> dict[str, Measured]:
    """Measure a trial, and time the reference kernel before and after: its scores get ``TIME``.

    That is the time of the quickest frame by the quickest call. On a busy machine medians are those of whoever else
    works; under four times its load the same trial's ratio of medians differed by a factor of 1.9, typically, in two
    runs, and that of the quickest by one of 1.15.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: anything that went wrong after that.
    """
    before = time_reference()
    measured = measure(scenario, variants, blame=False)
    reference = min(before.min(), time_reference().min())
    return {
        name: replace(each, scores={**each.scores, TIME: each.frames["time_ms"].min() / reference})
        for name, each in measured.items()
    }


def fingerprint(study: Study) -> str:
    """Ten hexadecimal digits that change with what a study runs: its settings, their files, its seeds and variants.

    Not with names, nor with keys that a later version adds: only what differs from a default counts.
    """
    said = {
        "settings": {
            name_of(setting, study): setting.scenario.model_dump(
                mode="json", exclude_defaults=True, exclude={"name", "description", "seed", "method"}
            )
            for setting in study.settings
        },
        "seeds": study.seeds,
        "variants": study.variants,
    }
    text = json.dumps(said, sort_keys=True)
    digest = hashlib.blake2b(digest_size=5)
    for file in sorted({file for setting in study.settings for file in setting.scenario.files}):
        text = text.replace(json.dumps(str(file)), json.dumps(file.name))  # wherever the repository lies
        digest.update(file.read_bytes() if file.is_file() else b"")
    digest.update(text.encode())
    return digest.hexdigest()
