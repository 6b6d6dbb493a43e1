"""How a detector reports people who are not there: what false detections of every kind have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from simharness.detector.correlation import logistic
from simharness.detector.detection_block import Found, Origin

LEAST = 6
"""Joints in a picture that a detector takes for a person, at least."""

_TOGETHER = np.sqrt(0.5)  # half the variance of scores is a detection's as long as it lasts, half each joint's


def sureness(usual: float, deviation: float, together: Floats, apart: Floats) -> Floats:
    """Scores about a usual one.

    Args:
        usual: score.
        deviation: on the logit scale.
        together: standard normal numbers of detections, (...).
        apart: of their joints, (..., J).

    Returns:
        (..., J).
    """
    return logistic(usual, deviation * _TOGETHER * (together[..., None] + apart))


def box_about(points: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates, (..., 2) each, of those of points (..., J, 2) that are numbers; NaN of none."""
    there = np.isfinite(points)
    low, high = np.where(there, points, np.inf).min(axis=-2), np.where(there, points, -np.inf).max(axis=-2)
    some = low <= high
    return np.where(some, low, np.nan), np.where(some, high, np.nan)


def inside(rig: Rig, view: Integers, keypoints: Floats) -> NDArray[np.bool_]:
    """Which keypoints (r, J, 2) in pictures of views (r,) lie on the image, (r, J)."""
    size = np.array([camera.size for camera in rig], float)[view][:, None]
    return np.all((keypoints >= -0.5) & (keypoints < size - 0.5), axis=-1)


def reported(
    rig: Rig,
    frames: int,
    where: tuple[Integers, Integers, Integers],
    keypoints: Floats,
    scores: Floats,
    *,
    origin: Origin,
    number: Integers,
) -> Found:
    """Put false detections where they belong.

    What lies off the image is absent; a box spans the others and is as sure as they are on average.

    Args:
        rig: for the images' sizes.
        frames: T.
        where: frame, view and slot of each, (r,).
        keypoints: pixels, (r, J, 2), NaN where absent.
        scores: (r, J).
        origin: of all.
        number: of each among those of this origin, (r,).
    """
    _, view, slot = where
    found = Found.nothing(frames, len(rig), int(slot.max(initial=-1)) + 1)
    seen = inside(rig, view, keypoints) & (scores > 0)
    keypoints, scores = np.where(seen[..., None], keypoints, np.nan), np.where(seen, scores, 0.0)
    low, high = box_about(keypoints)
    count = seen.sum(axis=-1)
    found.there[where] = count > 0
    found.keypoints[where], found.scores[where] = keypoints, scores
    found.origin[where], found.number[where] = origin, number
    found.boxes[where] = np.where(count[:, None] > 0, np.concatenate([low, high - low], axis=-1), 0.0)
    found.box_scores[where] = scores.sum(axis=-1) / np.maximum(count, 1)
    return found
