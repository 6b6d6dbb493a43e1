"""People through time: identities, hidden people, and pictures that come late or not at all."""

from mvpose.tracking.association import TrackingModel
from mvpose.tracking.drift_watch import CameraResiduals, Drift, DriftModel
from mvpose.tracking.smoothing import TrackingPipeline, track
from mvpose.tracking.state import TrackerState
from mvpose.tracking.tracker import Tracker

__all__ = [
    "CameraResiduals",
    "Drift",
    "DriftModel",
    "Tracker",
    "TrackerState",
    "TrackingModel",
    "TrackingPipeline",
    "track",
]
