"""Validation of the twins of a recording: everything that simulation predicts, beside what was recorded.

Also predictions of frames and recordings that a fit has not seen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mvpose.commands.progress import Reporter, Silence
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.fit import fit
from simharness.reality.twin import TwinModel, simulate_twins
from simharness.reality.validation import variant_comparison
from simharness.reality.validation.detection_figures import DetectionFigures, compare_detections, measure_detections
from simharness.reality.validation.evidence import Compared, Evidence, compared, frame_weights
from simharness.reality.validation.passes import (
    VARIANTS,
    CameraSubset,
    RecordingChange,
    ScoreSums,
    Tallies,
    Unchanged,
    annotated,
    run_passes,
    score_recordings,
)
from simharness.reality.validation.treatments import treatments
from simharness.reality.validation.verdicts import (
    BOUNDS,
    PREDICTION_BOUNDS,
    Bounds,
    BoundVerdict,
    VerdictState,
    judge_measurements,
    judge_responses,
    judge_scores,
    judge_subsets,
)
from simharness.scoring.frame_scores import RULES, ByRule, FrameScores, HeadRule


@dataclass(frozen=True)
class ValidationPlan:
    """Extent of a validation."""

    every: int = 1
    """Every n-th annotated frame of the recording is used."""
    twin_every: int = 3
    """The same for subsets and treatments of twins, of which there are several; all else takes every frame that
    ``every`` leaves."""
    draws: int = 10
    """Number of draws of calibration errors."""
    detection_draws: int = 3
    """Number of draws of the errors of detections."""
    treated: bool = True
    """Whether treatments are compared."""
    variants: tuple[str, ...] = VARIANTS
    """Names of presets."""
    workers: int = 1
    """Number of processes."""


QUICK = ValidationPlan(every=3, twin_every=6, draws=4, detection_draws=2)
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
    variants: Mapping[str, Mapping[str, Mapping[HeadRule, Compared]]]
    """Scores by variant, key and rule for the head."""
    medians: Mapping[str, Compared]
    """Median MPJPE by variant, mm."""
    parts: Mapping[str, Mapping[str, Compared]]
    """PCP of each group of parts by variant."""
    contrasts: Mapping[tuple[str, str], Mapping[HeadRule, Compared]]
    """Differences of PCP by pair of variants and rule."""
    subsets: variant_comparison.SubsetComparison
    """PCP with some of the cameras, missing joints of the face filled from the others."""
    subsets_as_is: variant_comparison.SubsetComparison
    """The same as the method left them."""
    responses: Sequence[variant_comparison.DoseResponse]
    """Losses by treatment, level and variant."""
    bases: Mapping[str, tuple[float, float]]
    """PCP without a treatment in the frames that are treated, real and simulated, by variant, percent."""
    joints: variant_comparison.JointDifficulty
    """Errors by joint, of the first variant."""
    measured: Mapping[str, Compared]
    """Measurements of the detections."""
    affinities: Mapping[str, tuple[np.ndarray, np.ndarray]]
    """Histograms of affinities, of the recording and mean of the twins."""
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
    plan: ValidationPlan | None = None,
    bounds: Bounds = BOUNDS,
    reporter: Reporter | None = None,
) -> Validation:
    """Compare a recording with its twins.

    Args:
        recording: the recording.
        twins: its twins, each of another seed, with the same cameras.
        plan: extent; by default the whole.
        bounds: bounds of the verdicts.
        reporter: receiver of progress.

    Raises:
        ValueError: no twins, a twin with another number of cameras, or nobody annotated.
    """
    plan, reporter = plan or ValidationPlan(), reporter or Silence()
    _check(recording, twins)
    real = annotated(recording, every=plan.every)
    whole = [annotated(twin, every=plan.every) for twin in twins]
    thinned = [annotated(twin, every=plan.twin_every) for twin in twins]

    with reporter.stage("scores", 1 + len(whole)) as advance:
        scores = score_recordings([real, *whole], variants=plan.variants, workers=plan.workers, progress=advance)
    with reporter.stage("measurements", 1 + len(whole)) as advance:
        measurements = []
        for each in (real, *whole):
            measurements.append(measure_detections(each))
            advance(1)
    changes: list[RecordingChange] = [Unchanged(), *map(CameraSubset, variant_comparison.camera_subsets(len(real.rig)))]
    changes += treatments(draws=plan.draws, detection_draws=plan.detection_draws) if plan.treated else ()
    with reporter.stage("subsets and treatments", len(changes) * (1 + len(thinned))) as advance:
        passes = run_passes([real, *thinned], changes, variants=plan.variants, workers=plan.workers, progress=advance)
    return _compare(real, whole, plan, bounds, scores, measurements, Evidence.of_tallies(real, passes[0], passes[1:]))


def _check(recording: AnnotatedRecording, twins: Sequence[AnnotatedRecording]) -> None:
    if not twins:
        raise ValueError(f"{recording.name}: expected one or more twins to compare with, got none")
    for each in (recording, *twins):
        if len(each.rig) != len(recording.rig):
            raise ValueError(
                f"{each.name}: expected a twin with the {len(recording.rig)} cameras of {recording.name}, "
                f"got {len(each.rig)}"
            )
        if not np.isfinite(each.truth).any():
            raise ValueError(f"{each.name}: expected frames with annotated people, got none in {len(each)} frames")


def _compare(
    real: AnnotatedRecording,
    twins: Sequence[AnnotatedRecording],
    plan: ValidationPlan,
    bounds: Bounds,
    scores: Sequence[Mapping[str, ByRule]],
    measurements: Sequence[DetectionFigures],
    evidence: Evidence,
) -> Validation:
    """Return the comparison, from the scores, the measurements and the passes of all recordings."""
    everyone = (real, *twins)
    tallies: list[dict[RecordingChange, Tallies]] = [
        {Unchanged(): {name: ScoreSums.of_scores(of, each.scored) for name, of in variants.items()}}
        for each, variants in zip(everyone, scores, strict=True)
    ]
    whole = Evidence.of_tallies(real, tallies[0], tallies[1:])
    variants = variant_comparison.compare_variants(whole, plan.variants)
    contrasts = variant_comparison.compare_contrasts(whole, plan.variants)
    cameras = len(real.rig)
    subsets = variant_comparison.compare_subsets(evidence, cameras, plan.variants)
    responses = variant_comparison.compare_responses(evidence, plan.variants)
    measured = compare_detections(measurements[0], measurements[1:], frame_weights(real))
    verdicts = [
        *judge_scores(variants, contrasts, bounds),
        *judge_subsets(subsets, bounds),
        *judge_responses(responses, bounds),
        *judge_measurements(measured, real.kind, bounds),
    ]
    first = plan.variants[0]
    return Validation(
        recording=real,
        twins=len(twins),
        twin_frames=float(np.mean([len(twin) for twin in twins])),
        plan=plan,
        variants=variants,
        medians={
            name: _plain([variant_comparison.median_error(each[name][RULES[0]]) for each in scores])
            for name in plan.variants
        },
        parts={name: _parts(everyone, [each[name][RULES[0]] for each in scores]) for name in plan.variants},
        contrasts=contrasts,
        subsets=subsets,
        subsets_as_is=variant_comparison.compare_subsets(evidence, cameras, plan.variants, rule=RULES[0]),
        responses=responses,
        bases={name: _base(evidence, name) for name in plan.variants},
        joints=variant_comparison.compare_joints(
            scores[0][first][RULES[0]], [each[first][RULES[0]] for each in scores[1:]]
        ),
        measured=measured,
        affinities={
            key: (real_shares, np.mean([each.affinities[key] for each in measurements[1:]], axis=0))
            for key, real_shares in measurements[0].affinities.items()
        },
        verdicts=verdicts,
    )


def _base(evidence: Evidence, variant: str) -> tuple[float, float]:
    figure = evidence.compare(lambda sums: sums[Unchanged()][variant].pcp())
    return figure.real.mean, figure.twin.mean


def _parts(recordings: Sequence[AnnotatedRecording], scores: Sequence[FrameScores]) -> dict[str, Compared]:
    """Return the PCP of each group of parts."""
    each = [
        variant_comparison.pcp_of_parts(one, recording.scored)
        for recording, one in zip(recordings, scores, strict=True)
    ]
    return {group: _plain([values[group] for values in each]) for group in each[0]}


def _plain(values: Sequence[float]) -> Compared:
    """Return a figure of the recording (first) and its twins, without an interval of the recording."""
    return compared(values[0], np.nan, values[1:])


_HALVES = ("first half", "second half")
_PREDICTED = ("pcp", "subsets")  # groups of verdicts that hold for other frames than those of the fit


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


def simulate_predictions(
    recording: AnnotatedRecording,
    *,
    count: int,
    fitted_on: AnnotatedRecording | None = None,
    reporter: Reporter | None = None,
) -> list[AnnotatedRecording]:
    """Fit a detector and return the twins of a recording.

    Args:
        recording: the recording: its rig, its people, and how they are annotated.
        count: number of twins.
        fitted_on: recording to which the detector is fitted; None: the same.
        reporter: receiver of progress.

    Raises:
        ValueError: a recording to which nothing can be fitted, or of which no twin can be built.
    """
    model = TwinModel.of_fit(recording, fit(recording))
    if fitted_on is not None:
        model = replace(model, detector=fit(fitted_on).profile)
    return simulate_twins(model, count=count, reporter=reporter)


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
