"""Fit of a detector profile, and of the annotation, to a recording.

The consensus of the other views is not the true place of a joint: it has noise, and errors of other views in it, so
that measured scatter and rates of errors are not the parameters behind them. These are inferred by simulation
(:mod:`simharness.reality.detector_fit.inference`): twins are measured in the same way as the recording. So is what the
errors of the detector leave in the tracks that the annotation is compared with.

Face: data sets do not annotate it. The bodies that re-enact a recording have faces, turned as the detected ones; what
is left between the two, on average, is how the detector's joints of the face differ from the landmarks of the bodies.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.atomic_files import write_atomic
from mvpose.recording import People
from simharness.detector.viewing_conditions import SIDE, body_axes
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import annotated_joints
from simharness.reality.detector_fit.annotation_fit import (
    AnnotationFit,
    annotation_offsets,
    common_bias,
    fit_annotation,
)
from simharness.reality.detector_fit.detector_measurement import (
    RESAMPLES,
    MeasuredDetector,
    measure_detector,
    point_estimates,
)
from simharness.reality.detector_fit.inference import infer
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.profile import as_toml, prior_of, settings
from simharness.reality.detector_fit.sample import sample_of
from simharness.reality.filmed_recording import FilmedRecording, film
from simharness.reality.people_tracks import LIMB_JOINTS, track_people
from simharness.scenario.sections.detector_section import KIND_OF_JOINT, DetectorSection

_FILMS = 2


@dataclass(frozen=True)
class DetectorFit:
    """Fitted detector and annotation of a recording."""

    real: MeasuredDetector
    """Measurement of the detector."""
    calibrated: MeasuredDetector
    """Parameters at which a simulated detector measures as the real one."""
    annotation: AnnotationFit
    """Errors of the truth, and the bias of the detector against all annotators."""
    people: People
    """Who is where in the recording."""
    films: tuple[FilmedRecording, ...]
    """Re-enactments of the recording by different bodies; the first shows what hides what."""
    profile: DetectorSection
    """[detector] parameters at which the simulated detector errs alike."""
    text: str
    """The profile as a file."""


def fit(
    recording: AnnotatedRecording,
    *,
    name: str = "",
    command: str = "",
    resamples: int = RESAMPLES,
    seed: int = 0,
    people: People | None = None,
    films: Sequence[FilmedRecording] = (),
) -> DetectorFit:
    """Measure the detector of a recording against the consensus of its views, and the truth against the same.

    Args:
        recording: the recording.
        name: name of the profile; by default that of the recording.
        command: command that made the profile, to be written into its file.
        resamples: number of resamples of the bootstrap.
        seed: seed of the resamples, and of the bodies of the re-enactment.
        people: who is where; None: tracked.
        films: re-enactments of these people that exist already, of seeds ``seed``, ``seed`` + 1, ...

    Raises:
        ValueError: nobody to re-enact; see also :func:`.measure_detector`.
    """
    people = track_people(recording) if people is None else people
    films = tuple(films) + tuple(film(recording, people, seed=seed + k) for k in range(len(films), _FILMS))
    filmed = films[0]
    sample = sample_of(recording, people, filmed)
    labels = label_joints(sample)
    real = measure_detector(sample, labels=labels, resamples=resamples, seed=seed)
    away = annotation_offsets(recording.truth, people, labels.consensus)
    name = name or recording.name
    bias = common_bias(away)
    bias[:3] = face_bias(people.joints, filmed.joints)

    def simulate(values: Mapping[str, float], draw: int) -> dict[str, float]:
        profile = DetectorSection.model_validate(settings(real.with_values(values), name=name, bias=bias))
        # What hides what is seen in one film, and detections are simulated in the other: real bodies differ, too.
        one, other = films[draw % _FILMS], films[(draw + 1) % _FILMS]
        return point_estimates(sample_of(filmed_twin(recording, one, profile, seed=1 + draw), people, other))

    calibrated = replace(real, values=infer(real.values, simulate, prior_of(recording.kind)))
    profile = DetectorSection.model_validate(settings(calibrated, name=name, bias=bias))
    of_tracks = []
    for number, each in enumerate(films[:_FILMS]):
        twin = filmed_twin(recording, each, profile, seed=1 + number)
        exact = annotated_joints(each.shown(people, recording.truth, profile))
        twin = replace(twin, truth=np.where(np.isfinite(recording.truth), exact, np.nan))
        tracks = track_people(twin)
        of_tracks.append(annotation_offsets(twin.truth, tracks, label_joints(sample_of(twin, tracks)).consensus))
    annotation = fit_annotation(away, of_tracks, recording.time)
    text = as_toml(calibrated, name=name, bias=bias, command=command)
    return DetectorFit(real, calibrated, annotation, people, films, profile, text)


def filmed_twin(
    recording: AnnotatedRecording, filmed: FilmedRecording, profile: DetectorSection, *, seed: int
) -> AnnotatedRecording:
    """Return a recording with the detections of a simulated detector in its film."""
    return replace(recording, detections=tuple(filmed.detected(profile, seed=seed)))


def write_profile(fitted: DetectorFit, path: str | Path) -> None:
    """Write the profile; the file is complete or unchanged.

    Raises:
        ValueError: it cannot be written.
    """
    try:
        write_atomic(Path(path), fitted.text.encode())
    except OSError as error:
        raise ValueError(f"--out {path}: cannot be written: {error.strerror}") from None


def face_bias(tracked: Floats, staged: Floats) -> Floats:
    """Return the offset of the tracked joints of the face from the staged ones, (3, 3) metres: forward, outward, up.

    One row for nose, eyes and ears; 0 where nothing is known.

    Args:
        tracked: joints of people as detected, (F, P, 17, 3) metres; NaN where unknown.
        staged: joints of the bodies that re-enact them, (F, P, 17, 3) metres; NaN where absent.
    """
    face = slice(0, LIMB_JOINTS[0])
    offset = np.einsum("fpjc,fpkc->fpjk", (tracked - staged)[:, :, face], body_axes(staged))
    offset[..., 1] *= SIDE[face]
    kinds = np.array(KIND_OF_JOINT[face])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # people who are always absent
        # Each person counts alike: one with more frames says no more about the next one.
        of_person = np.nanmedian(offset, axis=0)
        return np.nan_to_num(np.stack([np.nanmean(of_person[:, kinds == kind], axis=(0, 1)) for kind in range(3)]))
