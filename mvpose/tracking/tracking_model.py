"""Settings of a tracker."""

from dataclasses import dataclass

import numpy as np

from mvpose.reconstruction.likelihood import Noise
from mvpose.tracking.association import TrackAffinity
from mvpose.tracking.drift_watch import DriftModel
from mvpose.tracking.existence import Existence
from mvpose.tracking.motion import MotionModel
from mvpose.tracking.reappearance import Reappearance


@dataclass(frozen=True)
class TrackingModel:
    """Settings of a tracker.

    Attributes:
        motion: motion of joints.
        affinity: affinity between tracks and detections.
        existence: how often people come, and how often people and ghosts are found.
        reappearance: how people who were lost come back.
        noise: error model of keypoints.
        drift: watch over the cameras.
        correlation: time over which the errors of poses are correlated, seconds: wrong keypoints last 0.2 to 0.3 s,
            others change faster.
        period: time between frames whose detections carry no time, seconds.
    """

    motion: MotionModel = MotionModel()
    affinity: TrackAffinity = TrackAffinity()
    existence: Existence = Existence()
    reappearance: Reappearance = Reappearance()
    noise: Noise = Noise()
    drift: DriftModel = DriftModel()
    correlation: float = 0.15
    period: float = 0.04

    def __post_init__(self) -> None:
        if not 0.0 <= self.correlation < np.inf:
            raise ValueError(f"correlation must be 0 s or more and finite, got {self.correlation}")
        if not 0.0 < self.period < np.inf:
            raise ValueError(f"period must be above 0 s and finite, got {self.period}")
