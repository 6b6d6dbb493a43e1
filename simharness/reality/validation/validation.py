"""Validation of the twins of a recording: everything that simulation predicts, beside what was recorded.

Also predictions of frames and recordings that a fit has not seen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from mvpose.commands.errors import RunError
from mvpose.commands.progress import Reporter, Silence
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.fit import fit
from simharness.reality.twin import TwinModel, detected_twin, simulate_twins
from simharness.reality.validation import variant_comparison
from simharness.reality.validation.corrected_forecast import CorrectionStudy, study_corrections
from simharness.reality.validation.evidence import Evidence
from simharness.reality.validation.input_checks import check_recording
from simharness.reality.validation.passes import (
    VARIANTS,
    CameraSubset,
    RecordingChange,
    Unchanged,
    annotated,
    run_passes,
)
from simharness.reality.validation.skill import Forecasts, RankAgreement, Skill, agreements, forecast_groups, skills
from simharness.reality.validation.treatments import treatments
from simharness.reality.validation.twin_distance import TwinDistance
from simharness.reality.validation.verdicts import (
    BOUNDS,
    PREDICTION_BOUNDS,
    Bounds,
    BoundVerdict,
    VerdictState,
    judge_responses,
    judge_subsets,
)
from simharness.reality.validation.whole_comparison import WholeComparison, compare_whole, measure_recordings
from simharness.scenario.presets import read_profile
from simharness.scoring.frame_scores import RULES


@dataclass(frozen=True)
class ValidationPlan:
    """Extent of a validation."""

    every: int = 1
    """Every n-th annotated frame of the recording is used."""
    twin_every: int = 3
    """The same for subsets and treatments of twins, of which there are several; all else takes every frame that
    ``every`` leaves."""
    draws: int = 8
    """Number of draws of calibration errors."""
    detection_draws: int = 3
    """Number of draws of the errors of detections."""
    treated: bool = True
    """Whether treatments are compared."""
    variants: tuple[str, ...] = VARIANTS
    """Names of presets."""
    workers: int = 1
    """Number of processes."""


QUICK = ValidationPlan(every=3, twin_every=6, draws=3, detection_draws=1)
"""Plan for a first look: a third of the frames."""


@dataclass(frozen=True)
class Validation:
    """Comparison of a recording with its twins, and verdicts."""

    recording: AnnotatedRecording
    """The recording, with the frames that were used."""
    twins: int
    """Number of twins."""
    twin_frames: float
    """Number of frames of a twin, mean."""
    plan: ValidationPlan
    """Extent."""
    whole: WholeComparison
    """Comparison with all cameras."""
    subsets: variant_comparison.SubsetComparison
    """PCP with some of the cameras, missing joints of the face filled from the others."""
    responses: Sequence[variant_comparison.DoseResponse]
    """Losses by treatment, level and variant."""
    forecasts: Mapping[str, Mapping[str, Forecasts]]
    """Conditions by group, ``losses`` and ``subsets``, and variant."""
    skills: Sequence[Skill]
    """Error over these conditions, and skill against rivals."""
    agreements: Sequence[RankAgreement]
    """Correlations and rank violations over all conditions, by variant."""
    corrections: CorrectionStudy | None
    """Forecasts corrected by a few real frames; None for a recording with too few."""
    distance: TwinDistance
    """Distance of the recording from the twins over all figures at once."""
    verdicts: Sequence[BoundVerdict] = field(default=())
    """Verdicts."""

    @property
    def failed(self) -> list[BoundVerdict]:
        """Verdicts that fail."""
        return [verdict for verdict in self.verdicts if verdict.state == VerdictState.FAILS]


def validate(
    recording: AnnotatedRecording,
    twins: Sequence[AnnotatedRecording],
    *,
    profile: AnnotatedRecording | None = None,
    other: Mapping[str, float] | None = None,
    plan: ValidationPlan | None = None,
    bounds: Bounds = BOUNDS,
    reporter: Reporter | None = None,
) -> Validation:
    """Compare a recording with its twins.

    Args:
        recording: the recording.
        twins: its twins, each of another seed, with the same cameras.
        profile: a twin whose detector is a shipped profile: a rival of the others. None: no such rival.
        other: figures of another recording, another rival (:func:`.read_other_figures`).
        plan: extent; by default the whole.
        bounds: bounds of the verdicts.
        reporter: receiver of progress.

    Raises:
        ValueError: no twins, a twin with another number of cameras, or what :func:`.check_recording` refuses.
        RunError: a twin in which nobody is found.
    """
    plan, reporter = plan or ValidationPlan(), reporter or Silence()
    _check(recording, twins)
    real = annotated(recording, every=plan.every)
    whole = [annotated(twin, every=plan.every) for twin in twins]
    thinned = [annotated(twin, every=plan.twin_every) for twin in twins]

    measured = measure_recordings([real, *whole], variants=plan.variants, workers=plan.workers, reporter=reporter)
    for twin in measured[1:]:
        if not any(by_rule[RULES[0]].found.any() for by_rule in twin.scores.values()):
            raise RunError(
                f"{twin.recording.name}: expected a twin in which the method finds people, got nobody in "
                f"{len(twin.recording)} frames: nothing can be compared; look at the fit with simharness fit-detector"
            )
    changes: list[RecordingChange] = [Unchanged(), *map(CameraSubset, variant_comparison.camera_subsets(len(real.rig)))]
    changes += treatments(draws=plan.draws, detection_draws=plan.detection_draws) if plan.treated else ()
    rivals = [] if profile is None else [annotated(profile, every=plan.twin_every)]
    given = [real, *rivals, *thinned]
    with reporter.stage("subsets and treatments", len(changes) * len(given)) as advance:
        passes = run_passes(given, changes, variants=plan.variants, workers=plan.workers, progress=advance)
    evidence = Evidence.of_tallies(real, passes[0], passes[1 + len(rivals) :], passes[1] if rivals else None)
    compared = compare_whole(measured[0], measured[1:])
    subsets = variant_comparison.compare_subsets(evidence, len(real.rig), plan.variants)
    responses = variant_comparison.compare_responses(evidence, plan.variants)
    forecasts = forecast_groups(subsets, responses, plan.variants, other=other)
    return Validation(
        recording=real,
        twins=len(twins),
        twin_frames=float(np.mean([len(twin) for twin in whole])),
        plan=plan,
        whole=compared,
        subsets=subsets,
        responses=responses,
        forecasts=forecasts,
        skills=skills(forecasts),
        agreements=agreements(subsets, responses, plan.variants),
        corrections=study_corrections(
            passes[0], passes[1 + len(rivals) :], np.flatnonzero(np.isin(real.frames, thinned[0].frames)).tolist()
        ),
        distance=compared.distance,
        verdicts=[
            *compared.verdicts(real.kind, bounds),
            *judge_subsets(subsets, bounds),
            *judge_responses(responses, bounds),
        ],
    )


def _check(recording: AnnotatedRecording, twins: Sequence[AnnotatedRecording]) -> None:
    if not twins:
        raise ValueError(f"{recording.name}: expected one or more twins to compare with, got none")
    for each in (recording, *twins):
        if len(each.rig) != len(recording.rig):
            raise ValueError(
                f"{each.name}: expected a twin with the {len(recording.rig)} cameras of {recording.name}, "
                f"got {len(each.rig)}"
            )
        check_recording(each)


_HALVES = ("first half", "second half")
_PREDICTED = ("pcp", "subset_mean")  # groups of verdicts that hold for other frames than those of the fit


@dataclass(frozen=True)
class HalfPrediction:
    """Prediction of one half of a recording from a fit to the other."""

    half: str
    """The predicted half."""
    validation: Validation
    """The half beside its twins, without treatments."""

    @property
    def verdicts(self) -> list[BoundVerdict]:
        """Verdicts on what the fit predicts: PCP of each variant, and with subsets of the cameras."""
        return [
            replace(each, group="split_half", name=f"split_half.{self.half.split()[0]}.{each.name}")
            for each in self.validation.verdicts
            if each.group in _PREDICTED
        ]


class SimulatedTwins(NamedTuple):
    """Twins of a recording, and one of a detector that was not fitted."""

    fitted: list[AnnotatedRecording]
    """Twins with the fitted detector."""
    profile: AnnotatedRecording
    """Twin of the first film with the shipped profile of the kind of the detector."""


SHIPPED = {"top-down": "topdown", "bottom-up": "typical"}
"""Shipped profile by kind of detector."""


def twin_model(recording: AnnotatedRecording, *, fitted_on: AnnotatedRecording | None = None) -> TwinModel:
    """Fit a detector and return what the twins of a recording are made from.

    Args:
        recording: the recording: its rig, its people, and how they are annotated.
        fitted_on: recording to which the detector is fitted; None: the same.

    Raises:
        ValueError: a recording to which nothing can be fitted, or that cannot be compared.
    """
    check_recording(recording)
    model = TwinModel.of_fit(recording, fit(recording))
    return model if fitted_on is None else replace(model, detector=fit(fitted_on).profile)


def simulate_predictions(
    recording: AnnotatedRecording,
    *,
    count: int,
    fitted_on: AnnotatedRecording | None = None,
    reporter: Reporter | None = None,
) -> SimulatedTwins:
    """Fit a detector and return the twins of a recording, and that of the shipped profile.

    Args:
        recording: the recording: its rig, its people, and how they are annotated.
        count: number of twins.
        fitted_on: recording to which the detector is fitted; None: the same.
        reporter: receiver of progress.

    Raises:
        ValueError: a recording to which nothing can be fitted, or of which no twin can be built.
    """
    model = twin_model(recording, fitted_on=fitted_on)
    twins = simulate_twins(model, count=count, reporter=reporter)
    unfitted = replace(model, detector=read_profile(SHIPPED[recording.kind]))
    return SimulatedTwins(twins, detected_twin(unfitted, model.films[0], seed=0))


def halves(recording: AnnotatedRecording) -> tuple[AnnotatedRecording, AnnotatedRecording]:
    """Return the halves of a recording in time, with equal numbers of annotated frames.

    Raises:
        ValueError: fewer than two annotated frames.
    """
    rows = np.flatnonzero(np.isfinite(recording.truth).any(axis=(1, 2, 3)))
    if len(rows) < 2:
        raise ValueError(f"{recording.name}: expected two or more annotated frames to split, got {len(rows)}")
    middle = rows[len(rows) // 2]
    return recording.during(np.arange(middle)), recording.during(np.arange(middle, len(recording)))


def predict_halves(
    recording: AnnotatedRecording, *, count: int, plan: ValidationPlan, reporter: Reporter | None = None
) -> list[HalfPrediction]:
    """Predict each half of a recording from a fit to the other.

    Where people are comes from the predicted half: the prediction is of the detector's errors and of what the method
    makes of them, not of where people walk. The errors of the annotation are those of the fitted half.

    Args:
        recording: the recording.
        count: number of twins.
        plan: extent; treatments are left out.
        reporter: receiver of progress.
    """
    parts: Sequence[AnnotatedRecording] = halves(recording)
    fits = [fit(part) for part in parts]
    predictions = []
    for which, name in enumerate(_HALVES):
        other = fits[1 - which]
        model = replace(
            TwinModel.of_fit(parts[which], fits[which]), detector=other.profile, annotation=other.annotation.of_detected
        )
        twins = simulate_twins(model, count=count, reporter=reporter)
        compared = validate(
            parts[which], twins, plan=replace(plan, treated=False), bounds=PREDICTION_BOUNDS, reporter=reporter
        )
        predictions.append(HalfPrediction(name, compared))
    return predictions
