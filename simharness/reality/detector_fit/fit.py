"""Fit of a detector profile, and of the annotation, to a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mvpose.files.atomic_files import write_atomic
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import AnnotationFit, fit_annotation
from simharness.reality.detector_fit.calibration import calibrate
from simharness.reality.detector_fit.detector_measurement import RESAMPLES, MeasuredDetector, measure
from simharness.reality.detector_fit.face_bias import face_bias
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.profile import as_toml, settings
from simharness.reality.detector_fit.sample import Sample, sample_of
from simharness.reality.people_tracks import TrackedPeople, track_people
from simharness.reality.reenactment import Film, film
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, KINDS, DetectorSection

_TWINS = 2  # simulated in each round of the calibration
_FEWEST = 100  # joints behind a value that is calibrated: Shelf has 130 reported shoulders that others hide


@dataclass(frozen=True)
class Fit:
    """Fitted detector and annotation of a recording.

    Attributes:
        real: measurement of the detector.
        annotation: errors of the truth, and the bias of the detector against all annotators.
        people: who is where in the recording.
        film: re-enactment of the recording, which shows what hides what.
        profile: [detector] parameters at which the simulated detector errs alike.
        text: the profile as a file.
    """

    real: MeasuredDetector
    annotation: AnnotationFit
    people: TrackedPeople
    film: Film
    profile: DetectorSection
    text: str


def fit(
    recording: AnnotatedRecording, *, name: str = "", command: str = "", resamples: int = RESAMPLES, seed: int = 0
) -> Fit:
    """Measure the detector of a recording against the consensus of its views, and the truth against the same.

    Args:
        recording: the recording.
        name: name of the profile; by default that of the recording.
        command: command that made the profile, to be written into its file.
        resamples: number of resamples of the bootstrap.
        seed: seed of the resamples, and of the bodies of the re-enactment.

    Raises:
        ValueError: nobody to re-enact; see also :func:`~simharness.reality.detector_fit.detector_measurement.measure`.
    """
    people = track_people(recording)
    filmed = film(recording, people, seed=seed)
    sample = sample_of(recording, people, filmed)
    labels = label_joints(sample)
    real = measure(sample, labels=labels, resamples=resamples, seed=seed)
    scatter = np.array([real[f"keypoints.scatter.{KINDS[kind]}"].value for kind in KIND_OF_JOINT])
    annotation = fit_annotation(
        recording.truth,
        people,
        labels.consensus,
        recording.time,
        sigma=np.nan_to_num(scatter, nan=np.nanmean(scatter)),
        scatter_life=float(np.nan_to_num(real["correlation.scatter_life"].value)),
        scatter_noise=float(np.nan_to_num(real["correlation.scatter_noise"].value)),
    )
    name = name or recording.name
    bias = annotation.bias.copy()
    bias[:3] = face_bias(people.joints, filmed.joints)

    def simulate(values: Mapping[str, float]) -> list[Sample]:
        profile = DetectorSection.model_validate(settings(real.with_values(values), name=name, bias=bias))
        twins = (replace(recording, detections=tuple(filmed.detected(profile, seed=1 + k))) for k in range(_TWINS))
        return [sample_of(twin, people, filmed) for twin in twins]

    counted = {key: each.value for key, each in real.values.items() if each.count >= _FEWEST}
    rare = {key: each.value for key, each in real.values.items() if key not in counted}
    calibrated = real.with_values({**calibrate(counted, lambda values: simulate({**values, **rare})), **rare})
    profile = DetectorSection.model_validate(settings(calibrated, name=name, bias=bias))
    text = as_toml(calibrated, name=name, bias=bias, command=command)
    return Fit(real, annotation, people, filmed, profile, text)


def write_profile(fitted: Fit, path: str | Path) -> None:
    """Write the profile; the file is complete or unchanged.

    Raises:
        ValueError: it cannot be written.
    """
    try:
        write_atomic(Path(path), fitted.text.encode())
    except OSError as error:
        raise ValueError(f"--out {path}: cannot be written: {error.strerror}") from None
