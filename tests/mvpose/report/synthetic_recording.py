"""Recordings of synthetic people: rig, detections of every frame, and the people themselves as estimates."""

from __future__ import annotations

import numpy as np
from people import crowd, detect, ring

from mvpose import Detections, Rig
from mvpose.recording import People


def recording(
    people: int = 2, *, frames: int = 6, cameras: int = 4, noise: float = 0.0, sigma: float = 0.02, **options
) -> tuple[Rig, list[Detections], People]:
    """People who walk along x by 5 cm a frame, seen by cameras on a ring; the estimates are exact."""
    rig = ring(cameras, **options)
    step = np.array([0.05, 0.0, 0.0])
    joints = np.stack([crowd(people) + frame * step for frame in range(frames)])
    detections = [detect(rig, true, noise=noise, seed=frame)[0] for frame, true in enumerate(joints)]
    scores = np.full(joints.shape[:3], 0.9)
    covariance = np.broadcast_to(sigma**2 * np.eye(3), (*joints.shape, 3))
    return rig, detections, People(0.04 * np.arange(frames), np.arange(people) + 3, joints, scores, covariance)
