"""Recordings made without the simulator: exact detections of people by a ring of cameras, and estimates of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from mvpose import Detections, Estimate
from mvpose.estimate import Matching
from simharness.types.recording import Recording
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility

sys.path.append(str(Path(__file__).parent / "mvpose"))

from people import crowd, ring

__all__ = ["crowd", "estimate_of", "moment", "recorded", "ring"]


def moment(rig, people, *, visibility=Visibility.VISIBLE):
    """Return the exact detections of one frame, ordered by view, then by person, and the truth."""
    pixels = rig.project(people)
    inside = np.stack([camera.inside(pixels[view]) for view, camera in enumerate(rig)])
    view, person = (index.ravel() for index in np.indices(pixels.shape[:2]))
    scores = np.where(inside, 1.0, 0.0)[view, person]
    low, high = pixels.min(axis=2), pixels.max(axis=2)
    boxes = np.concatenate([low, high - low], axis=-1)
    detections = Detections(view, pixels[view, person], scores, boxes[view, person], np.full(len(view), 0.9))
    return detections, Truth(
        joints=people,
        pixels=pixels,
        visibility=np.where(inside, visibility, Visibility.OUTSIDE),
        boxes=boxes,
        person=person,
        error=np.where(scores > 0, KeypointError.GOOD, KeypointError.ABSENT),
    )


def recorded(rig, *moments):
    """Return a recording of frames given as pairs of detections and truth."""
    detections, truth = zip(*moments, strict=True)
    return Recording(np.arange(len(moments)) / 10.0, rig, detections, truth)


def estimate_of(joints, labels):
    """Return an estimate of n people from joints (n, 17, 3) and labels of the detections."""
    return Estimate(joints, np.isfinite(joints).all(axis=-1).astype(float), Matching(np.asarray(labels)))
