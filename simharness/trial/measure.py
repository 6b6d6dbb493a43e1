"""One trial: a scenario built, filmed, detected once, estimated by every variant, and scored."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import threadpoolctl

from mvpose import Estimate
from simharness.runtime.frame_pool import RunError
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import assess
from simharness.scoring.catalogue import SCORES
from simharness.scoring.failures import Failure, failures_of_frame, find_failures
from simharness.scoring.stage_blame import Blamed, failure_scores, failure_table
from simharness.scoring.stage_blame import blame as find_stages
from simharness.trial.looking import look
from simharness.trial.stages.build import Trial, prepare
from simharness.trial.stages.frame_tasks import Estimating, naming_frame
from simharness.trial.trial_result import Measured
from simharness.types.recording import Recording

__all__ = ["Measured", "measure"]


def measure(scenario: Scenario, variants: Sequence[str] | None = None, *, blame: bool = True) -> dict[str, Measured]:
    """Measure variants of the method in one trial, all on the same detections, in this process.

    Args:
        scenario: resolved, with its seed.
        variants: of the method; the scenario's if not given.
        blame: find the stage of every failure.

    Returns:
        What each variant did.

    Raises:
        ValueError: the scenario cannot be built at this seed.
        RunError: anything that went wrong after that, which is its cause, if it is no RunError.
    """
    if variants is not None:
        scenario = scenario.model_copy(
            update={"method": scenario.method.model_copy(update={"variants": tuple(variants)})}
        )
    with threadpoolctl.threadpool_limits(1):
        trial = prepare(scenario)
        try:
            return _measure(trial, blame)
        except RunError:
            raise
        except Exception as error:
            raise RunError(f"{type(error).__name__}: {error}") from error


def _measure(trial: Trial, blame: bool) -> dict[str, Measured]:
    sequence, detected = look(trial)
    estimating = Estimating(trial.shots.believed, tuple(detected), trial.pipelines)
    recording = Recording(
        sequence.time,
        trial.shots.believed,
        tuple(each.detections for each in detected),
        tuple(each.truth for each in detected),
    )
    measured = {}
    for variant, estimates in estimating(range(len(detected))).items():
        assessment = assess(recording, estimates)
        failures: Iterable[Failure | Blamed] = (
            _stages(recording, estimating, variant, estimates) if blame else find_failures(recording, estimates)
        )
        table = failure_table(failures)
        scores = {**assessment.scores, **failure_scores(table, len(recording))}
        measured[variant] = Measured({key: scores[key] for key in SCORES}, assessment.frames, assessment.people, table)
    return measured


def _stages(
    recording: Recording, estimating: Estimating, variant: str, estimates: Sequence[Estimate]
) -> Iterator[Blamed]:
    """The failures of a variant and their stages. A frame at a time, for the heat maps of all of them are large."""
    for frame, (truth, estimate) in enumerate(zip(recording.truth, estimates, strict=True)):
        if failures := failures_of_frame(recording.rig, recording.detections[frame], truth, estimate):
            seen = estimating.seen(frame, variant)
            moment = Recording(recording.time[[frame]], recording.rig, (seen,), (truth,))
            with naming_frame(frame):
                stages = find_stages(moment, estimating.pipelines[variant], [estimate], failures)
            for blamed in stages:
                yield replace(blamed, failure=replace(blamed.failure, frame=frame))
