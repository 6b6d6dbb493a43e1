"""Which stage of the method a failure is to blame on: the truth is put in for one after the other.

A frame with failures is estimated again, and the first substitution that mends a failure names its stage:

- detection: a perfect detector's report of the same pictures in place of the real one. What real detectors miss because
  it is hidden counts here, too.
- matching: perfect detections and the true labels.
- reconstruction: nothing of that mends it. What is left is reconstruction itself, and what it is given besides
  detections: a calibration that is off, pictures that are late, and too few views that have the joint in the picture.
- method: the last two, of a method that cannot be told labels: one from elsewhere, of which no stages are known.

With perfect detections little is left to mend, so one more substitution stands beside that order: the real detections
with the true labels, which says what a perfect matching alone would save.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import polars as pl
from scipy.optimize import linear_sum_assignment

from mvpose import COCO17, Detections, Estimate, Rig
from mvpose.pipeline import Estimator
from simharness.failures.classification import Failure, FailureKind, failures_of_frame
from simharness.failures.substitution import perfect_detections, true_labels, with_labels
from simharness.pairing.distance import mean_distances
from simharness.types.recording import Recording
from simharness.types.truth import Truth


class Stage(StrEnum):
    """The stages of the method, in the order in which the truth is put in for them."""

    DETECTION = "detection"
    MATCHING = "matching"
    RECONSTRUCTION = "reconstruction"
    METHOD = "method"


@dataclass(frozen=True)
class Blamed:
    """A failure and its cause.

    Attributes:
        failure: what went wrong.
        stage: the first stage for which the truth mends it.
        matching_alone: whether true labels of the real detections mend it; None for a method that cannot be told them.
    """

    failure: Failure
    stage: Stage
    matching_alone: bool | None


_OF_THE_WHOLE = (FailureKind.MISSED, FailureKind.MERGED, FailureKind.SPLIT)

FAILURE_SCHEMA: dict[str, Any] = {
    "frame": pl.Int64,
    "person": pl.Int64,
    "kind": pl.String,
    "stage": pl.String,
    "matching_alone": pl.Boolean,
    "joints": pl.List(pl.String),
    "error_mm": pl.Float64,
}
"""The columns of :func:`failure_table`."""


def blame(
    recording: Recording, estimator: Estimator, estimates: Sequence[Estimate], failures: Sequence[Failure]
) -> list[Blamed]:
    """Find the stage of every failure. Frames without failures cost nothing, the others three estimations at most.

    Somebody missed, merged or split is mended when they are none of these any more, though a joint of theirs may still
    be displaced: where every second person has some such joint, one who is found is found all the same. A swapped limb
    or a displaced joint is mended when nothing is wrong with the person. Of the ghosts of a frame as many are mended as
    there are fewer: those furthest from the ones that are left.

    Args:
        recording: T frames, as they were estimated. Heat maps are used if the detections carry them.
        estimator: the method. If it is none of mvpose's pipelines, true labels cannot be put in, and what perfect
            detections do not mend is the method's.
        estimates: what it said of the frames, T.
        failures: :func:`simharness.failures.classification.find_failures` of these.

    Returns:
        The failures in the same order.
    """
    result: list[Blamed] = []
    for frame, group in itertools.groupby(failures, key=lambda failure: failure.frame):
        scene = _Scene(recording.rig, recording.detections[frame], recording.truth[frame])
        result += _blame_frame(scene, estimator, estimates[frame], list(group))
    return result


@dataclass(frozen=True)
class _Scene:
    """A frame with some detections, real or not."""

    rig: Rig
    detections: Detections
    truth: Truth

    def mends(self, estimator: Estimator, before: Estimate, failures: Sequence[Failure]) -> list[bool]:
        """Which of the failures of a frame, estimated otherwise before, are none in this scene."""
        estimate = estimator.estimate(self.rig, self.detections)
        left = failures_of_frame(self.rig, self.detections, self.truth, estimate)
        kinds = {failure.person: failure.kind for failure in left}
        laid = _laid(before, _ghosts(failures), estimate, _ghosts(left))
        return [
            failure.estimate in laid
            if failure.kind is FailureKind.GHOST
            else _mended(failure.kind, kinds.get(failure.person))
            for failure in failures
        ]


def _mended(before: FailureKind, after: FailureKind | None) -> bool:
    """Whether somebody who was wrong in one way is no longer, now that they are wrong in another or not at all."""
    return after is None or (before in _OF_THE_WHOLE and after not in _OF_THE_WHOLE)


def _blame_frame(
    real: _Scene, estimator: Estimator, estimate: Estimate, failures: Sequence[Failure]
) -> Iterable[Blamed]:
    perfect = _Scene(real.rig, *perfect_detections(real.detections, real.truth))
    by_detection = perfect.mends(estimator, estimate, failures)
    by_matching = [False] * len(failures)
    left = Stage.RECONSTRUCTION
    told = with_labels(estimator, true_labels(perfect.detections, perfect.truth))
    if told is None:
        left = Stage.METHOD
    elif not all(by_detection):
        by_matching = perfect.mends(told, estimate, failures)
    alone: list[bool | None] = [None] * len(failures)
    told = with_labels(estimator, true_labels(real.detections, real.truth))
    if told is not None:
        alone = list(real.mends(told, estimate, failures))
    for failure, detection, matching, saved in zip(failures, by_detection, by_matching, alone, strict=True):
        stage = Stage.DETECTION if detection else Stage.MATCHING if matching else left
        yield Blamed(failure, stage, saved)


def _ghosts(failures: Sequence[Failure]) -> list[int]:
    return [failure.estimate for failure in failures if failure.kind is FailureKind.GHOST]


def _laid(before: Estimate, ghosts: list[int], after: Estimate, left: list[int]) -> set[int]:
    """Which ghosts are gone: all but the ones that, one to one, are nearest to those that are left."""
    distance = mean_distances(before.joints[ghosts], after.joints[left])
    stay, _ = linear_sum_assignment(np.minimum(distance, 1e6))  # two that share no joint are far apart
    return set(ghosts) - {ghosts[index] for index in stay}


def failure_table(failures: Iterable[Failure | Blamed]) -> pl.DataFrame:
    """A row for each failure, columns as :data:`FAILURE_SCHEMA`: joints by name, -1 for a ghost's person.

    Nobody is to blame (null) for failures that were not looked into.
    """
    return pl.DataFrame([_row(each) for each in failures], schema=FAILURE_SCHEMA, orient="row")


def _row(each: Failure | Blamed) -> tuple[Any, ...]:
    failure, stage, alone = (
        (each.failure, str(each.stage), each.matching_alone) if isinstance(each, Blamed) else (each, None, None)
    )
    joints = [COCO17.joints[joint] for joint in failure.joints]
    return failure.frame, failure.person, str(failure.kind), stage, alone, joints, failure.error_mm


def failure_scores(table: pl.DataFrame, frames: int) -> dict[str, float | None]:
    """``failures_<kind>``, of each kind a frame, and ``blame_<stage>``, percent of the failures; None without any whose
    stage is known, and of the stages of a method that are not.

    Args:
        table: of :func:`failure_table`.
        frames: how many were judged.

    Raises:
        ValueError: no frames.
    """
    if frames < 1:
        raise ValueError(f"failures are counted over one frame or more, got {frames}")
    kinds, stages = table["kind"].to_list(), table["stage"].drop_nulls().to_list()
    scores: dict[str, float | None] = {f"failures_{kind}": kinds.count(kind) / frames for kind in FailureKind}
    unknown = {Stage.MATCHING, Stage.RECONSTRUCTION} if Stage.METHOD in stages else set()
    for stage in Stage:
        known = stages and stage not in unknown
        scores[f"blame_{stage}"] = 100.0 * stages.count(stage) / len(stages) if known else None
    return scores
