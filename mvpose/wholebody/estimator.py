"""Estimators of the whole body, made of estimators of the body: of the 17 joints of COCO in the detections."""

import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import as_array, seal
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.heatmaps import Heatmaps
from mvpose.rays import viewing_rays
from mvpose.reconstruction import Triangulation
from mvpose.skeleton import COCO17, Skeleton


@dataclass(frozen=True)
class WholeBody:
    """Estimator of single frames that adds the joints beyond COCO17 to the people of another one.

    The other estimator gets the body alone. The joints beyond it are triangulated from the detections that it matched
    to each person, with the error model and covariances of :class:`mvpose.reconstruction.Triangulation`; a joint that
    fewer than two views agree on is missing. They belong to the pictures of the frame: a tracker does not move them to
    its own time, nor does it smooth them.
    """

    estimator: Estimator
    """Estimator of people on COCO17 that reports labels."""
    triangulation: Triangulation = Triangulation()
    """Reconstruction of the other joints."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame on the skeleton of the detections.

        Args:
            rig: calibrated cameras.
            detections: 2D poses of all views, on COCO17 or a skeleton that holds some of its joints.

        Raises:
            ValueError: as the estimator; a skeleton without joints of COCO17; an estimator that reports no labels.
        """
        body = self.estimator.estimate(rig, body_part(detections))
        return complete(rig, detections, body, triangulation=self.triangulation)


@dataclass(frozen=True)
class WholeBodyTracking(WholeBody):
    """As :class:`WholeBody`, of a tracker (:class:`mvpose.estimators.SequenceEstimator`)."""

    estimator: SequenceEstimator

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Yield the estimate of every frame of a recording, in order; every call starts without a past.

        Args:
            rig: calibrated cameras.
            frames: detections of each frame, in the order of time.

        Raises:
            ValueError: as :meth:`WholeBody.estimate`.
        """
        waiting: deque[Detections] = deque()  # frames whose estimates the tracker has not given yet

        def bodies() -> Iterator[Detections]:
            for detections in frames:
                waiting.append(detections)
                yield body_part(detections)

        for body in self.estimator.track(rig, bodies()):
            yield complete(rig, waiting.popleft(), body, triangulation=self.triangulation)


def complete(
    rig: Rig, detections: Detections, body: Estimate, *, triangulation: Triangulation | None = None
) -> Estimate:
    """Return an estimate on COCO17 on the skeleton of the detections, with the other joints triangulated.

    Args:
        rig: calibrated cameras.
        detections: 2D poses of all views, on COCO17 or a skeleton that holds some of its joints.
        body: estimate of people on COCO17 from these detections.
        triangulation: reconstruction of the other joints; ``Triangulation()`` by default.

    Raises:
        ValueError: a skeleton without joints of COCO17; an estimate without labels of these detections.
    """
    skeleton = detections.skeleton
    if skeleton == COCO17:
        return body
    start = time.perf_counter()
    rows, others = rows_of(skeleton)
    if len(body) and not body.matching.covers(len(detections)):
        raise ValueError("the estimator reports no labels of detections, without which other joints have no person")
    labels = body.matching.labels_of(len(detections))
    used = np.flatnonzero((labels >= 0) & (labels < len(body)))
    rays = viewing_rays(rig, _columns(detections, used, others))
    found = (triangulation or Triangulation())(rays, labels[used], _part(skeleton))
    count, known = len(found.joints), rows >= 0
    shape = len(body), len(skeleton)
    joints, scores = np.full((*shape, 3), np.nan), np.zeros(shape)
    covariance, freedom = np.full((*shape, 3, 3), np.nan), np.full(shape, np.nan)

    def place(whole: Floats, of_body: Floats, of_others: Floats) -> Floats:
        whole[:, rows[known]] = of_body[:, known]
        whole[:count, others] = of_others
        seal(whole)
        return whole

    seconds = time.perf_counter() - start
    timings = body.timings | {"whole body": seconds}
    if "total" in timings:
        timings["total"] += seconds
    return replace(
        body,
        joints=place(joints, body.joints, found.joints),
        scores=place(scores, body.scores, found.scores),
        covariance=None if body.covariance is None else place(covariance, body.covariance, found.covariance),
        freedom=None if body.freedom is None else place(freedom, body.freedom, found.freedom),
        timings=timings,
    )


def body_of(estimate: Estimate, skeleton: Skeleton) -> Estimate:
    """Return the part of an estimate on COCO17; a joint that the skeleton lacks is missing."""
    if skeleton == COCO17:
        return estimate
    rows, _ = rows_of(skeleton)

    def of_body(whole: Floats | None, missing: float) -> Floats | None:
        if whole is None:
            return None
        part = whole[:, rows].copy()
        part[:, rows < 0] = missing
        return part

    joints, scores = of_body(estimate.joints, np.nan), of_body(estimate.scores, 0.0)
    assert joints is not None
    assert scores is not None
    covariance, freedom = of_body(estimate.covariance, np.nan), of_body(estimate.freedom, np.nan)
    return replace(estimate, joints=joints, scores=scores, covariance=covariance, freedom=freedom)


def whole_body(estimator: Estimator) -> WholeBody:
    """Return an estimator of the whole body: a tracker if the given one is a tracker."""
    return WholeBodyTracking(estimator) if isinstance(estimator, SequenceEstimator) else WholeBody(estimator)


def _columns(detections: Detections, used: Integers, joints: Integers) -> Detections:
    """Return some joints of some detections."""
    return Detections(
        detections.view[used],
        detections.keypoints[np.ix_(used, joints)],
        detections.scores[np.ix_(used, joints)],
        detections.boxes[used],
        detections.box_scores[used],
        _part(detections.skeleton),
    )


@lru_cache(maxsize=64)
def _part(skeleton: Skeleton) -> Skeleton:
    """Return the joints of a skeleton beyond COCO17 as a skeleton; only their names and sigmas mean anything."""
    _, others = rows_of(skeleton)
    names, sigmas = tuple(skeleton.joints[row] for row in others), tuple(skeleton.sigmas[row] for row in others)
    parents = (-1, *[0] * (len(others) - 1))
    return Skeleton(f"{skeleton.name} beyond COCO17", names, parents, tuple(range(len(others))), sigmas)


@lru_cache(maxsize=64)
def rows_of(skeleton: Skeleton) -> tuple[Integers, Integers]:
    """Return the row of each joint of COCO17 in a skeleton, (17,), -1 for none, and the rows of its other joints, (E,).

    Raises:
        ValueError: a skeleton with none of the joints of COCO17, or with no others.
    """
    body = np.array([skeleton.joints.index(joint) if joint in skeleton.joints else -1 for joint in COCO17.joints])
    if (body < 0).all():
        raise ValueError(
            f"skeleton {skeleton.name!r} has no joint of COCO17, on which people are matched: expected names such as "
            f"{COCO17.joints[5]}, got {', '.join(skeleton.joints[:8])}"
        )
    others = np.setdiff1d(np.arange(len(skeleton)), body)
    if not len(others):
        raise ValueError(f"skeleton {skeleton.name!r} has no joint beyond COCO17; use COCO17 itself, in its order")
    seal(body, others)
    return body, others


def body_part(detections: Detections) -> Detections:
    """Return the detections on COCO17, with their boxes, descriptors and times; a joint that they lack is missing."""
    if detections.skeleton == COCO17:
        return detections
    rows, _ = rows_of(detections.skeleton)
    maps = detections.likelihoods
    return Detections(
        detections.view,
        np.where(rows[:, None] >= 0, detections.keypoints[:, rows], np.nan),
        np.where(rows >= 0, detections.scores[:, rows], 0.0),
        detections.boxes,
        detections.box_scores,
        COCO17,
        detections.descriptors,
        # A joint without a map would be one of -1, the last: its score of 0 overrides it.
        None if maps is None else Heatmaps(maps.values[:, rows], maps.origin, maps.stride),
        detections.time,
    )


def with_body_boxes(view: ArrayLike, keypoints: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton) -> Detections:
    """Create detections of the whole body with boxes that span the joints of COCO17 and have their mean score.

    So the method gets what :meth:`mvpose.Detections.from_keypoints` makes of the body alone.

    Args:
        view: camera of each detection, (m,).
        keypoints: pixels, (m, J, 2).
        scores: confidence of each keypoint, 0 to 1, (m, J).
        skeleton: the J joints.

    Raises:
        ValueError: as :class:`mvpose.Detections`, or a skeleton without joints of COCO17.
    """
    whole = Detections.from_keypoints(view, keypoints, scores, skeleton=skeleton)
    if skeleton == COCO17:
        return whole
    seen = body_part(whole)
    body = Detections.from_keypoints(seen.view, seen.keypoints, seen.scores)
    boxes = as_array(body.boxes, (len(whole), 4), "boxes")
    return Detections(whole.view, whole.keypoints, whole.scores, boxes, body.box_scores, skeleton)
