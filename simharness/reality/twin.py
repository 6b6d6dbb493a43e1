"""Simulated twins of a recording: the same rig, people, poses and frames, a fitted detector and a fitted annotation.

A twin is a recording like the real one, to be scored by the same protocol. It holds nothing of the real detections but
what the fit has measured: parameters of the detector, who was where, and how the truth was annotated. A validation
(:mod:`simharness.reality.validation`) compares them.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mvpose.commands.progress import Reporter, Silence
from mvpose.recording import People
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import AnnotationModel
from simharness.reality.detector_fit.fit import DetectorFit
from simharness.reality.filmed_recording import FilmedRecording, cut_takes, film
from simharness.scenario.sections.detector_section import DetectorSection

MOST_FILMS = 3
"""Largest number of films of a recording. More twins have the bodies of earlier ones, and detections of their own:
the bodies matter less than the draws of the detector, and filming takes longest."""


@dataclass(frozen=True)
class TwinModel:
    """Everything that a twin is made from."""

    recording: AnnotatedRecording
    """The real recording: its rig, its frames, and which actors are annotated in which of them."""
    people: People
    """Who is where in the recording."""
    detector: DetectorSection
    """Fitted detector."""
    annotation: AnnotationModel
    """Fitted annotation, relative to the joints as the detector finds them: the films show these."""
    films: tuple[FilmedRecording, ...] = ()
    """Re-enactments that exist already, of seeds 0, 1, ..."""

    @classmethod
    def of_fit(cls, recording: AnnotatedRecording, fitted: DetectorFit) -> Self:
        """Return the model of twins of a recording, with its own fit."""
        return cls(recording, fitted.people, fitted.profile, fitted.annotation.of_detected, fitted.films)


def simulate_twins(model: TwinModel, *, count: int, reporter: Reporter | None = None) -> list[AnnotatedRecording]:
    """Simulate twins of a recording.

    Args:
        model: what they are made from.
        count: number of twins; their seeds are 0, 1, ...
        reporter: receiver of progress.

    Raises:
        ValueError: nobody is long enough in the recording, or the scene cannot be built.
    """
    films, shown = list(model.films[:count]), min(count, MOST_FILMS)
    takes = len(cut_takes(model.recording, model.people))
    with (reporter or Silence()).stage("film twins", (shown - len(films)) * takes) as advance:
        for seed in range(len(films), shown):
            films.append(film(model.recording, model.people, seed=seed, advance=advance))
    return [detected_twin(model, films[seed % shown], seed=seed) for seed in range(count)]


def detected_twin(model: TwinModel, filmed: FilmedRecording, *, seed: int) -> AnnotatedRecording:
    """Return the twin of a recording from its film: detections and annotation are drawn from the seed."""
    recording = model.recording
    # Annotated heads are fitted to the detected face.
    joints = filmed.shown(model.people, recording.truth, model.detector)
    truth = model.annotation.annotate(joints, recording.time, seed=seed)
    truth[~np.isfinite(recording.truth)] = np.nan
    detections = tuple(filmed.detected(model.detector, seed=seed))
    return replace(recording, name=f"{recording.name} twin", truth=truth, detections=detections)
