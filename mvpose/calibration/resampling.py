"""Detections at one time of each frame, where the clocks of cameras differ: for methods that take a frame by itself.

A frame gets of each camera the picture that was truly taken nearest to its time, and the keypoints are moved by their
velocities in the picture over what is left, half a frame at most. The tracker needs none of this: it reads the times of
the pictures (:meth:`mvpose.calibration.clocks.Clocks.corrected`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.clocks import Clocks
from mvpose.calibration.tracklets import Tracklets, link, picture_times
from mvpose.camera import Rig
from mvpose.detections import Detections

_TOO_FAR = 0.75  # frames between a frame and the nearest picture of a camera, beyond which it has none
_COLUMNS = ("view", "keypoints", "scores", "boxes", "box_scores")


@dataclass(frozen=True)
class Resampled:
    """Detections of F frames, all of the time of their frame.

    Attributes:
        frames: the detections, F.
        rows: for each detection of the frames that were given, the detection in ``frames`` of the same frame that shows
            the same person, or -1: F arrays (m,).
    """

    frames: tuple[Detections, ...]
    rows: tuple[Integers, ...]


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
