"""The same draws under other conditions: a trial is built once, and only what a condition changes is made again.

An error of the detector needs new detections, a fault of the rig new views if it changes pictures, true labels or fewer
cameras new estimates alone. Every error has random draws of its own, so that two results that differ in one condition
are paired.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from mvpose import Detections, Estimate, Rig
from mvpose.arrays import Integers
from mvpose.commands.errors import naming_frame
from mvpose.commands.progress import Silence, Stages
from mvpose.estimators import Estimator, SequenceEstimator
from simharness.detector.detect import Detected
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.stage_blame import with_labels
from simharness.trial.stages.build_trial import Trial, exposures_of
from simharness.trial.stages.capture import CaptureFrames
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.estimation import track_frames
from simharness.trial.stages.simulation import Simulation, detect_trial
from simharness.types.views import Views, Visibility
from simharness.world.rigs.faults import ExposureSchedule
from simharness.world.scene.playback import simulate


class ConditionedTrial:
    """Built trial whose people, places and random draws stay under all conditions.

    Args:
        trial: the built scenario.

    Attributes:
        trial: the built scenario.
        sequence: the true poses.
    """

    def __init__(self, trial: Trial) -> None:
        self.trial, self.sequence = trial, simulate(trial.scene)
        self._films: list[tuple[ExposureSchedule, Views]] = []
        self._latest: tuple[tuple[Scenario, int, frozenset[Visibility]], tuple[Detected, ...]] | None = None

    def views(self, exposures: ExposureSchedule) -> Views:
        """Return what the cameras see; pictures of the same cameras at the same times are taken once."""
        for taken, views in self._films:
            if _same_pictures(taken, exposures):
                return views
        trial = self.trial
        views = CaptureFrames(trial.scenario, trial.scene, exposures, frozenset())(range(trial.scenario.frames))
        self._films.append((exposures, views))
        return views

    def detected(
        self, scenario: Scenario, *, rig: Rig | None = None, revealed: Collection[Visibility] = ()
    ) -> DetectedSequence:
        """Return the detections under a condition, and the truth, whose visibility is the real one.

        Args:
            scenario: the scenario of the trial with other detector errors, faults, or times of pictures.
            rig: other true cameras; by default those of the trial.
            revealed: visibilities of joints that the detector sees as visible ones.
        """
        exposures = exposures_of(scenario, rig or self.trial.exposures.true_cameras, self.trial.scene.time)
        views = self.views(exposures)
        # A fault that changes no picture changes no detection.
        key = (scenario.model_copy(update={"faults": None}), id(views), frozenset(revealed))
        if self._latest is None or self._latest[0] != key:
            trial = replace(self.trial, scenario=scenario, exposures=exposures)
            self._latest = key, self._detect(Simulation(trial, self.sequence, views), list(revealed))
        frames = zip(self._latest[1], exposures.known_time, strict=True)
        return DetectedSequence(
            self.sequence.time, exposures.believed_rig, tuple(each.at_times(time) for each, time in frames)
        )

    def _detect(self, simulation: Simulation, hidden: list[Visibility]) -> tuple[Detected, ...]:
        """Return the detections of views in which joints of some visibilities are visible, and their real truth."""
        if not hidden:
            return detect_trial(simulation, Stages(Silence())).frames
        real = simulation.views.visibility
        visible = np.where(np.isin(real, hidden), np.int8(Visibility.VISIBLE), real)
        shown = replace(simulation, views=replace(simulation.views, visibility=visible))
        frames = zip(detect_trial(shown, Stages(Silence())).frames, real, strict=True)
        return tuple(replace(each, truth=replace(each.truth, visibility=seen)) for each, seen in frames)


def estimate_frames(
    estimator: Estimator, rig: Rig, frames: Iterable[Detections], *, labels: Sequence[Integers] | None = None
) -> list[Estimate]:
    """Return the estimates of a variant in all frames of a recording, in order, in this process.

    Args:
        estimator: the variant, with or without memory.
        rig: the believed cameras, or some of them.
        frames: detections of these cameras in each frame, F.
        labels: labels of the detections of each frame in place of the matching, F; None: the variant matches them.

    Raises:
        ValueError: labels for a variant that takes none.
        RunError: the variant failed; the message names the frame.
    """
    if labels is None and isinstance(estimator, SequenceEstimator):
        return track_frames(estimator, rig, frames)
    if labels is not None and not takes_labels(estimator):
        raise ValueError("the variant takes no labels")
    estimates = []
    for frame, detections in enumerate(frames):
        labelled = None if labels is None else with_labels(estimator, labels[frame])
        with naming_frame(frame):
            estimates.append((labelled or estimator).estimate(rig, detections))
    return estimates


def takes_labels(estimator: Estimator) -> bool:
    """Return whether labels can replace the matching of a variant."""
    return not isinstance(estimator, SequenceEstimator) and with_labels(estimator, np.zeros(0, np.int64)) is not None


def _same_pictures(one: ExposureSchedule, other: ExposureSchedule) -> bool:
    """Return whether two schedules take the same pictures; the believed calibration and times are no part of them."""
    fields = ("time", "source", "camera_of_view", "rotation_rate", "velocity")
    return (
        one.readout == other.readout
        and len(one.true_cameras) == len(other.true_cameras)
        and all(np.array_equal(getattr(one, field), getattr(other, field)) for field in fields)
    )
