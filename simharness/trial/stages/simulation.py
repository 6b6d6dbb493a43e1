"""Simulation of a built trial: true poses, what the cameras record, and detections."""

from collections.abc import Collection
from dataclasses import dataclass

from mvpose.commands.progress import Stages
from mvpose.skeleton import COCO17
from mvpose.wholebody import skeleton_by_name
from simharness.detector.detect import detect
from simharness.runtime.frame_pool import map_frames
from simharness.trial.stages.build_trial import Trial
from simharness.trial.stages.capture import CaptureFrames, FilmOuterJoints
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.networks import ReadFrames
from simharness.types.outer_joints import OuterTruth, OuterViews
from simharness.types.sequence import Sequence
from simharness.types.views import Views
from simharness.world.scene.playback import simulate


@dataclass(frozen=True)
class Simulation:
    """Scene, true poses and views of a simulated trial, which stored detections do not have."""

    trial: Trial
    """The built scenario."""
    sequence: Sequence
    """The true poses."""
    views: Views
    """The truth in the pictures, with previews where they were requested."""
    outer: OuterTruth | None = None
    """True feet and hands, where the detector reports them."""


def capture_trial(
    trial: Trial, stages: Stages, *, workers: int = 1, previews: Collection[int] = (), every: int = 1
) -> Simulation:
    """Simulate the true poses and capture all frames.

    Args:
        trial: the built scenario.
        stages: timer and reporter of the stages ``simulate``, ``film`` and ``feet and hands``.
        workers: number of processes that share the frames.
        previews: frames whose colour pictures are kept.
        every: step between the frames that are needed; the others get the pictures of the needed frame before.
    """
    frames = range(trial.scenario.frames)
    needed = frames[::every]
    with stages.stage("simulate", 1):
        sequence = simulate(trial.scene)
    with stages.stage("film", len(needed)) as advance:
        capture = CaptureFrames(trial.scenario, trial.scene, trial.exposures, frozenset(previews))
        views = Views.concatenate(map_frames(capture, needed, workers=workers, progress=advance))
    outer = None
    if (name := trial.scenario.detector.skeleton) != COCO17.name:
        skeleton = skeleton_by_name(name)
        with stages.stage("feet and hands", len(frames)) as advance:
            film = FilmOuterJoints(trial.scene, trial.exposures, skeleton)
            parts = map_frames(film, frames, workers=workers, progress=advance)
            outer = OuterTruth(skeleton, film.truth(), OuterViews.concatenate(parts))
    return Simulation(trial, sequence, views.held(every, len(frames)), outer)


def detect_trial(simulation: Simulation, stages: Stages, *, workers: int = 1, every: int = 1) -> DetectedSequence:
    """Detect people in the captured frames; networks of the scenario read its pictures.

    The detections carry the times of the pictures as the method is given them.

    Args:
        simulation: from :func:`capture_trial`.
        stages: timer and reporter of the stages ``detect`` and ``read``.
        workers: number of processes that share the frames.
        every: as :func:`capture_trial`.
    """
    trial, sequence = simulation.trial, simulation.sequence
    scenario, exposures = trial.scenario, trial.exposures
    frames = range(scenario.frames)
    with stages.stage("detect", len(frames)):
        detected = detect(
            sequence,
            simulation.views,
            exposures.true_rig,
            scenario.detector,
            seed=scenario.seed,
            descriptors=trial.descriptors,
            outer=simulation.outer,
        )
    if ReadFrames.needed(scenario):
        needed = frames[::every]
        with stages.stage("read", len(needed)) as advance:
            reading = ReadFrames(scenario, trial.scene, exposures, tuple(detected))
            parts = map_frames(reading, needed, workers=workers, progress=advance)
            detected[::every] = [each for part in parts for each in part]
    detected = [each.at_times(time) for each, time in zip(detected, exposures.known_time, strict=True)]
    return DetectedSequence(sequence.time, exposures.believed_rig, tuple(detected))
