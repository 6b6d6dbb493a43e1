"""What a tracker knows after a frame."""

from __future__ import annotations

from dataclasses import dataclass

from mvpose.arrays import Bools, Floats, Integers
from mvpose.reconstruction.poses import Poses
from mvpose.tracking.tracks import Tracks


@dataclass
class Moment:
    """What a tracker knows after a frame, for its estimate and for smoothing.

    Attributes:
        time: time of the frame, seconds; NaN before the first picture.
        elapsed: time since the previous frame, seconds.
        tracks: tracks after the frame, with those that end here.
        predicted: state of each track before the frame, (n, J, 6), and its covariance, (n, J, 6, 6); NaN for new
            tracks. None where nobody smooths.
        odds: log-odds that each track is a person, (n,).
        presence: log-odds that this person is still here, (n,).
        shown: whether each track is reported, (n,).
        owner: track of each detection that took part, (k,), or -1.
        chosen: indices of these detections, (k,).
        detections: number of detections of the frame.
        poses: poses of the tracks as the pipeline gives them, where the frame is the first.
        timings: seconds by stage.
        link: row of each track in the next moment and the gains of the smoother, where they are known already.
    """

    time: float
    elapsed: float
    tracks: Tracks
    predicted: tuple[Floats, Floats] | None
    odds: Floats
    presence: Floats
    shown: Bools
    owner: Integers
    chosen: Integers
    detections: int
    poses: Poses | None
    timings: dict[str, float]
    link: tuple[Integers, Floats] | None = None
