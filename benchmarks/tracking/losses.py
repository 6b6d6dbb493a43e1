"""Losses of pictures of a recording, and the bounds of the tracker then."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mvpose import Detections
from mvpose.arrays import Bools
from simharness.reality.annotated_recording import AnnotatedRecording

_CYCLE, _DARK_FROM = 3.0, 2.0  # seconds: cycle of black pictures, and the time in it from which all cameras are black


@dataclass(frozen=True)
class Loss:
    """What is lost of a recording, and the bounds of the tracker then.

    Attributes:
        name: name in the table.
        chance: probability that a picture is lost.
        views: cameras that are left; None for all.
        step: every how many frames one is left.
        black: whether all cameras are black for one second in every three.
        lag: lag of the smoother, seconds.
        pcp: least PCP with the lag; None without a bound.
        pcp_at_once: the same without a lag.
        below_full: PCP by which the tracker may be below ``full`` on the same frames; None without a bound.
        switches: most identity switches.
    """

    name: str
    chance: float = 0.0
    views: tuple[int, ...] | None = None
    step: int = 1
    black: bool = False
    lag: float = 0.2
    pcp: float | None = None
    pcp_at_once: float | None = None
    below_full: float | None = None
    switches: int = 0

    def of(self, recording: AnnotatedRecording, draw: int) -> AnnotatedRecording:
        """Return what is left of a recording; its first pictures are always there, so that all methods start alike."""
        if self.views is not None:
            recording = recording.subset(self.views)
        recording = recording.during(np.arange(0, len(recording), self.step))
        rng, frames = np.random.default_rng(draw), []
        for k, (detections, time) in enumerate(zip(recording.timed_detections, recording.time, strict=True)):
            gone = rng.random(len(recording.rig)) < self.chance
            gone |= self.black and (time - recording.time[0]) % _CYCLE >= _DARK_FROM
            frames.append(without(detections, gone & (k > 0)))
        return replace(recording, detections=tuple(frames))


LOSSES: tuple[Loss, ...] = (
    Loss("all pictures", below_full=0.0),
    Loss("28 % lost", chance=0.28, pcp=96.5, pcp_at_once=95.5),
    Loss("50 % lost", chance=0.5, pcp=94.0, pcp_at_once=91.0),
    Loss("cameras 0 1 2, 28 % lost", chance=0.28, views=(0, 1, 2), pcp=90.0, pcp_at_once=86.0),
    Loss("black 1 s in every 3", black=True, lag=1.5, pcp=88.0, switches=1),
    Loss("cameras 0 and 4", views=(0, 4), pcp=76.0, pcp_at_once=76.0, switches=1),
    Loss("5 Hz", step=5, below_full=0.5),
    Loss("2 Hz", step=12, below_full=0.5),
)
"""Losses on Shelf, 300 frames at 25 Hz."""


def without(detections: Detections, gone: Bools) -> Detections:
    """Return the detections without the pictures of some cameras, (V,).

    Raises:
        ValueError: detections without the times of their pictures.
    """
    if detections.time is None:
        raise ValueError("detections need the time of each camera's picture, so that one can be lost: give time (V,)")
    return replace(detections.select(~gone[detections.view]), time=np.where(gone, np.nan, detections.time))
