"""Variants with memory: all frames of a recording in order, in one process."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

from mvpose import Detections, Estimate, Rig
from mvpose.pipeline import SequenceEstimator
from simharness.runtime.errors import RunError


def track_frames(estimator: SequenceEstimator, rig: Rig, frames: Iterable[Detections]) -> list[Estimate]:
    """Return the estimates of all frames of a recording, with the time that each frame took.

    The time of a frame is that between when the estimator takes it and when it takes the next one; what follows the
    last frame belongs to the last. So smoothing counts, and making the detections does not.

    Args:
        estimator: the variant.
        rig: the believed cameras.
        frames: detections of each frame, in the order of time.

    Raises:
        RunError: the estimator failed, or yielded another number of estimates than frames; the message names the frame.
    """
    feed = _TimedFrames(frames)
    try:
        estimates = list(estimator.track(rig, feed))
    except RunError:
        raise
    except Exception as error:
        raise RunError(f"frame {max(feed.count - 1, 0)}: {type(error).__name__}: {error}") from error
    feed.stop()
    count = feed.count + sum(1 for _ in feed)
    if len(estimates) != count:
        raise RunError(
            f"frame {min(len(estimates), count)}: track yielded {len(estimates)} estimates for {count} frames, "
            "expected one for each frame, in order"
        )
    return [
        replace(each, timings={**each.timings, "total": seconds})
        for each, seconds in zip(estimates, feed.seconds, strict=True)
    ]


class _TimedFrames(Iterator[Detections]):
    """Frames that an estimator takes one after the other, with the time that it spends on each.

    Attributes:
        seconds: time spent on each frame that was taken.
    """

    def __init__(self, frames: Iterable[Detections]) -> None:
        self._frames = iter(frames)
        self._since = 0.0
        self.seconds: list[float] = []

    @property
    def count(self) -> int:
        """Number of frames that were taken."""
        return len(self.seconds)

    def __next__(self) -> Detections:
        self.stop()
        try:
            detections = next(self._frames)
            self.seconds.append(0.0)
        finally:
            self._since = time.perf_counter()
        return detections

    def stop(self) -> None:
        """Count the time since the last frame was taken as that frame's."""
        if self.seconds:
            self.seconds[-1] += time.perf_counter() - self._since
