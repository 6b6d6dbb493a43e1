"""Estimation after repair: the rig and the clocks are corrected from the whole recording, then people are estimated.

Methods that take a frame by itself get detections at one time of each frame where the clocks of cameras differ: of each
camera the picture that was truly taken nearest to the time of the frame, with keypoints that are moved by their
velocities in the picture over what is left, half a frame at most. Trackers need none of this: they read the times of
the pictures (:meth:`mvpose.calibration.clocks.Clocks.corrected`).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.clocks import Clocks, estimate_clocks
from mvpose.calibration.repair import repair
from mvpose.calibration.tracklets import Tracklets, link, picture_times
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.estimators import Estimator, SequenceEstimator

_TOO_FAR = 0.75  # frames between a frame and the nearest picture of a camera, beyond which it has none
_COLUMNS = ("view", "keypoints", "scores", "boxes", "box_scores")


@dataclass(frozen=True)
class RepairedPipeline:
    """Estimator of recordings (:class:`mvpose.estimators.SequenceEstimator`) that repairs the rig first.

    All frames are read before the first estimate. The repaired rig is used where the repair is not refused; its size is
    that of the believed calibration and of bone lengths together. Clocks are corrected where one is an alarm: an
    estimator with memory gets the corrected times of pictures, an estimator of single frames gets detections that are
    moved to the times of the frames.
    """

    estimator: Estimator
    """What estimates people."""
    period: float = 0.04
    """Time between frames whose detections carry no time, seconds."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame alone, without repair: one frame does not determine the calibration."""
        return self.estimator.estimate(rig, detections)

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Repair the rig and the clocks, then yield the estimates (:class:`mvpose.estimators.SequenceEstimator`)."""
        given = list(frames)
        if not given:
            return
        rig = repair(rig, given, period=self.period, size="both").rig
        clocks = estimate_clocks(rig, given, period=self.period)
        wrong = any(each.severity == "alarm" for each in clocks.findings())
        if isinstance(self.estimator, SequenceEstimator):
            yield from self.estimator.track(rig, clocks.corrected(given) if wrong else given)
        elif not wrong:
            yield from (self.estimator.estimate(rig, each) for each in given)
        else:
            moved = resampled(rig, given, clocks)
            for each, rows in zip(moved.frames, moved.rows, strict=True):
                yield _of_given(self.estimator.estimate(rig, each), rows, len(each))


def _of_given(estimate: Estimate, rows: Integers, count: int) -> Estimate:
    """Return the estimate with labels of the detections that were given.

    Args:
        estimate: estimate of ``count`` moved detections.
        rows: the moved detection of each given one, -1 for none.
        count: number of moved detections.
    """
    labels = np.append(estimate.matching.labels_of(count), -1)[rows]  # row -1 is the last
    return replace(estimate, matching=replace(estimate.matching, labels=labels, P=None))


@dataclass(frozen=True)
class Resampled:
    """Detections of F frames, all of the time of their frame."""

    frames: tuple[Detections, ...]
    """The detections, F."""
    rows: tuple[Integers, ...]
    """For each detection of the frames that were given, the detection in ``frames`` of the same frame that shows the
    same person, or -1: F arrays (m,)."""


def resampled(rig: Rig, frames: Sequence[Detections], clocks: Clocks) -> Resampled:
    """Return detections as if all cameras had taken their pictures at the times of the frames.

    Heat maps are left out, because they cannot be moved.

    Args:
        rig: the cameras.
        frames: detections of each frame.
        clocks: clocks of these frames (:func:`mvpose.calibration.clocks.estimate_clocks`).
    """
    period = clocks.period
    tracklets = link(rig, frames, period=period)
    number, velocity = _of_detections(frames, tracklets)
    given = picture_times(frames, len(rig), period=period)
    when = np.array([np.nanmedian(row) if np.isfinite(row).any() else np.nan for row in given])
    taken = np.where(np.isfinite(clocks.times), clocks.times, np.inf)
    result, rows = [], []
    for frame, each in enumerate(frames):
        parts = []
        for view in range(len(rig)):
            nearest = int(np.abs(taken[:, view] - when[frame]).argmin())
            lead = when[frame] - taken[nearest, view]
            if abs(lead) <= _TOO_FAR * period:
                own = np.flatnonzero(frames[nearest].view == view)
                parts.append(_moved(frames[nearest].select(own), lead, velocity[nearest][own], number[nearest][own]))
        moved, labels = _joined(parts, each)
        rows.append(_same(number[frame], labels))
        result.append(replace(moved, time=np.full(len(rig), when[frame]) if each.time is not None else None))
    return Resampled(tuple(result), tuple(rows))


def _of_detections(frames: Sequence[Detections], tracklets: Tracklets) -> tuple[list[Integers], list[Floats]]:
    """Return tracklet (m,), -1 for none, and velocity (m, J, 2) of the detections of each frame."""
    known = {
        (frame, view, keypoints.tobytes()): row
        for row, (frame, view, keypoints) in enumerate(
            zip(tracklets.frame.tolist(), tracklets.view.tolist(), tracklets.keypoints, strict=True)
        )
    }
    numbers, velocities = [], []
    for frame, each in enumerate(frames):
        rows = np.array(
            [
                known.get((frame, int(v), points.tobytes()), -1)
                for v, points in zip(each.view, each.keypoints, strict=True)
            ],
            np.int64,
        )
        found = rows >= 0
        number, velocity = np.full(len(each), -1), np.zeros_like(each.keypoints)
        number[found], velocity[found] = tracklets.tracklet[rows[found]], tracklets.velocity[rows[found]]
        numbers.append(number)
        velocities.append(velocity)
    return numbers, velocities


def _moved(detections: Detections, lead: float, velocity: Floats, number: Integers) -> tuple[Detections, Integers]:
    """Return detections some seconds later."""
    keypoints = detections.keypoints + lead * velocity
    count = np.maximum(detections.detected.sum(axis=1, keepdims=True), 1)
    middle = np.where(detections.detected[..., None], velocity, 0.0).sum(axis=1) / count
    boxes = detections.boxes + lead * np.column_stack([middle, np.zeros_like(middle)])
    return replace(detections, keypoints=keypoints, boxes=boxes, likelihoods=None), number


def _joined(parts: Sequence[tuple[Detections, Integers]], like: Detections) -> tuple[Detections, Integers]:
    """Return the detections of all views and their tracklets."""
    if not parts:
        return like.select(np.zeros(len(like), np.bool_)), np.zeros(0, np.int64)
    columns: dict[str, Any] = {key: np.concatenate([getattr(each, key) for each, _ in parts]) for key in _COLUMNS}
    described = all(each.descriptors is not None for each, _ in parts)
    descriptors = np.concatenate([np.asarray(each.descriptors) for each, _ in parts]) if described else None
    numbers = np.concatenate([number for _, number in parts])
    return Detections(**columns, skeleton=like.skeleton, descriptors=descriptors), numbers


def _same(wanted: Integers, there: Integers) -> Integers:
    """Return for each tracklet where it is among others, -1 where it is not."""
    place = {int(tracklet): row for row, tracklet in enumerate(there) if tracklet >= 0}
    return np.array([place.get(int(tracklet), -1) for tracklet in wanted], np.int64)
