"""False positives of every kind: their scores, their boxes and their place in a block of detections."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.detector.detection_block import DetectionBlock, Origin
from simharness.detector.draws import logistic

MIN_JOINTS = 6
"""Fewest joints in a picture that a detector takes for a person."""

_COMMON = np.sqrt(0.5)  # half the variance of scores lasts as long as the detection, half is drawn for each joint


def keypoint_scores(usual: float, deviation: float, common: Floats, separate: Floats) -> Floats:
    """Return keypoint scores about a usual score, (..., J).

    Args:
        usual: usual score.
        deviation: standard deviation on the logit scale.
        common: standard normal numbers of the detections, (...).
        separate: standard normal numbers of their joints, (..., J).
    """
    return logistic(usual, deviation * _COMMON * (common[..., None] + separate))


def bounding_box(points: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and the highest coordinates, (..., 2) each, of the finite points of (..., J, 2).

    Both are NaN where no point is finite.
    """
    known = np.isfinite(points)
    low, high = np.where(known, points, np.inf).min(axis=-2), np.where(known, points, -np.inf).max(axis=-2)
    some = low <= high
    return np.where(some, low, np.nan), np.where(some, high, np.nan)


def inside(rig: Rig, view: Integers, keypoints: Floats) -> NDArray[np.bool_]:
    """Return which keypoints (r, J, 2) in the pictures of views (r,) lie on the image, (r, J)."""
    size = np.array([camera.size for camera in rig], float)[view][:, None]
    return np.all((keypoints >= -0.5) & (keypoints < size - 0.5), axis=-1)


def false_positive_block(
    rig: Rig,
    frames: int,
    where: tuple[Integers, Integers, Integers],
    keypoints: Floats,
    scores: Floats,
    *,
    origin: Origin,
    number: Integers,
) -> DetectionBlock:
    """Return a block with r false positives.

    Keypoints off the image are absent; the box spans the others, and its score is the mean of theirs.

    Args:
        rig: cameras, for the sizes of their images.
        frames: T.
        where: frame, view and slot of each detection, (r,) each.
        keypoints: pixels, (r, J, 2), NaN where absent.
        scores: scores of the keypoints, (r, J).
        origin: origin of all of them.
        number: number of each among the detections of this origin, (r,).
    """
    _, view, slot = where
    block = DetectionBlock.empty(frames, len(rig), int(slot.max(initial=-1)) + 1)
    seen = inside(rig, view, keypoints) & (scores > 0)
    keypoints, scores = np.where(seen[..., None], keypoints, np.nan), np.where(seen, scores, 0.0)
    low, high = bounding_box(keypoints)
    count = seen.sum(axis=-1)
    block.present[where] = count > 0
    block.keypoints[where], block.scores[where] = keypoints, scores
    block.origin[where], block.number[where] = origin, number
    block.boxes[where] = np.where(count[:, None] > 0, np.concatenate([low, high - low], axis=-1), 0.0)
    block.box_scores[where] = scores.sum(axis=-1) / np.maximum(count, 1)
    return block
