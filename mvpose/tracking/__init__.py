"""People through time: identities, hidden people, and pictures that come late or not at all."""

from mvpose.tracking.smoothing import track
from mvpose.tracking.state import TrackerState
from mvpose.tracking.tracker import Tracker, TrackingModel
from mvpose.tracking.tracking_pipeline import TrackingPipeline

__all__ = ["Tracker", "TrackerState", "TrackingModel", "TrackingPipeline", "track"]
