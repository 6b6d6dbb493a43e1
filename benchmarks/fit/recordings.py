"""Recordings of a known detector and annotation: simulated people, filmed once for many draws."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from mvpose.commands.progress import Silence, Stages
from mvpose.files.input_files import parse_toml
from simharness.detector.detect import detect
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.annotation_errors import AnnotationModel
from simharness.scenario.load import load
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.scenario import AnnotationSection
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import Simulation, capture_trial
from simharness.types.random_streams import stream

SCENES = 4
"""Films of different people that the draws share in turn."""

RATE, DURATION = 8.0, 15.0
"""Frames a second, and seconds."""

RIGS = {3: (0, 1, 3), 4: (0, 1, 2, 3), 5: (0, 1, 2, 3, 4)}
"""Cameras of the ring by their number."""

DETECTOR = DetectorSection.model_validate(parse_toml((Path(__file__).parent / "known.toml").read_text("utf-8")))
"""The known detector."""

ANNOTATION = AnnotationSection(shift=0.02, random=0.02, life=0.5, noise=0.2)
"""The known annotation. Deviations of its joints differ by a factor of e to the power of SPREAD."""

SPREAD = 0.3

_SCENE = (
    *(f"duration={DURATION}", f"rate={RATE}", "people.count=3", "clutter.racks=0"),
    'people.activities=["reach", "turn", "point", "squat"]',
    *("cameras.layout='ring'", "cameras.count=5", "cameras.radius=4.0", "cameras.height=2.0"),
)
"""Changes of the scenario ``shelf``: people near each other, who turn."""


@dataclass(frozen=True)
class KnownRecording:
    """A recording, and what is true of it."""

    recording: AnnotatedRecording
    """The recording."""
    annotation: AnnotationModel
    """Errors of its truth."""


@cache
def scene(seed: int) -> Simulation:
    """Return the film of a scene with five cameras."""
    scenario = load("scenarios/shelf.toml", overrides=[f"seed={seed}", *_SCENE])
    return capture_trial(build_trial(scenario), Stages(Silence()))


def known_recording(
    cameras: int, *, annotated: bool, draw: int, detector: DetectorSection = DETECTOR
) -> KnownRecording:
    """Return a recording of a known detector.

    Args:
        cameras: number of cameras, a key of :data:`RIGS`.
        annotated: whether the truth has the errors of an annotation; else it is exact.
        draw: number of the draw, which decides the scene, the detections and the annotation.
        detector: the detector.
    """
    simulation = scene(draw % SCENES)
    sequence, rig = simulation.sequence, simulation.trial.exposures.true_rig
    found = detect(sequence, simulation.views, rig, detector, seed=100 + draw)
    people = sequence.joints.shape[1]
    annotation = AnnotationModel.drawn(ANNOTATION if annotated else AnnotationSection(), people, seed=draw)
    spread = np.exp(SPREAD * stream(draw, "spread").standard_normal(annotation.deviation.shape))
    annotation = replace(annotation, deviation=annotation.deviation * spread)
    truth = annotation.annotate(sequence.joints, sequence.time, seed=draw)
    whole = AnnotatedRecording(
        rig,
        truth,
        tuple(each.detections for each in found),
        np.arange(len(found)),
        name=f"known {draw}",
        rate=RATE,
        kind=detector.kind,
    )
    return KnownRecording(whole.subset(RIGS[cameras]), annotation)
