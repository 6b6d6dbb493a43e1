"""A trial with any of its causes mended, on the same random draws: the worth of a coalition of causes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial

import numpy as np

from mvpose.arrays import Floats
from mvpose.estimators import Estimator
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.assessment import assess
from simharness.scoring.stage_blame import true_labels
from simharness.study.causes.cause_catalogue import Cause, causes_by_name
from simharness.trial.audit import audit
from simharness.trial.conditioned_trial import ConditionedTrial, estimate_frames, takes_labels
from simharness.trial.run_trial import with_variants
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.estimation import EstimateFrames
from simharness.world.rigs.extra_camera import with_camera_in_gap
from simharness.world.scene.camera_clearance import WALL_MARGIN
from simharness.world.scene.objects.solids import Solid

_CLEARANCE = 0.3  # metres between one more camera and the nearest object


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
        self._variant, self._score = variant, score
        trial = build_trial(with_variants(scenario, [variant]))
        self._draws = ConditionedTrial(trial)
        self._worths: dict[frozenset[str], float] = {}
        audit(scenario, trial.scene, trial.exposures, self._draws.sequence, self._draws.views(trial.exposures))

    @property
    def estimator(self) -> Estimator:
        """The variant of the method."""
        return self._draws.trial.pipelines[self._variant]

    def worth(self, mended: Collection[str]) -> float:
        """Return the score with some causes mended, NaN where it does not apply.

        Args:
            mended: names of the causes.

        Raises:
            ValueError: the matching is mended of a variant that takes no labels.
        """
        names = frozenset(mended)
        if names not in self._worths:
            causes = causes_by_name(sorted(names))
            detected = self.detected(causes)
            run = EstimateFrames(detected.rig, detected.frames, {self._variant: self.estimator})
            if not any(cause.labels for cause in causes):
                estimates = run(range(len(detected.frames)))[self._variant]
            elif takes_labels(self.estimator):
                given = (run.input_of(frame, self._variant) for frame in range(len(detected.frames)))
                labels = [true_labels(each.detections, each.truth) for each in detected.frames]
                estimates = estimate_frames(self.estimator, detected.rig, given, labels=labels)
            else:
                raise ValueError(f"causes: matching: the variant {self._variant} takes no labels; leave this cause out")
            value = assess(detected.recording, estimates).scores[self._score]
            self._worths[names] = np.nan if value is None else float(value)
        return self._worths[names]

    def detected(self, causes: Collection[Cause]) -> DetectedSequence:
        """Return the detections with some causes mended, and the truth, whose visibility is the real one."""
        trial = self._draws.trial
        scenario, rig = trial.scenario, trial.exposures.true_cameras
        for cause in causes:
            scenario = cause.change(scenario)
        if any(cause.camera for cause in causes):
            walls = np.array(scenario.room.size) / [2, 2, 1] - WALL_MARGIN if scenario.room.walls else None
            rig = with_camera_in_gap(rig, partial(_is_free, trial.scene.solids), reach=walls)
        revealed = [cause.reveals for cause in causes if cause.reveals is not None]
        return self._draws.detected(scenario, rig=rig, revealed=revealed)


def _is_free(solids: Sequence[Solid], place: Floats) -> bool:
    """Return whether a camera at a place has clearance from all objects."""
    standing = (each for each in solids if each.kind != "room" and each.trajectory is None)
    return all(each.hull.distance(place) > _CLEARANCE for each in standing)
