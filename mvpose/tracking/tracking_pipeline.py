"""Pipeline for whole recordings: one frame alone, or all frames in order with identities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.pipeline import Pipeline
from mvpose.tracking.smoothing import track
from mvpose.tracking.tracker import Tracker
from mvpose.tracking.tracking_model import TrackingModel


@dataclass(frozen=True)
class TrackingPipeline:
    """Tracker of recordings (:class:`mvpose.estimators.SequenceEstimator`), which keeps no state between them.

    Attributes:
        pipeline: stages of one frame.
        model: settings of the tracker.
        lag: seconds of later frames that an estimate waits for: 0 for none, infinite for a whole recording. A fifth of
            a second, the default, is long enough to tell a person from two false detections that meet, and short enough
            for a live display.
    """

    pipeline: Pipeline = Pipeline()
    model: TrackingModel = TrackingModel()
    lag: float = 0.2

    def __post_init__(self) -> None:
        if not self.lag >= 0.0:
            raise ValueError(f"lag must be 0 s or more, got {self.lag}")

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame alone, as the pipeline does, without identities."""
        return self.pipeline.estimate(rig, detections)

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Yield the estimate of every frame of a recording, in order; every call starts without a past.

        Args:
            rig: calibrated cameras.
            frames: detections of each frame, in the order of time.

        Raises:
            ValueError: as :meth:`mvpose.tracking.Tracker.estimate`.
        """
        return track(Tracker(self.pipeline, model=self.model), rig, frames, lag=self.lag)
