"""Detections of a trial, which the method is given, with their truth."""

from dataclasses import dataclass
from functools import cached_property

from mvpose import Rig
from mvpose.arrays import Floats
from simharness.detector.detect import Detected
from simharness.types.recording import Recording


@dataclass(frozen=True)
class DetectedSequence:
    """Detections and truth of T frames, and the believed cameras: the input of estimation and scoring."""

    time: Floats
    """Time of each frame, (T,), seconds."""
    rig: Rig
    """The believed cameras."""
    frames: tuple[Detected, ...]
    """Detections, truth and heat map peaks of each frame, T."""

    @cached_property
    def recording(self) -> Recording:
        """The input of scoring."""
        return Recording(
            self.time,
            self.rig,
            tuple(each.detections for each in self.frames),
            tuple(each.truth for each in self.frames),
        )
