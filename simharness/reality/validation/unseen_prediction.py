"""Predictions of frames and recordings that a fit has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.commands.progress import Reporter
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.fit import fit
from simharness.reality.twin import TwinModel, simulate_twins
from simharness.reality.validation.validation import Validation, ValidationPlan, validate
from simharness.reality.validation.verdicts import PREDICTION_BOUNDS, BoundVerdict

_HALVES = ("first half", "second half")
_PREDICTED = ("pcp", "subsets")  # groups of verdicts that hold for other frames than those of the fit


@dataclass(frozen=True)
class HalfPrediction:
    """Prediction of one half of a recording from a fit to the other.

    Attributes:
        half: the predicted half.
        validation: the half beside its twins, without treatments.
    """

    half: str
    validation: Validation

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
    model = TwinModel.of(recording, fit(recording))
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
            TwinModel.of(parts[which], fits[which]),
            detector=other.profile,
            annotation=other.annotation.of_detected,
        )
        twins = simulate_twins(model, count=count, reporter=reporter)
        compared = validate(
            parts[which], twins, plan=replace(plan, treated=False), bounds=PREDICTION_BOUNDS, reporter=reporter
        )
        predictions.append(HalfPrediction(name, compared))
    return predictions
