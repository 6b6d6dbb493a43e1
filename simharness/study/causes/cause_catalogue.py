"""Catalogue of the causes of a lost score, and a trial with any of them mended: the worth of a coalition of causes.

A mended cause is one that the scenario does not have: a class of detector errors whose shares are zero, a rig without
a fault, joints that nobody hides. Every error has random draws of its own, so mending one changes no other draw: two
results that differ in one cause are paired.

How to add a cause: one :class:`Cause` in :data:`CAUSES`.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.estimators import Estimator
from mvpose.files.message_text import listed
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.scenario.sections.detector_section import (
    BiasSection,
    BoxesSection,
    DropSection,
    FaceSection,
    GuessSection,
    KeypointsSection,
    ScoresSection,
    Shares,
)
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sections.section import Section
from simharness.scoring.assessment import assess
from simharness.scoring.stage_blame import true_labels
from simharness.trial.audit import audit
from simharness.trial.conditioned_trial import ConditionedTrial, estimate_frames, takes_labels
from simharness.trial.run_trial import with_variants
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.estimation import EstimateFrames
from simharness.types.views import Visibility
from simharness.world.rigs.extra_camera import with_camera_in_gap
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.placement.free_space import WALL_MARGIN


def _unchanged(scenario: Scenario) -> Scenario:
    return scenario


@dataclass(frozen=True)
class Cause:
    """Cause of a lost score."""

    name: str
    """Name for command lines and files."""
    title: str
    """Name for people."""
    mended: str
    """What the system has when the cause is mended, for users who decide what to buy or mend."""
    change: Callable[[Scenario], Scenario] = _unchanged
    """Function that takes the cause out of a scenario."""
    reveals: Visibility | None = None
    """Visibility of joints that become visible; None: of none."""
    labels: bool = False
    """Whether the true labels replace affinity and matching."""
    camera: bool = False
    """Whether the rig has one more camera."""


def _sections(scenario: Scenario, **changes: dict[str, Any]) -> Scenario:
    """Return the scenario with other values of keys, by section."""
    sections = {name: getattr(scenario, name).model_copy(update=values) for name, values in changes.items()}
    return scenario.model_copy(update=sections)


def _detector(scenario: Scenario, section: str, **values: Any) -> Scenario:
    """Return the scenario with other values in a section of [detector]."""
    changed = getattr(scenario.detector, section).model_copy(update=values)
    return _sections(scenario, detector={section: changed})


def _defaults(section: type[Section], *keys: str) -> dict[str, Any]:
    """Return the defaults of keys of a section, with which its errors do not occur."""
    values = section()
    return {key: getattr(values, key) for key in keys}


def _without_gross_errors(scenario: Scenario) -> Scenario:
    none = Shares()
    return _detector(
        scenario, "keypoints", miss=none, miss_some=None, miss_few=None, stray=none, guess=GuessSection(), border=0.0
    )


def _without_swaps(scenario: Scenario) -> Scenario:
    return _detector(scenario, "keypoints", inversion=Shares(), swap=Shares(), swap_crowded=None)


def _without_phantoms(scenario: Scenario) -> Scenario:
    phantoms = scenario.detector.phantoms.model_copy(update={"rate": 0.0})
    decoys = scenario.detector.decoys.model_copy(update={"share": 0.0})
    return _sections(scenario, detector={"phantoms": phantoms, "decoys": decoys})


def _without_clock_errors(scenario: Scenario) -> Scenario:
    faults = _defaults(FaultsSection, "clock_offset", "clock_jitter", "rolling_shutter")
    return _sections(scenario, faults=faults, cameras=_defaults(CamerasSection, "trigger"))


def _with_all_pictures(scenario: Scenario) -> Scenario:
    return _sections(
        scenario,
        faults=_defaults(FaultsSection, "dropped", "frozen", "dead"),
        cameras=_defaults(CamerasSection, "every"),
    )


_BOXES = ("missed", "missed_hidden", "least_visible", "merged", "split", "duplicates", "jitter")
_SCORES = ("overconfident", "underconfident", "deviation")
_CALIBRATION = ("focal", "center", "rotation", "translation", "rotation_drift", "translation_drift", "swapped")

CAUSES: tuple[Cause, ...] = (
    Cause(
        "dropped-joints",
        "dropped joints",
        "a detector that reports every joint in the picture",
        lambda scenario: _detector(scenario, "keypoints", drop=DropSection(), face=FaceSection()),
    ),
    Cause(
        "gross-errors",
        "gross errors",
        "a detector without far misses, and without guesses of joints that it does not see",
        _without_gross_errors,
    ),
    Cause(
        "swaps", "inversions and swaps", "a detector that confuses no left with right, and no people", _without_swaps
    ),
    Cause(
        "noise",
        "noise",
        "keypoints at the true pixel: higher resolution, or a more exact detector",
        lambda scenario: _detector(scenario, "keypoints", **_defaults(KeypointsSection, "scatter", "jitter")),
    ),
    Cause(
        "bias",
        "other joint centres",
        "a detector whose joints are those of the truth",
        lambda scenario: _sections(scenario, detector={"bias": BiasSection()}),
    ),
    Cause(
        "boxes",
        "missed and merged boxes",
        "a detector that finds every person once, in one box",
        lambda scenario: _detector(scenario, "boxes", **_defaults(BoxesSection, *_BOXES)),
    ),
    Cause("phantoms", "phantoms", "a detector that finds nobody where nobody is", _without_phantoms),
    Cause(
        "scores",
        "misleading scores",
        "keypoint scores that say exactly which error a keypoint has",
        lambda scenario: _detector(scenario, "scores", **_defaults(ScoresSection, *_SCORES)),
    ),
    Cause(
        "hidden-by-people",
        "hidden by people",
        "people who do not hide each other: cameras further up",
        reveals=Visibility.OCCLUDED_BY_PERSON,
    ),
    Cause(
        "hidden-by-things",
        "hidden by things",
        "a room without things in the way",
        reveals=Visibility.OCCLUDED_BY_CLUTTER,
    ),
    Cause(
        "calibration",
        "calibration",
        "a true calibration that stays true",
        lambda scenario: _sections(scenario, faults=_defaults(FaultsSection, *_CALIBRATION)),
    ),
    Cause(
        "clocks",
        "clocks",
        "all cameras triggered at once, with a global shutter",
        _without_clock_errors,
    ),
    Cause("lost-pictures", "lost pictures", "every camera delivers every picture", _with_all_pictures),
    Cause("matching", "matching", "a matching without mistakes", labels=True),
    Cause("one-more-camera", "too few cameras", "one more camera, in the widest gap between the others", camera=True),
)
"""Causes in the order of tables."""

_BY_NAME = {cause.name: cause for cause in CAUSES}


def causes_by_name(names: Sequence[str]) -> tuple[Cause, ...]:
    """Return causes by name, in the order of :data:`CAUSES`.

    Raises:
        ValueError: no such cause; the message lists all.
    """
    if unknown := [name for name in names if name not in _BY_NAME]:
        raise ValueError(f"causes: {listed(unknown)}: no such cause; expected some of {', '.join(_BY_NAME)}")
    return tuple(cause for cause in CAUSES if cause.name in names)


def present_causes(scenario: Scenario, causes: Sequence[Cause] = CAUSES, *, labelled: bool = True) -> tuple[Cause, ...]:
    """Return the causes that a scenario may have; the others change nothing of it.

    Args:
        scenario: a resolved scenario.
        causes: causes to choose from.
        labelled: whether the method takes true labels in place of its matching.
    """

    def present(cause: Cause) -> bool:
        if cause.labels:
            return labelled
        return cause.camera or cause.reveals is not None or cause.change(scenario) != scenario

    return tuple(cause for cause in causes if present(cause))


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
