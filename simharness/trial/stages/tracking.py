"""Variants with memory: all frames of a recording in order, in one process."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

from mvpose import Detections, Estimate, Rig
from mvpose.estimators import SequenceEstimator
from simharness.runtime.errors import RunError


def track_frames(estimator: SequenceEstimator, rig: Rig, frames: Iterable[Detections]) -> list[Estimate]:
    """Return the estimates of all frames of a recording, with the time that each frame took.

    The time of a frame is that between when the estimator takes it and when it takes the next one. The time after the
    last frame is shared equally by the frames that have no estimate by then: by all, of an estimator that reads the
    whole recording first. So smoothing and repair count, and making the detections does not.

    Args:
        estimator: the variant.
        rig: the believed cameras.
        frames: detections of each frame, in the order of time.

    Raises:
        RunError: the estimator failed, or yielded another number of estimates than frames; the message names the frame.
    """
    feed = _TimedFrames(frames)
    estimates: list[Estimate] = []
    online = 0  # estimates that were made before the frames ended
    try:
        for estimate in estimator.track(rig, feed):
            estimates.append(estimate)
            online = online if feed.ended else len(estimates)
    except RunError:
        raise
    except Exception as error:
        raise RunError(f"frame {max(feed.count - 1, 0)}: {type(error).__name__}: {error}") from error
    feed.finish(online)
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
        ended: whether the estimator has found that there is no further frame.
    """

    def __init__(self, frames: Iterable[Detections]) -> None:
        self._frames = iter(frames)
        self._since = 0.0
        self.seconds: list[float] = []
        self.ended = False

    @property
    def count(self) -> int:
        """Number of frames that were taken."""
        return len(self.seconds)

    def __next__(self) -> Detections:
        if self.ended:
            raise StopIteration
        if self.seconds:
            self.seconds[-1] += time.perf_counter() - self._since
        try:
            detections = next(self._frames)
            self.seconds.append(0.0)
        except StopIteration:
            self.ended = True
            raise
        finally:
            self._since = time.perf_counter()
        return detections

    def finish(self, online: int) -> None:
        """Share the time since the last frame was taken, or since there was none, by the frames that waited for it.

        Args:
            online: number of frames that had their estimates before; the others share, or the last if there are none.
        """
        rest = time.perf_counter() - self._since
        waited = range(max(min(online, self.count - 1), 0), self.count)
        for index in waited:
            self.seconds[index] += rest / len(waited)
