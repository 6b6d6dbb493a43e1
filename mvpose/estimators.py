"""What an estimator is: the protocols that every method fulfils, of this package and of its users."""

from collections.abc import Iterable, Iterator
from typing import Protocol, runtime_checkable

from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate


class Estimator(Protocol):
    """Object that estimates the people of a frame."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame; see :meth:`mvpose.Pipeline.estimate`."""
        ...


@runtime_checkable
class SequenceEstimator(Estimator, Protocol):
    """Estimator with memory: the estimate of a frame depends on other frames of the recording.

    Its ``estimate`` treats a frame alone.
    """

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Yield the estimate of every frame of a recording, in order; every call starts without a past.

        Args:
            rig: calibrated cameras.
            frames: detections of each frame, in the order of time.
        """
        ...
