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
    """Settings of a tracker."""

    motion: MotionModel = MotionModel()
    """Motion of joints."""
    affinity: TrackAffinity = TrackAffinity()
    """Affinity between tracks and detections."""
    existence: Existence = Existence()
    """How often people come, and how often people and ghosts are found."""
    reappearance: Reappearance = Reappearance()
    """How people who were lost come back."""
    noise: Noise = Noise()
    """Error model of keypoints."""
    drift: DriftModel = DriftModel()
    """Watch over the cameras."""
    correlation: float = 0.15
    """Time over which the errors of poses are correlated, seconds: wrong keypoints last 0.2 to 0.3 s, others change
    faster."""
    period: float = 0.04
    """Time between frames whose detections carry no time, seconds."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.correlation < np.inf:
            raise ValueError(f"correlation must be 0 s or more and finite, got {self.correlation}")
        if not 0.0 < self.period < np.inf:
            raise ValueError(f"period must be above 0 s and finite, got {self.period}")
