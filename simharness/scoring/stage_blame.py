"""Stage to blame for each failure, found by replacing one stage after the other by the truth.

A frame with failures is estimated again, and the first substitution that removes a failure determines its stage:

- detection: perfect detections of the same pictures in place of the real ones. Misses of hidden people count here, too.
- matching: perfect detections and the true labels.
- reconstruction: neither removes the failure. The cause is reconstruction itself or its other input: a wrong
  calibration, late pictures, or too few views with the joint inside the picture.
- method: matching or reconstruction of a user-defined estimator, which takes no labels and returns none.

A user-defined estimator takes no labels, but may return them: matching has the blame where the labels of the perfect
detections are wrong for the person of the failure, or for anybody if it is a ghost, and reconstruction where they are
right. A tracker gets perfect detections in all frames, because the cause may lie in an earlier one, and is otherwise
such an estimator.

Perfect detections remove most failures, so matching rarely gets the blame. One more substitution stands beside that
order: the real detections with the true labels, which shows what a perfect matching alone would remove.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
import polars as pl
from scipy.optimize import linear_sum_assignment

from mvpose import COCO17, Detections, Estimate, Pipeline, Rig, Skeleton
from mvpose.arrays import Integers
from mvpose.commands.errors import naming_frame
from mvpose.estimate import Matching
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.pipeline import UnmatchedPipeline
from mvpose.rays import Rays, viewing_rays
from mvpose.reconstruction import Poses
from simharness.scoring.failure_classes import Failure, FailureKind, failures_of_frame
from simharness.scoring.pairing import mean_distances
from simharness.types.recording import Recording
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility


class Stage(StrEnum):
    """Stages of the method, in the order in which they are replaced by the truth."""

    DETECTION = "detection"
    MATCHING = "matching"
    RECONSTRUCTION = "reconstruction"
    METHOD = "method"


@dataclass(frozen=True)
class Blamed:
    """Failure and the stage to blame."""

    failure: Failure
    """The failure."""
    stage: Stage
    """First stage whose replacement by the truth removes it."""
    matching_alone: bool | None
    """Whether true labels of the real detections remove it; None for a method that takes no labels."""


_WHOLE_PERSON = (FailureKind.MISSED, FailureKind.MERGED, FailureKind.SPLIT)

FAILURE_SCHEMA: dict[str, Any] = {
    "frame": pl.Int64,
    "person": pl.Int64,
    "kind": pl.String,
    "stage": pl.String,
    "matching_alone": pl.Boolean,
    "joints": pl.List(pl.String),
    "error_mm": pl.Float64,
}
"""Columns and types of :func:`failure_table`."""


def blame_frames(
    recording: Recording, estimator: Estimator, estimates: Sequence[Estimate], input_of: Callable[[int], Detections]
) -> Iterator[Blamed]:
    """Find failures and the stage to blame frame by frame, because heat maps of all frames are large.

    Each frame with failures is estimated three more times at most; with a tracker all frames are, once. A missed,
    merged or split person is no longer a failure of that class as soon as the person is none of the three, even with a
    displaced joint, because displaced joints are frequent. A swapped limb or a displaced joint is removed when the
    person has no failure at all. If a frame has k ghosts fewer than before, k ghosts are removed: those furthest from
    the remaining ones.

    Args:
        recording: T frames.
        estimator: the method. Only pipelines of mvpose take true labels; of others the labels that they return are
            compared with the true ones. Without labels, failures that perfect detections do not remove are blamed on
            the method.
        estimates: its estimates, T.
        input_of: detections of a frame as the method got them, with heat maps if it reads them.

    Raises:
        RunError: the method failed; the message names the frame.
    """
    rig = recording.rig
    after: Iterator[Estimate] = iter(())
    if isinstance(estimator, SequenceEstimator):
        pairs = zip(recording.detections, recording.truth, strict=True)
        after = estimator.track(rig, (perfect_detections(*pair)[0] for pair in pairs))
    for frame, (truth, estimate) in enumerate(zip(recording.truth, estimates, strict=True)):
        tracked = next(after, None)
        if failures := failures_of_frame(rig, recording.detections[frame], truth, estimate):
            with naming_frame(frame):
                blamed = _blame_frame(_FrameInput(rig, input_of(frame), truth), estimator, estimate, failures, tracked)
            for each in blamed:
                yield replace(each, failure=replace(each.failure, frame=frame))


def perfect_detections(detections: Detections, truth: Truth) -> tuple[Detections, Truth]:
    """Return the perfect detections of a frame and the truth of these detections.

    Every person with a joint inside a picture is detected there, with the joints inside at their exact pixels, hidden
    or not, as by the detector profile "perfect"; there are no other detections. Scores are 1; there are no heat maps.
    A detection has the descriptor of the real detection of the same person in the same view (if several, of the one
    with the highest box score). Without a real detection the descriptor is NaN: geometry can still match such a
    detection, a method that uses descriptors alone cannot.

    Args:
        detections: the real detections.
        truth: truth of the frame and of the real detections.
    """
    inside = truth.visibility != Visibility.OUTSIDE
    view, person = np.nonzero(inside.any(axis=-1))
    reported = inside[view, person]
    descriptors = None
    if detections.descriptors is not None:
        real = _highest_scored(detections, truth)[view, person]
        descriptors = np.full((len(view), detections.descriptors.shape[1]), np.nan)
        descriptors[real >= 0] = detections.descriptors[real[real >= 0]]
    perfect = Detections(
        view,
        np.where(reported[..., None], truth.pixels[view, person], np.nan),
        reported.astype(float),
        truth.boxes[view, person],
        np.ones(len(view)),
        detections.skeleton,
        descriptors,
        time=detections.time,
    )
    error = np.where(reported, KeypointError.GOOD, KeypointError.ABSENT)
    return perfect, replace(truth, person=person, error=error)


def true_labels(detections: Detections, truth: Truth) -> Integers:
    """Return the labels of a perfect matching of m detections, (m,): people detected in two or more views, from 0.

    Of several detections of a person in one view, the one with the highest score has the label. The others, phantoms,
    and people detected in a single view have label -1.
    """
    highest = _highest_scored(detections, truth)
    detected = highest >= 0
    detected &= detected.sum(axis=0) > 1
    labels = np.full(len(detections), -1)
    number = np.cumsum(detected.any(axis=0)) - 1
    labels[highest[detected]] = np.broadcast_to(number, detected.shape)[detected]
    return labels


@dataclass(frozen=True)
class LabelledPipeline:
    """Pipeline with given labels in place of affinity and matching."""

    labels: Integers
    """Label of each detection of its input, (m,)."""
    reconstruction: Callable[[Rays, Integers, Skeleton], Poses]
    """As in :class:`mvpose.Pipeline`."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Reconstruct the labelled people of one frame."""
        poses = self.reconstruction(viewing_rays(rig, detections), self.labels, detections.skeleton)
        return Estimate(poses.joints, poses.scores, Matching(self.labels), poses.covariance)


def with_labels(estimator: Estimator, labels: Integers) -> LabelledPipeline | None:
    """Return a pipeline with given labels in place of its matching; None for a method whose stages are unknown.

    A pipeline without matching assigns detections during reconstruction, so it is replaced by the preset "full" (3D
    pictorial structures) with the given labels.

    Args:
        estimator: the method.
        labels: label of each detection of its input, (m,).
    """
    estimator = getattr(estimator, "loaded", estimator)  # a user-defined estimator may be a pipeline
    if isinstance(estimator, UnmatchedPipeline):
        estimator = Pipeline()
    if not isinstance(estimator, Pipeline):
        return None
    return LabelledPipeline(labels, estimator.reconstruction)


def failure_table(failures: Iterable[Failure | Blamed]) -> pl.DataFrame:
    """Return a table with a row for each failure and the columns of :data:`FAILURE_SCHEMA`.

    Joints are given by name; the person of a ghost is -1; the stage of a failure without blame is null.
    """
    return pl.DataFrame([_row(each) for each in failures], schema=FAILURE_SCHEMA, orient="row")


def failure_scores(table: pl.DataFrame, frames: int) -> dict[str, float | None]:
    """Return the scores of failures: ``failures_<kind>`` per frame, and ``blame_<stage>`` in percent of the failures.

    ``blame_<stage>`` is None without blamed failures; for a method whose stages are unknown, matching and
    reconstruction are None.

    Args:
        table: table of :func:`failure_table`.
        frames: number of frames that were classified.

    Raises:
        ValueError: no frames.
    """
    if frames < 1:
        raise ValueError(f"failures must be counted over one frame or more, got {frames}")
    kinds, stages = table["kind"].to_list(), table["stage"].drop_nulls().to_list()
    scores: dict[str, float | None] = {f"failures_{kind}": kinds.count(kind) / frames for kind in FailureKind}
    unknown = {Stage.MATCHING, Stage.RECONSTRUCTION} if Stage.METHOD in stages else set()
    for stage in Stage:
        known = stages and stage not in unknown
        scores[f"blame_{stage}"] = 100.0 * stages.count(stage) / len(stages) if known else None
    return scores


@dataclass(frozen=True)
class _FrameInput:
    """One frame with real or perfect detections."""

    rig: Rig
    detections: Detections
    truth: Truth

    def removes(self, after: Estimate, before: Estimate, failures: Sequence[Failure]) -> list[bool]:
        """Return which of the failures of an earlier estimate of the frame are gone in one of this input."""
        remaining = failures_of_frame(self.rig, self.detections, self.truth, after)
        kinds = {failure.person: failure.kind for failure in remaining}
        removed_ghosts = _removed_ghosts(before, _ghosts(failures), after, _ghosts(remaining))
        return [
            failure.estimate in removed_ghosts
            if failure.kind is FailureKind.GHOST
            else _removed(failure.kind, kinds.get(failure.person))
            for failure in failures
        ]


def _removed(before: FailureKind, after: FailureKind | None) -> bool:
    """Return whether a person's failure is removed, if the person now has failure ``after``, or none."""
    return after is None or (before in _WHOLE_PERSON and after not in _WHOLE_PERSON)


def _blame_frame(
    real: _FrameInput, estimator: Estimator, estimate: Estimate, failures: Sequence[Failure], tracked: Estimate | None
) -> Iterable[Blamed]:
    """Yield the stages to blame; ``tracked`` is the estimate of a tracker from perfect detections."""
    perfect = _FrameInput(real.rig, *perfect_detections(real.detections, real.truth))
    after = estimator.estimate(perfect.rig, perfect.detections) if tracked is None else tracked
    by_detection = perfect.removes(after, estimate, failures)
    by_matching = [False] * len(failures)
    last = Stage.RECONSTRUCTION
    labelled = with_labels(estimator, true_labels(perfect.detections, perfect.truth))
    if labelled is None and after.matching.people:
        wrong = _wrongly_matched(after.matching.labels, perfect)
        by_matching = [bool(wrong) if each.person < 0 else each.person in wrong for each in failures]
    elif labelled is None:
        last = Stage.METHOD
    elif not all(by_detection):
        by_matching = perfect.removes(labelled.estimate(perfect.rig, perfect.detections), estimate, failures)
    matching_alone: list[bool | None] = [None] * len(failures)
    labelled = with_labels(estimator, true_labels(real.detections, real.truth))
    if labelled is not None:
        matching_alone = list(real.removes(labelled.estimate(real.rig, real.detections), estimate, failures))
    for failure, detection, matching, alone in zip(failures, by_detection, by_matching, matching_alone, strict=True):
        stage = Stage.DETECTION if detection else Stage.MATCHING if matching else last
        yield Blamed(failure, stage, alone)


def _wrongly_matched(labels: Integers, perfect: _FrameInput) -> set[int]:
    """Return the people of two or more perfect detections that are not one group of their own."""
    truth = true_labels(perfect.detections, perfect.truth)
    wrong = set()
    for person in np.unique(perfect.truth.person[truth >= 0]):
        theirs = perfect.truth.person == person
        groups = set(labels[theirs].tolist())
        if len(groups) > 1 or -1 in groups or np.isin(labels[~theirs], list(groups)).any():
            wrong.add(int(person))
    return wrong


def _ghosts(failures: Sequence[Failure]) -> list[int]:
    return [failure.estimate for failure in failures if failure.kind is FailureKind.GHOST]


def _removed_ghosts(before: Estimate, ghosts: list[int], after: Estimate, remaining: list[int]) -> set[int]:
    """Return the removed ghosts: all except those paired one to one with the nearest remaining ghosts."""
    distance = mean_distances(before.joints[ghosts], after.joints[remaining])
    stay, _ = linear_sum_assignment(np.minimum(distance, 1e6))  # infinite where two ghosts share no joint
    return set(ghosts) - {ghosts[index] for index in stay}


def _row(each: Failure | Blamed) -> tuple[Any, ...]:
    failure, stage, alone = (
        (each.failure, str(each.stage), each.matching_alone) if isinstance(each, Blamed) else (each, None, None)
    )
    joints = [COCO17.joints[joint] for joint in failure.joints]
    return failure.frame, failure.person, str(failure.kind), stage, alone, joints, failure.error_mm


def _highest_scored(detections: Detections, truth: Truth) -> Integers:
    """Return the detection of each person in each view with the highest box score, (V, P); -1 where there is none.

    Ties are broken by the mean keypoint score, then by the order of the detections.
    """
    highest = np.full(truth.boxes.shape[:2], -1)
    ascending = np.lexsort((-np.arange(len(detections)), detections.scores.sum(axis=1), detections.box_scores))
    ascending = ascending[truth.person[ascending] >= 0]
    highest[detections.view[ascending], truth.person[ascending]] = ascending  # the last of repeated indices stays
    return highest
