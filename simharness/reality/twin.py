"""Simulated twins of a recording: the same rig, people, poses and frames, a fitted detector and a fitted annotation.

A twin is a recording like the real one, to be scored by the same protocol. It holds nothing of the real detections but
what the fit has measured: parameters of the detector, who was where, and how the truth was annotated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from mvpose import COCO17
from mvpose.commands.progress import Reporter, Silence
from mvpose.recording import People
from simharness.detector.bias import world_offsets
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import AnnotationModel
from simharness.reality.detector_fit.fit import DetectorFit
from simharness.reality.filmed_recording import FilmedRecording, cut_takes, film
from simharness.reality.people_tracks import actors_of
from simharness.scenario.sections.detector_section import DetectorSection

MOST_FILMS = 3
"""Largest number of films of a recording. More twins have the bodies of earlier ones, and detections of their own:
the bodies matter less than the draws of the detector, and filming takes longest."""


@dataclass(frozen=True)
class TwinModel:
    """Everything that a twin is made from.

    Attributes:
        recording: the real recording: its rig, its frames, and which actors are annotated in which of them.
        people: who is where in the recording.
        detector: fitted detector.
        annotation: fitted annotation, relative to the joints as the detector finds them: the films show these.
        films: re-enactments that exist already, of seeds 0, 1, ...
    """

    recording: AnnotatedRecording
    people: People
    detector: DetectorSection
    annotation: AnnotationModel
    films: tuple[FilmedRecording, ...] = ()

    @classmethod
    def of(cls, recording: AnnotatedRecording, fitted: DetectorFit) -> Self:
        """Return the model of twins of a recording, with its own fit."""
        return cls(recording, fitted.people, fitted.profile, fitted.annotation.of_detected, (fitted.film,))


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
    joints = np.full((len(recording), recording.people, len(COCO17), 3), np.nan)
    # Annotated heads are fitted to the detected face; limbs of the film are the detected ones already.
    shown = filmed.joints + world_offsets(filmed.joints, model.detector.bias.of_face())
    for person, actor in enumerate(actors_of(model.people, recording.truth)):
        if actor >= 0:
            joints[:, actor] = shown[:, person]
    truth = model.annotation.annotate(joints, recording.time, seed=seed)
    truth[~np.isfinite(recording.truth)] = np.nan
    detections = tuple(filmed.detected(model.detector, seed=seed))
    return replace(recording, name=f"{recording.name} twin", truth=truth, detections=detections)
