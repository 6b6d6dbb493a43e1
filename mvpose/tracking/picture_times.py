"""Times of frames and of their pictures."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.detections import Detections

_LARGEST = 1e11  # seconds: three thousand years; milliseconds since 1970 are more
_OLDEST = 1.0  # seconds: nobody knows where a joint was so long ago, because its velocity is forgotten as fast
_SHARE = 0.1  # weight of the latest frame in the mean time between frames
_BLIND = 1.0  # seconds without pictures, after which nobody's place is known anyhow


class FrameTimes(NamedTuple):
    """Times of one frame.

    Attributes:
        now: time of the frame, that of its latest picture, seconds; NaN before the first picture.
        elapsed: time since the previous frame, seconds; 0 in the first.
        lead: time from the frame to the picture of each camera, (V,), at most 0 seconds; 0 without a picture.
        pictures: whether each camera gave a picture that is of use, (V,).
        latest: time of the latest picture, seconds; NaN without any.
    """

    now: float
    elapsed: float
    lead: Floats
    pictures: Bools
    latest: float


@dataclass
class FrameClock:
    """Time of a stream of frames.

    Detections without times are ``period`` after the previous frame, and all cameras are taken to have delivered a
    picture. A frame without any picture comes as long after the previous one as frames came on average. This is a
    guess; a picture that turns out to be before it is taken as a late one.

    Attributes:
        period: time between frames without times, seconds.
        interval: mean time between the latest frames with pictures, seconds.
        time: time of the latest frame, seconds; NaN before the first picture.
        pictured: time of the latest picture, seconds.
    """

    period: float
    interval: float
    time: float = np.nan
    pictured: float = np.nan

    @property
    def started(self) -> bool:
        """Whether a picture has come."""
        return not np.isnan(self.time)

    def read(self, detections: Detections, cameras: int) -> FrameTimes:
        """Return the times of the next frame, without taking it.

        Args:
            detections: detections of the frame.
            cameras: number of cameras, V.

        Raises:
            ValueError: times of another number of cameras, a time beyond 1e11 s, a detection of a camera without a
                picture, or a frame before the previous one.
        """
        times = detections.time
        if times is None:
            now = self.time + self.period if self.started else 0.0
            return FrameTimes(now, self._since(now), np.zeros(cameras), np.ones(cameras, np.bool_), now)
        _check(times, detections, cameras)
        pictures = np.isfinite(times)
        if not pictures.any():
            if not self.started:
                return FrameTimes(np.nan, 0.0, np.zeros(cameras), pictures, np.nan)
            # At half the speed after a while, so that the guess of a long time is not ahead of the next picture.
            step = self.interval if self.time - self.pictured < _BLIND else 0.5 * self.interval
            return FrameTimes(self.time + step, step, np.zeros(cameras), pictures, np.nan)
        latest = float(times[pictures].max())
        if latest < self.pictured:
            raise ValueError(
                f"frames must come in the order of their times, got {latest:.6g} s after {self.pictured:.6g} s: sort "
                "them, or start another tracker"
            )
        now = max(latest, self.time) if self.started else latest
        lead = np.where(pictures, times - now, 0.0)
        old = lead < latest - now - _OLDEST
        if old.any():
            warnings.warn(
                f"camera {np.flatnonzero(old)[0]}: a picture more than {_OLDEST:g} s before that of another camera is "
                "not used; give the times of all cameras by one clock, and NaN for a camera without a new picture",
                stacklevel=2,
            )
        return FrameTimes(now, self._since(now), np.where(old, 0.0, lead), pictures & ~old, latest)

    def take(self, times: FrameTimes) -> None:
        """Go on to a frame."""
        if np.isnan(times.now):
            return
        if not np.isnan(times.latest):
            if 0.0 < times.latest - self.pictured < _BLIND:
                self.interval += _SHARE * (times.latest - self.pictured - self.interval)
            self.pictured = times.latest
        self.time = times.now

    def _since(self, now: float) -> float:
        return now - self.time if self.started else 0.0


def _check(times: Floats, detections: Detections, cameras: int) -> None:
    if len(times) != cameras:
        raise ValueError(f"time must be ({cameras},), the time of each camera's picture, got ({len(times)},)")
    if (np.abs(times) > _LARGEST).any():
        camera = int(np.flatnonzero(np.abs(times) > _LARGEST)[0])
        raise ValueError(
            f"time must be in seconds, of at most {_LARGEST:g}, got {times[camera]:g} for camera {camera}: divide "
            "milliseconds by 1e3 and nanoseconds by 1e9; NaN means no picture"
        )
    silent = detections.view[np.isnan(times)[detections.view]]
    if len(silent):
        raise ValueError(f"camera {silent[0]} has detections, but the time of its picture is NaN (no picture)")
