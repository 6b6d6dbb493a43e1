"""One trial from its scenario to its scores: build, capture, audit, detect, read, estimate, score, classify, blame.

Every command runs trials through :func:`run_trial`: ``run``, ``render``, ``export``, ``study``, ``check``,
``evaluate``, :func:`simharness.api.assert_robust` and the Python interface. Stages whose results are known
already, such as those of a stored trial, are given as :class:`Known` and left out.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
import polars as pl
import threadpoolctl

from mvpose import Estimate
from mvpose.commands.progress import Reporter, Silence, Stages, counted
from mvpose.estimators import Estimator
from mvpose.presets import PRESETS
from mvpose.wholebody import complete
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import Assessment, assess
from simharness.scoring.catalogue import SCORES
from simharness.scoring.failure_classes import find_failures
from simharness.scoring.feet_and_hands import WholeBodyInput
from simharness.scoring.stage_blame import blame_frames, failure_scores, failure_table
from simharness.trial.audit import audit
from simharness.trial.kernel_compilation import Compilation
from simharness.trial.needs import require_memory
from simharness.trial.stages.build_trial import Trial, build_trial, build_variants
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.estimation import EstimateFrames, estimate_variants
from simharness.trial.stages.simulation import Simulation, capture_trial, detect_trial
from simharness.trial.variant_result import VariantResult
from simharness.types.recording import Recording

Goal = Literal["detect", "estimate", "score", "classify", "blame"]
"""Last requested stage of a trial. ``classify`` finds failures, ``blame`` the stage of the method to blame."""

_GOALS: tuple[str, ...] = get_args(Goal)


@dataclass(frozen=True)
class Known:
    """Results of stages that need not run again."""

    detected: DetectedSequence | None = None
    """Detections and truth of the trial; None where they have to be simulated."""
    estimates: Mapping[str, Sequence[Estimate]] = field(default_factory=dict)
    """Estimates by variant. They need the detections that they were made from."""
    failures: Mapping[str, pl.DataFrame] = field(default_factory=dict)
    """Table of failures by variant, from the last requested stage."""


@dataclass(frozen=True)
class TrialResult:
    """Result of a trial up to its goal."""

    scenario: Scenario
    """The resolved scenario at its seed."""
    detected: DetectedSequence
    """Detections, which the method was given, and the truth."""
    simulation: Simulation | None
    """Scene and views from which detections were made; None where detections were known."""
    pipelines: Mapping[str, Estimator] = field(default_factory=dict)
    """Variants of the method by name."""
    estimates: Mapping[str, tuple[Estimate, ...]] = field(default_factory=dict)
    """Estimates of each variant, one for each frame; empty before the goal ``estimate``."""
    whole: Mapping[str, tuple[Estimate, ...]] = field(default_factory=dict)
    """The same people with feet and hands, where the detector reports them; empty otherwise."""
    assessments: Mapping[str, Assessment] = field(default_factory=dict)
    """Scores of each variant; empty before the goal ``score``."""
    failures: Mapping[str, pl.DataFrame] = field(default_factory=dict)
    """Table of failures of each variant; empty before the goal ``classify``."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Duration of each stage that ran."""

    @property
    def trial(self) -> Trial:
        """The built scenario.

        Raises:
            ValueError: the detections were known, so nothing was built.
        """
        if self.simulation is None:
            raise ValueError("this trial was not simulated, because its detections were known")
        return self.simulation.trial

    @property
    def recording(self) -> Recording:
        """The input of scoring."""
        return self.detected.recording

    @property
    def results(self) -> dict[str, VariantResult]:
        """Scores and tables by variant, from the goal ``classify`` on."""
        results = {}
        for variant, table in self.failures.items():
            assessment = self.assessments[variant]
            scores = {**assessment.scores, **failure_scores(table, len(self.detected.time))}
            ordered = {key: scores[key] for key in SCORES}
            results[variant] = VariantResult(ordered, assessment.frames, assessment.people, table)
        return results


def run_trial(
    scenario: Scenario,
    *,
    variants: Sequence[str] | None = None,
    until: Goal = "blame",
    workers: int = 1,
    previews: Collection[int] = (),
    compile_ahead: bool = False,
    known: Known | None = None,
    reporter: Reporter | None = None,
    every: int = 1,
) -> TrialResult:
    """Run a trial up to a goal. All variants get the same detections.

    Every trial that is simulated is audited (:mod:`simharness.trial.audit`) before its detections are made.

    Args:
        scenario: a resolved scenario with its seed.
        variants: variants of the method; the scenario's by default.
        until: last requested stage.
        workers: number of processes that share the frames; the results do not depend on it.
        previews: frames whose colour pictures are kept in the views.
        compile_ahead: compile the kernels of the method, and some of pictures, in a second process while this one
            builds and simulates.
        known: results of stages that need not run again.
        reporter: receiver of progress.
        every: step between the frames whose detections are needed; the others get pictures of those, as of a camera
            that stood still. Only for goals up to "detect".

    Raises:
        ValueError: the scenario cannot be built at this seed or needs more memory than the machine has, or the goal is
            unknown.
        RunError: any error after that, with the stage in front; :class:`simharness.trial.audit.AuditError` where the
            trial is not what the scenario describes.
    """
    if until not in _GOALS:
        raise ValueError(f"until must be one of {', '.join(_GOALS)}, got {until!r}")
    if variants is not None:
        scenario = with_variants(scenario, variants)
    known = known or Known()
    stages = Stages(reporter or Silence())
    goal = _GOALS.index(until)
    with threadpoolctl.threadpool_limits(1):  # matrices are small: threads would only compete
        if known.detected is None:
            require_memory([scenario])
            simulation, detected, pipelines = _simulate(
                scenario, stages, workers, previews, compile_ahead and goal >= _GOALS.index("estimate"), every
            )
        else:
            simulation, detected = None, known.detected
            with stages.stage("build", 1, input_errors=True):
                pipelines = build_variants(scenario)
        result = TrialResult(scenario, detected, simulation, pipelines, seconds=stages.seconds)
        if goal >= _GOALS.index("estimate"):
            result = replace(
                result, estimates=estimate_variants(detected, pipelines, stages, known=known.estimates, workers=workers)
            )
            result = replace(result, whole=_with_feet_and_hands(result, stages))
        if goal >= _GOALS.index("score"):
            result = replace(result, assessments=_score(result, stages))
        if goal >= _GOALS.index("classify"):
            result = replace(
                result, failures=_find_failures(result, pipelines, known.failures, until == "blame", stages)
            )
    return result


def with_variants(scenario: Scenario, variants: Sequence[str]) -> Scenario:
    """Return the scenario with other variants of the method."""
    return scenario.model_copy(
        update={"method": scenario.method.model_copy(update={"variants": tuple(dict.fromkeys(variants))})}
    )


def _simulate(
    scenario: Scenario, stages: Stages, workers: int, previews: Collection[int], compile_ahead: bool, every: int
) -> tuple[Simulation, DetectedSequence, Mapping[str, Estimator]]:
    """Run the stages from the build to the detections."""
    compilation = None
    if compile_ahead:
        drawn = bool(previews) and scenario.rendering.renderer in ("raster", "auto")
        compilation = Compilation(set(scenario.method.variants) & PRESETS.keys(), pictures=drawn)
        compilation.start()
    with stages.stage("build", 1, input_errors=True):
        trial = build_trial(scenario)
    shown = np.arange(scenario.frames)[:, None]
    if ((trial.exposures.source != shown) & trial.exposures.delivered).any():  # pictures of other frames
        every = 1
    simulation = capture_trial(trial, stages, workers=workers, previews=previews, every=every)
    with stages.stage("audit", 1):
        audit(scenario, trial.scene, trial.exposures, simulation.sequence, simulation.views, every=every)
    detected = detect_trial(simulation, stages, workers=workers, every=every)
    if compilation is not None:
        with stages.stage("compile", 1):
            compilation.wait()
    return simulation, detected, trial.pipelines


def _with_feet_and_hands(result: TrialResult, stages: Stages) -> dict[str, tuple[Estimate, ...]]:
    """Return the people of all variants on the skeleton of the detector; none where it reports COCO17 alone.

    The other joints are triangulated from the detections of each person, after and apart from the body.
    """
    frames = [frame.whole for frame in result.detected.frames]
    if any(frame is None for frame in frames):
        return {}
    whole, rig = {}, result.detected.rig
    with stages.stage("whole body", len(result.estimates)) as advance:
        for variant, estimates in counted(result.estimates.items(), advance):
            pairs = zip(frames, estimates, strict=True)
            whole[variant] = tuple(complete(rig, frame.detections, body) for frame, body in pairs if frame is not None)
    return whole


def _whole_body(result: TrialResult, variant: str) -> WholeBodyInput | None:
    """Return what the scores of feet and hands of a variant need; None where there are none."""
    frames = [frame.whole for frame in result.detected.frames]
    if variant not in result.whole:
        return None
    skeleton = next(frame.detections.skeleton for frame in frames if frame is not None)
    return WholeBodyInput(
        skeleton,
        np.stack([frame.joints for frame in frames if frame is not None]),
        [estimate.joints for estimate in result.whole[variant]],
    )


def _score(result: TrialResult, stages: Stages) -> dict[str, Assessment]:
    with stages.stage("score", len(result.estimates)) as advance:
        return {
            variant: assess(result.recording, estimates, whole=_whole_body(result, variant))
            for variant, estimates in counted(result.estimates.items(), advance)
        }


def _find_failures(
    result: TrialResult,
    pipelines: Mapping[str, Estimator],
    known: Mapping[str, pl.DataFrame],
    blamed: bool,
    stages: Stages,
) -> dict[str, pl.DataFrame]:
    tables = {}
    with stages.stage("blame" if blamed else "classify", len(result.estimates)) as advance:
        for variant, estimates in counted(result.estimates.items(), advance):
            if variant in known:
                tables[variant] = known[variant]
            elif blamed:
                inputs = EstimateFrames(result.detected.rig, result.detected.frames, pipelines)
                blamed_failures = blame_frames(
                    result.recording, pipelines[variant], estimates, partial(inputs.input_of, variant=variant)
                )
                tables[variant] = failure_table(blamed_failures)
            else:
                tables[variant] = failure_table(find_failures(result.recording, estimates))
    return tables
