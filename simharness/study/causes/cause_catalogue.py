"""Catalogue of the causes of a lost score, and a trial with any of them mended: the worth of a coalition of causes.

A mended cause is one that the scenario does not have: a class of detector errors whose shares are zero, a rig without
a fault, joints that nobody hides. Every error has random draws of its own, so mending one changes no other draw: two
results that differ in one cause are paired.

How to add a cause: one entry in ``study/data/causes.toml``.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import BaseModel

from mvpose.arrays import Floats
from mvpose.estimators import Estimator
from mvpose.files.input_files import parse_toml
from mvpose.files.message_text import listed
from simharness.scenario.sections.scenario import Scenario
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

SectionT = TypeVar("SectionT", bound=BaseModel)


@dataclass(frozen=True)
class Cause:
    """Cause of a lost score."""

    name: str
    """Name for command lines and files."""
    title: str
    """Name for people."""
    mended: str
    """What the system has when the cause is mended, for users who decide what to buy or mend."""
    keys: Sequence[str] = ()
    """Keys of a scenario that have their defaults when it is mended."""
    reveals: Visibility | None = None
    """Visibility of joints that become visible; None: of none."""
    labels: bool = False
    """Whether the true labels replace affinity and matching."""
    camera: bool = False
    """Whether the rig has one more camera."""

    def change(self, scenario: Scenario) -> Scenario:
        """Return a scenario without the cause."""
        for key in self.keys:
            scenario = _with_default(scenario, key)
        return scenario


def _with_default(section: SectionT, key: str) -> SectionT:
    """Return a section with the default of one key, which may be one of its own sections."""
    first, _, rest = key.partition(".")
    default = type(section).model_fields[first].get_default(call_default_factory=True)
    return section.model_copy(update={first: _with_default(getattr(section, first), rest) if rest else default})


_FILE = parse_toml(Path(__file__).parent.with_name("data").joinpath("causes.toml").read_text(encoding="utf-8"))
_REVEALS = {name: Visibility[entry.pop("reveals")] for name, entry in _FILE.items() if "reveals" in entry}

CAUSES: tuple[Cause, ...] = tuple(Cause(name, **entry, reveals=_REVEALS.get(name)) for name, entry in _FILE.items())
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
