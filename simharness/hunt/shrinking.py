"""Shrinking of a frame that fails: the fewest people, cameras and errors, and the roundest numbers, that still fail.

Delta debugging (Zeller & Hildebrandt, "Simplifying and isolating failure-inducing input", IEEE TSE 2002) over people,
cameras, then errors, whose groups come first (Misherghi & Su, "HDD: hierarchical delta debugging", ICSE 2006). The
result is 1-minimal: without any single one of its people, cameras or errors the frame no longer fails in this way.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

from mvpose import COCO17, Detections, Rig
from mvpose.estimators import Estimator
from simharness.hunt.frozen_frame import DrawnError, FrozenFrame, camera_of
from simharness.hunt.properties import FrameAnswer, Violation, violations
from simharness.scoring.failure_classes import FailureKind
from simharness.scoring.stage_blame import blame_frames
from simharness.types.random_streams import stream
from simharness.types.recording import Recording
from simharness.types.truth import Truth

T = TypeVar("T")
Fails = Callable[[FrozenFrame], bool]

SEEDS = 20
"""Number of seeds of that noise."""

LEAST_CAMERAS = 3
"""Fewest cameras of a frame that counts as failing: two leave the depth of a single wrong keypoint open."""

NOISE = 2.0
"""Standard deviation of the noise that keypoints without an error get, to see whether a frame fails by chance, px."""

_STEPS: tuple[tuple[str, tuple[str, ...], tuple[float, ...]], ...] = (
    ("errors", ("offset",), (10.0, 1.0, 0.1)),
    ("errors", ("score",), (1.0, 0.1, 0.01)),
    ("errors", ("joints",), (0.1, 0.01)),
    ("people", ("joints",), (0.1, 0.01, 0.001)),
    ("cameras", ("position",), (0.1, 0.01, 0.001)),
    ("cameras", ("rotation",), (0.1, 0.01, 0.001)),
    ("cameras", ("focal", "principal"), (10.0, 1.0)),
    ("cameras", ("skew", "distortion"), (100.0,)),  # none at all
)
"""What is rounded, in this order: part of the frame, fields, and the steps that are tried, the coarsest first."""


@dataclass
class Judge:
    """Tells what fails in frozen frames, and counts the frames."""

    variant: Estimator
    """The method."""
    rival: Estimator | None = None
    """Another variant, for the property "disagree"."""
    judged: int = field(default=0, init=False)
    """Number of frames that were judged."""

    def violations(self, frame: FrozenFrame, properties: Sequence[str]) -> list[Violation]:
        """Return the violations of a frame; their people are given by their numbers in the trial."""
        self.judged += 1
        found = self.violations_of(*frame.detected(), properties)
        return [each if each.person < 0 else replace(each, person=frame.numbers[each.person]) for each in found]

    def violations_of(
        self, rig: Rig, detections: Detections, truth: Truth, properties: Sequence[str]
    ) -> list[Violation]:
        """Return the violations of a frame of a trial."""
        estimate = self.variant.estimate(rig, detections)
        return violations(FrameAnswer(rig, detections, truth, estimate, self.variant, self.rival), properties)

    def fails(self, target: Violation, frame: FrozenFrame) -> bool:
        """Return whether a frame has a violation like the target; one with too few cameras has none."""
        if len(frame.cameras) < LEAST_CAMERAS:
            return False
        return any(target.is_like(each) for each in self.violations(frame, (target.property,)))


def stage_of(recording: Recording, violation: Violation, variant: Estimator) -> str:
    """Return the stage to blame for a violation in a recording of one frame; "" where it is no class of failures."""
    if violation.property not in set(FailureKind):
        return ""
    estimate = variant.estimate(recording.rig, recording.detections[0])
    for each in blame_frames(recording, variant, [estimate], lambda _: recording.detections[0]):
        if (str(each.failure.kind), each.failure.person) == (violation.property, violation.person):
            return str(each.stage)
    return ""


def shrink(frame: FrozenFrame, fails: Fails) -> FrozenFrame:
    """Return the smallest frame that still fails.

    Raises:
        ValueError: the frame does not fail.
    """
    if not fails(frame):
        raise ValueError("only a frame that fails can be shrunk: this one does not, once it stands alone")
    before = None
    while frame != before:
        before = frame
        frame = frame.of(people=minimal(frame.people, partial(_fails_with, frame, fails, "people")))
        frame = frame.of(cameras=minimal(frame.cameras, partial(_fails_with, frame, fails, "cameras")))
        for fields in (("kind",), ("camera",), ("kind", "camera", "person"), tuple(DrawnError.model_fields)):
            frame = _fewer_errors(frame, fails, attrgetter(*fields))
        if frame == before:
            frame = rounded(frame, fails)
    return frame


def _fails_with(frame: FrozenFrame, fails: Fails, what: str, some: Sequence[Any]) -> bool:
    return fails(frame.of(**{what: some}))


def minimal(items: Sequence[T], fails: Callable[[tuple[T, ...]], bool]) -> tuple[T, ...]:
    """Return some of the items that fail together, none of which can be left out; all of them fail together."""
    items = tuple(items)
    parts = 2
    while items:
        bounds = np.linspace(0, len(items), min(parts, len(items)) + 1).astype(int)
        for start, end in itertools.pairwise(bounds):
            if fails(rest := items[:start] + items[end:]):
                items, parts = rest, max(parts - 1, 2)
                break
        else:
            if parts >= len(items):
                break
            parts *= 2
    return items


def _fewer_errors(frame: FrozenFrame, fails: Fails, group: Callable[[DrawnError], Any]) -> FrozenFrame:
    """Return the frame with as few groups of errors as possible."""
    groups: dict[Any, list[DrawnError]] = {}
    for each in frame.errors:
        groups.setdefault(group(each), []).append(each)

    def of(some: Iterable[list[DrawnError]]) -> FrozenFrame:
        return frame.with_errors(each for errors in some for each in errors)

    return of(minimal(list(groups.values()), lambda some: fails(of(some))))


def rounded(frame: FrozenFrame, fails: Fails) -> FrozenFrame:
    """Return the frame with its numbers rounded as coarsely as it still fails, one quantity after the other."""
    for part, fields, steps in _STEPS:
        for step in steps:
            changed = [
                each.model_copy(update={name: _round(getattr(each, name), step, name) for name in fields})
                for each in getattr(frame, part)
            ]
            coarse = frame.model_copy(update={part: tuple(changed)})
            if coarse == frame or fails(coarse):
                frame = coarse
                break
    return frame


def _round(value: Any, step: float, name: str) -> Any:
    """Return a number, or nested tuples of numbers, at multiples of a step; scores rise, because 0 has a meaning."""
    if value is None or isinstance(value, tuple):
        return value and tuple(_round(each, step, name) for each in value)
    whole = math.ceil(value / step - 1e-9) if name == "score" else round(value / step)
    return float(f"{whole * step:.10g}") + 0.0


def fresh_noise(frame: FrozenFrame, fails: Fails, *, seeds: int = SEEDS) -> int:
    """Return of how many seeds of noise a frame fails again.

    Joints without an error get an offset of :data:`NOISE` pixels in x and in y; errors stay.

    Args:
        frame: a shrunk frame.
        fails: whether a frame fails in the same way.
        seeds: number of seeds.
    """
    taken = {(each.camera, each.person, each.joint) for each in frame.errors if each.kind == "keypoint"}
    _, place = frame.places()
    failed = 0
    for seed in range(seeds):
        offsets = stream(seed, "hunt", "noise").normal(scale=NOISE, size=place.shape).tolist()
        noise = [
            DrawnError(
                kind="keypoint", camera=each.name, person=number, joint=joint, offset=offsets[v][p][j], score=1.0
            )
            for v, each in enumerate(frame.cameras)
            for p, number in enumerate(frame.numbers)
            for j, joint in enumerate(COCO17.joints)
            if (each.name, number, joint) not in taken and camera_of(each).inside(place[v, p, j])
        ]
        failed += fails(frame.with_errors((*frame.errors, *noise)))
    return failed
