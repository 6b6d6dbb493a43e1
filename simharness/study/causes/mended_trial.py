"""A trial with any of its causes mended, on the same random draws: the worth of a coalition of causes.

Only what a cause changes is made again: an error of the detector needs new detections, a fault of the rig new views if
it changes pictures, a true matching new estimates.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cached_property

import numpy as np

from mvpose import Estimate, Rig
from mvpose.commands.errors import naming_frame
from mvpose.commands.progress import Silence, Stages
from mvpose.estimators import Estimator, SequenceEstimator
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import assess
from simharness.scoring.stage_blame import true_labels, with_labels
from simharness.study.causes.cause_catalogue import Cause, causes_by_name
from simharness.study.causes.extra_camera import with_one_more_camera
from simharness.trial.audit import audit
from simharness.trial.run_trial import with_variants
from simharness.trial.stages.build_trial import Trial, build_trial, true_rig
from simharness.trial.stages.capture import CaptureFrames
from simharness.trial.stages.estimation import EstimateFrames
from simharness.trial.stages.simulation import DetectedSequence, Simulation, detect_trial
from simharness.types.sequence import Sequence
from simharness.types.views import Views, Visibility
from simharness.world.rigs.exposure_schedule import ExposureSchedule
from simharness.world.rigs.faults import camera_phases, schedule_exposures
from simharness.world.scene.playback import simulate


class MendedTrial:
    """A trial of one variant whose causes can be mended.

    Args:
        scenario: a resolved scenario with its seed.
        variant: variant of the method.
        score: key of the score that a coalition is worth.

    Raises:
        ValueError: the scenario cannot be built.
        AuditError: the simulated trial is not what the scenario describes.
    """

    def __init__(self, scenario: Scenario, variant: str, *, score: str = "pcp") -> None:
        self._scenario = with_variants(scenario, [variant])
        self._variant, self._score = variant, score
        self._trial = build_trial(self._scenario)
        self._films: list[tuple[ExposureSchedule, Views]] = []
        self._worths: dict[frozenset[str], float] = {}
        audit(scenario, self._trial.scene, self._trial.exposures, self._sequence, self._views(self._trial))

    @property
    def estimator(self) -> Estimator:
        """The variant of the method."""
        return self._trial.pipelines[self._variant]

    def worth(self, mended: Collection[str]) -> float:
        """Return the score with some causes mended, NaN where it does not apply.

        Args:
            mended: names of the causes.
        """
        names = frozenset(mended)
        if names not in self._worths:
            causes = causes_by_name(sorted(names))
            detected = self.detected(causes)
            estimates = self._estimate(detected, labelled=any(cause.labels for cause in causes))
            value = assess(detected.recording, estimates).scores[self._score]
            self._worths[names] = np.nan if value is None else float(value)
        return self._worths[names]

    def detected(self, causes: Collection[Cause]) -> DetectedSequence:
        """Return the detections with some causes mended, and the truth, whose visibility is the real one."""
        scenario = self._scenario
        for cause in causes:
            scenario = cause.change(scenario)
        trial = replace(self._trial, scenario=scenario, exposures=self._exposures(scenario, causes))
        views = self._views(trial)
        revealed = _revealed(views, [cause.reveals for cause in causes if cause.reveals is not None])
        detected = detect_trial(Simulation(trial, self._sequence, revealed), Stages(Silence()))
        if revealed is views:
            return detected
        frames = tuple(
            replace(each, truth=replace(each.truth, visibility=views.visibility[frame]))
            for frame, each in enumerate(detected.frames)
        )
        return replace(detected, frames=frames)

    @cached_property
    def _sequence(self) -> Sequence:
        return simulate(self._trial.scene)

    @cached_property
    def _rig(self) -> Rig:
        return true_rig(self._scenario)

    def _exposures(self, scenario: Scenario, causes: Collection[Cause]) -> ExposureSchedule:
        """Return when and with which cameras the pictures of the built scene are taken."""
        rig = self._rig
        if any(cause.camera for cause in causes):
            room = scenario.room.size if scenario.room.walls else None
            rig = with_one_more_camera(rig, self._trial.scene.solids, room=room)
        phases = camera_phases(scenario.cameras, len(rig), period=1.0 / scenario.rate, seed=scenario.seed)
        return schedule_exposures(
            rig,
            scenario.faults,
            self._trial.scene.time,
            seed=scenario.seed,
            phases=phases,
            every=scenario.cameras.every,
        )

    def _views(self, trial: Trial) -> Views:
        """Return what the cameras see; pictures of the same cameras at the same times are taken once."""
        for exposures, views in self._films:
            if _same_pictures(exposures, trial.exposures):
                return views
        capture = CaptureFrames(trial.scenario, trial.scene, trial.exposures, frozenset())
        views = capture(range(trial.scenario.frames))
        self._films.append((trial.exposures, views))
        return views

    def _estimate(self, detected: DetectedSequence, *, labelled: bool) -> list[Estimate]:
        run = EstimateFrames(detected.rig, detected.frames, {self._variant: self.estimator})
        if not labelled:
            return run(range(len(detected.frames)))[self._variant]
        estimates = []
        for frame, each in enumerate(detected.frames):
            pipeline = with_labels(self.estimator, true_labels(each.detections, each.truth))
            if pipeline is None:
                raise ValueError(f"causes: matching: the variant {self._variant} takes no labels; leave this cause out")
            with naming_frame(frame):
                estimates.append(pipeline.estimate(detected.rig, run.input_of(frame, self._variant)))
        return estimates


def takes_labels(estimator: Estimator) -> bool:
    """Return whether true labels can replace the matching of a method."""
    return not isinstance(estimator, SequenceEstimator) and with_labels(estimator, np.zeros(0, np.int64)) is not None


def _revealed(views: Views, hidden: list[Visibility]) -> Views:
    """Return the views with joints of some visibilities as visible ones."""
    if not hidden:
        return views
    visible = np.where(np.isin(views.visibility, hidden), np.int8(Visibility.VISIBLE), views.visibility)
    return replace(views, visibility=visible)


def _same_pictures(one: ExposureSchedule, other: ExposureSchedule) -> bool:
    """Return whether two schedules take the same pictures; the believed calibration and times are no part of them."""
    fields = ("time", "source", "camera_of_view", "rotation_rate", "velocity")
    return (
        one.readout == other.readout
        and len(one.true_cameras) == len(other.true_cameras)
        and all(np.array_equal(getattr(one, field), getattr(other, field)) for field in fields)
    )
