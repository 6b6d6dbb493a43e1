"""Times of frames, of their pictures and of the rows of a rolling shutter.

A camera with a rolling shutter shows every joint at the time of its row. How far the joint moves between this time and
that of the picture follows from the velocity of its track, and the ray is turned by as much at the depth of the joint.
"""

import math
import warnings
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.kernels import njit

_LARGEST = 1e11  # seconds: three thousand years; milliseconds since 1970 are more
_OLDEST = 1.0  # seconds: nobody knows where a joint was so long ago, because its velocity is forgotten as fast
_SHARE = 0.1  # weight of the latest frame in the mean time between frames
_BLIND = 1.0  # seconds without pictures, after which nobody's place is known anyhow
_LAPSES = 3  # frames in a row, each this long after the one before, that are no accident
_UNITS = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}


class FrameTimes(NamedTuple):
    """Times of one frame."""

    now: float
    """Time of the frame, that of its latest picture, seconds; NaN before the first picture."""
    elapsed: float
    """Time since the previous frame, seconds; 0 in the first."""
    lead: Floats
    """Time from the frame to the picture of each camera, (V,), at most 0 seconds; 0 without a picture."""
    pictures: Bools
    """Whether each camera gave a picture that is used, (V,)."""
    too_old: bool
    """Whether the picture of some camera is not used: it is too old, or its clock is ahead of those of most others."""
    latest: float
    """Time of the latest picture, seconds; NaN without any."""


@dataclass
class FrameClock:
    """Time of a stream of frames.

    Detections without times are ``period`` after the previous frame, and all cameras are taken to have delivered a
    picture. A frame without any picture comes as long after the previous one as frames came on average. This is a
    guess; a picture that turns out to be before it is taken as a late one.
    """

    period: float
    """Time between frames without times, seconds."""
    interval: float
    """Mean time between the latest frames, seconds."""
    time: float = math.nan
    """Time of the latest frame, seconds; NaN before the first picture."""
    pictured: float = math.nan
    """Time of the latest picture, seconds."""
    dark: float = 0.0
    """Number of frames since then, none of which has pictures."""
    lapses: int = field(default=0, kw_only=True)
    """Number of latest frames that came so long after their previous ones that nobody could be followed."""

    @property
    def started(self) -> bool:
        """Whether a picture has come."""
        return not math.isnan(self.time)

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
            return FrameTimes(now, self._since(now), np.zeros(cameras), np.ones(cameras, np.bool_), False, now)
        _check(times, detections, cameras)
        latest, ahead = _latest(times)
        if latest == -math.inf:
            # At half the speed after a while, so that the guess of a long time is not ahead of the next picture.
            step = self.interval if self.time - self.pictured < _BLIND else 0.5 * self.interval
            now, step = (self.time + step, step) if self.started else (math.nan, 0.0)
            return FrameTimes(now, step, np.zeros(cameras), np.zeros(cameras, np.bool_), False, math.nan)
        if latest < self.pictured:
            raise ValueError(
                f"frames must come in the order of their times, got {latest:.6g} s after {self.pictured:.6g} s: sort "
                "them, or start another tracker"
            )
        now = max(latest, self.time) if self.started else latest
        lead, pictures, old = _leads(times, now, latest)
        if ahead >= 0:
            warnings.warn(
                f"camera {ahead}: its picture is {times[ahead] - latest:.1f} s after those of most other cameras, and "
                "is not used; subtract the offset of its clock from its times",
                stacklevel=2,
            )
        elif old >= 0:
            warnings.warn(
                f"camera {old}: a picture more than {_OLDEST:g} s before that of another camera is not used; give the "
                "times of all cameras by one clock, and NaN for a camera without a new picture",
                stacklevel=2,
            )
        return FrameTimes(now, self._since(now), lead, pictures, max(ahead, old) >= 0, latest)

    def take(self, times: FrameTimes) -> None:
        """Go on to a frame."""
        if math.isnan(times.now):
            return
        self.dark += 1.0
        if not math.isnan(times.latest):
            gap = (times.latest - self.pictured) / self.dark
            if 0.0 < times.latest - self.pictured < _BLIND:
                self.interval += _SHARE * (gap - self.interval)
            self.lapses = self.lapses + 1 if gap > _BLIND else 0
            if self.lapses == _LAPSES:
                unit = next((name for name, size in _UNITS.items() if gap < _BLIND * size), "nanoseconds")
                warnings.warn(
                    f"{_LAPSES} frames in a row came {gap:.4g} s after the previous one, over which people cannot be "
                    f"followed: they get new identities. Are the times {unit}? Divide them by {_UNITS[unit]:g}",
                    stacklevel=2,
                )
            self.pictured, self.dark = times.latest, 0.0
        self.time = times.now

    def _since(self, now: float) -> float:
        return now - self.time if self.started else 0.0


def _check(times: Floats, detections: Detections, cameras: int) -> None:
    if len(times) != cameras:
        raise ValueError(f"time must be ({cameras},), the time of each camera's picture, got ({len(times)},)")
    wild, silent = _first_bad(times, detections.view)
    if wild >= 0:
        raise ValueError(
            f"time must be in seconds, of at most {_LARGEST:g}, got {times[wild]:g} for camera {wild}: divide "
            "milliseconds by 1e3 and nanoseconds by 1e9; NaN means no picture"
        )
    if silent >= 0:
        raise ValueError(f"camera {silent} has detections, but the time of its picture is NaN (no picture)")


@njit(cache=True)
def _first_bad(times, view):
    """Return a camera whose time cannot be seconds, and one that has detections but no picture; -1 for none."""
    for camera in range(len(times)):
        if abs(times[camera]) > _LARGEST:
            return camera, -1
    for d in range(len(view)):
        if np.isnan(times[view[d]]):
            return -1, view[d]
    return -1, -1


@njit(cache=True)
def _latest(times):
    """Return the time of the latest picture, and a camera that is ahead, -1 for none.

    The pictures of cameras that are ahead of the majority by more than what is too old do not count. The time is minus
    infinity if there is no picture.
    """
    ahead, bound = -1, np.inf
    while True:
        latest, count, near = -np.inf, 0, 0
        for time in times:
            if time < bound:
                latest = max(latest, time)
        for time in times:
            count += time < bound
            near += latest - _OLDEST <= time < bound
        if 2 * near >= count:
            return latest, ahead
        for camera in range(len(times)):
            ahead = camera if times[camera] == latest else ahead
        bound = latest - _OLDEST


@njit(cache=True)
def _leads(times, now, latest):
    """Return ``lead`` and ``pictures`` of :class:`FrameTimes`, and a camera whose picture is too old, or -1."""
    lead, pictures, old = np.zeros(len(times)), np.zeros(len(times), np.bool_), -1
    for camera in range(len(times)):
        if latest - _OLDEST <= times[camera] <= latest:
            lead[camera], pictures[camera] = times[camera] - now, True
        elif times[camera] < latest:
            old = camera if old < 0 else old
    return lead, pictures, old


def readouts(rig: Rig) -> Floats | None:
    """Return seconds from the first to the last row, and the rows, of each camera, (V, 2); None without any readout."""
    if not any(camera.readout for camera in rig):
        return None
    return np.array([(camera.readout, camera.size[1]) for camera in rig], float)


@njit(cache=True)
def undo_rolling(readout, view, keypoints, origins, directions, weights, labels, groups, state):
    """Return viewing rays (m, J, 3) of the joints at the times of the pictures, those of their middle rows.

    Detections without a track, and joints that are not known, keep their rays.

    Args:
        readout: of :func:`readouts`, (V, 2).
        view: camera of each detection, (m,).
        keypoints: pixels, (m, J, 2).
        origins: optical centres, (m, 3), metres.
        directions: unit vectors, (m, J, 3).
        weights: scores of the keypoints, (m, J); 0 where missing.
        labels: group of each detection, (m,), or -1.
        groups: group of each track, (n,), or -1.
        state: predicted positions and velocities, (n, J, 6).
    """
    result, point = directions.copy(), np.empty(3)
    for d in range(len(view)):
        track = -1
        for t in range(len(groups)):
            if labels[d] >= 0 and groups[t] == labels[d]:
                track = t
        if track < 0 or readout[view[d], 0] == 0.0:
            continue
        for j in range(weights.shape[1]):
            if not weights[d, j] > 0.0 or np.isnan(state[track, j, 0]):
                continue
            late = readout[view[d], 0] * ((keypoints[d, j, 1] + 0.5) / readout[view[d], 1] - 0.5)
            depth, square = 0.0, 0.0
            for r in range(3):
                depth += (state[track, j, r] - origins[d, r]) * directions[d, j, r]
            if not depth > 0.0:
                continue
            for r in range(3):
                point[r] = depth * directions[d, j, r] - late * state[track, j, 3 + r]
                square += point[r] * point[r]
            if square > 0.0:
                for r in range(3):
                    result[d, j, r] = point[r] / np.sqrt(square)
    return result
