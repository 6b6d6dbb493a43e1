"""Registry of detector errors: the ordered steps that turn perfect detections into those of a real detector.

:func:`simharness.detector.detect.detect` begins with the perfect detections of all people
(:meth:`~simharness.detector.detection_block.DetectionBlock.of_people`) and runs every registered step on them, ordered
by :class:`StepStage` and within a stage by :data:`MODULES`.

An added error is a section of :mod:`simharness.scenario.sections.detector_section`, a field of ``DetectorSection`` with
it, one file with the step, and its name in :data:`MODULES`: see "a detector error" in the documentation (extending).

Rules for a step:

- It changes no array of the block that it gets, and returns a new block (``dataclasses.replace``).
- It keeps the fields consistent: where a keypoint is not reported, its coordinates are NaN, its score 0 and its error
  class ABSENT; a slot without a reported keypoint is not ``present``; where a keypoint moves far, ``error`` follows
  (:func:`simharness.detector.error_classes.classify`, with the unit ``context.conditions.unit`` and the true pixels
  ``context.views.pixels``). Appended slots go behind the others
  (:meth:`~simharness.detector.detection_block.DetectionBlock.concatenate`).
- Random numbers come from ``context.draws``, under a key that begins with the name of the step, and never from
  another generator. Draw the whole block first and mask it afterwards, so that the draws depend on nothing but the key
  and the shape of the sequence. Then a parameter at zero changes nothing, and a parameter that is raised adds errors
  and changes no other draw: two runs that differ in one parameter are paired.
- Keys of existing draws never change, not even to follow a renamed function: a new key is another detector.
"""

import difflib
import importlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

from mvpose.camera import Rig
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.draws import KeyedDraws
from simharness.detector.viewing_conditions import Conditions
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.sequence import Sequence
from simharness.types.views import Views

MODULES = ("keypoints", "score_distance", "boxes", "phantoms", "false_positives", "heatmaps", "delivery")
"""Modules of ``simharness.detector`` that register steps, in the order in which steps of one stage run."""


class StepStage(IntEnum):
    """Stage of detection in which a step runs, and what the block holds before it."""

    KEYPOINTS = 1
    """Positions and error classes of keypoints. One slot for each person, scores of 0 and 1; until PEOPLE the boxes are
    those of the true silhouettes."""
    SCORES = 2
    """Scores of keypoints. One slot for each person, keypoints with their errors."""
    PEOPLE = 3
    """Which people are detected, and their boxes. One slot for each person, with all keypoints and scores."""
    FALSE_POSITIVES = 4
    """Detections that show no person, in appended slots. The slots of people are complete."""
    DETECTIONS = 5
    """Errors that people and false positives have in common. All slots are complete."""
    DELIVERY = 6
    """Which picture arrives in which frame. The block is by the frame in which a picture was taken."""


@dataclass(frozen=True)
class Context:
    """Everything that a step may read: the truth, the cameras, the parameters and the random draws."""

    sequence: Sequence
    """Ground truth in space, T frames of P people."""
    views: Views
    """Ground truth in the pictures of V cameras."""
    rig: Rig
    """True rig, which takes the pictures."""
    config: DetectorSection
    """All parameters of the detector."""
    draws: KeyedDraws
    """Keyed random draws."""

    @cached_property
    def conditions(self) -> Conditions:
        """Viewing conditions of everyone in the pictures."""
        return Conditions.of_views(self.views)


StepFunction = Callable[[DetectionBlock, Context], DetectionBlock]


@dataclass(frozen=True)
class Step:
    """One registered error of the detector."""

    name: str
    """Unique name."""
    stage: StepStage
    """When it runs."""
    sections: tuple[str, ...]
    """Sections of ``[detector]`` that it reads."""
    apply: StepFunction
    """The function itself."""


REGISTRY: dict[str, Step] = {}
"""Registered steps by name; complete after :func:`registered_steps`."""


def step(name: str, *, stage: StepStage, sections: tuple[str, ...] = ()) -> Callable[[StepFunction], StepFunction]:
    """Register the decorated function as a step of the detector.

    Args:
        name: unique name of the step.
        stage: when it runs.
        sections: sections of ``[detector]`` that it reads.

    Raises:
        ValueError: the name is taken, or a section is no field of :class:`DetectorSection`.
    """
    if name in REGISTRY:
        raise ValueError(f"detector step {name!r} is registered twice; choose another name")
    for section in sections:
        if section not in DetectorSection.model_fields:
            near = difflib.get_close_matches(section, DetectorSection.model_fields, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(
                f"detector step {name!r}: expected sections of [detector] ({', '.join(DetectorSection.model_fields)}), "
                f"got {section!r}{hint}"
            )

    def register(function: StepFunction) -> StepFunction:
        REGISTRY[name] = Step(name, stage, sections, function)
        return function

    return register


def registered_steps() -> tuple[Step, ...]:
    """Return all steps in the order in which they run: by stage, then by :data:`MODULES`, others last.

    The order does not depend on which module is imported first.
    """
    order = [importlib.import_module(f"simharness.detector.{module}").__name__ for module in MODULES]

    def place(each: Step) -> tuple[int, int]:
        module = each.apply.__module__
        return each.stage, order.index(module) if module in order else len(order)

    return tuple(sorted(REGISTRY.values(), key=place))
