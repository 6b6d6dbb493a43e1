"""Recordings made without the simulator: people seen exactly by cameras on a ring, and what is said of them."""

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

__all__ = ["crowd", "moment", "recorded", "ring", "said"]


def moment(rig, people, *, visibility=Visibility.VISIBLE):
    """The exact detections of one frame, a view after the other and in it a person after the other, and the truth."""
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
    """A recording of some frames, each a pair of detections and truth."""
    detections, truth = zip(*moments, strict=True)
    return Recording(np.arange(len(moments)) / 10.0, rig, detections, truth)


def said(joints, labels):
    """An estimate of n people, (n, 17, 3)."""
    return Estimate(joints, np.isfinite(joints).all(axis=-1).astype(float), Matching(np.asarray(labels)))
