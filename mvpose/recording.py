"""People of a whole recording as arrays over time: what files hold, and what is written, drawn, re-enacted and scored.

A tracker answers frame by frame with :class:`mvpose.Estimate`; files and plots need each person through time.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats, Integers
from mvpose.checks import Sealed, as_array, seal
from mvpose.estimate import Estimate
from mvpose.skeleton import COCO17, Skeleton

PERIOD = 0.04
"""Time between frames where nothing states it, seconds: that of trackers (:class:`mvpose.tracking.TrackingModel`)."""

_TOLERANCE = 0.01  # of the period; a frame nearer than this to its uniform time stays as it is
_LONGEST = 1.5  # periods; across a longer step nothing is interpolated, because a frame was lost there
_MOST_FRAMES = 10  # times as many frames as there are; above, the times are no recording


@dataclass(frozen=True)
class People(Sealed):
    """Joints of n people in T frames.

    A joint that was not estimated is NaN in all three coordinates and has score 0. Both are set where either is given,
    and its covariance becomes NaN.

    Raises:
        ValueError: a wrong shape, times or numbers that do not increase, repeated ids, or scores outside 0..1.
    """

    times: Floats
    """Time of each frame, (T,), seconds, increasing."""
    ids: Integers
    """Identity of each person, (n,), all different."""
    joints: Floats
    """(T, n, J, 3), metres, z up; NaN where absent."""
    scores: Floats = field(default_factory=lambda: np.ones(()))
    """Confidence, 0 to 1, (T, n, J), or one for all joints; 0 where absent."""
    covariance: Floats | None = None
    """Covariance of the error of each joint, (T, n, J, 3, 3), square metres, or None."""
    skeleton: Skeleton = COCO17
    """The J joints."""
    freedom: Floats | None = None
    """Degrees of freedom of the error of each joint as in :class:`mvpose.Estimate`, (T, n, J); NaN where not known.
    None: known of no joint."""
    numbers: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    """Number of each frame in the recording, (T,), increasing; empty: they count from 0."""

    def __post_init__(self) -> None:
        times, ids = as_array(self.times, ("T",), "times"), as_array(self.ids, ("n",), "ids", np.int64)
        numbers = self.numbers if len(self.numbers) else np.arange(len(times))
        numbers = as_array(numbers, (len(times),), "numbers", np.int64)
        if (np.diff(numbers) <= 0).any():
            bad = int(np.flatnonzero(np.diff(numbers) <= 0)[0])
            raise ValueError(f"frame numbers must increase, got {numbers[bad + 1]} after {numbers[bad]}")
        if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
            bad = int(np.flatnonzero(~np.append(True, np.diff(times) > 0) | ~np.isfinite(times))[0])
            raise ValueError(f"times of frames must be finite and increase, got {times[bad]:.6g} s in frame {bad}")
        if len(np.unique(ids)) != len(ids):
            raise ValueError(f"ids must be different for different people, got {ids.tolist()}")
        shape = len(times), len(ids), len(self.skeleton)
        scores = np.full(shape, self.scores) if np.ndim(self.scores) == 0 else self.scores
        joints, scores = as_array(self.joints, (*shape, 3), "joints"), as_array(scores, shape, "scores")
        if ((scores < 0) | (scores > 1)).any():
            raise ValueError(f"scores must lie in 0..1, got {np.nanmin(scores):.6g} to {np.nanmax(scores):.6g}")
        present = np.isfinite(joints).all(axis=-1) & (scores > 0)
        joints, scores = np.where(present[..., None], joints, np.nan), np.where(present, scores, 0.0)
        seal(joints, scores)
        covariance = self.covariance
        if covariance is not None:
            covariance = as_array(covariance, (*shape, 3, 3), "covariance")
            covariance = np.where(present[..., None, None], covariance, np.nan)
            seal(covariance)
        if self.freedom is not None:
            object.__setattr__(self, "freedom", as_array(self.freedom, shape, "freedom"))
        for key, value in (
            ("times", times), ("ids", ids), ("joints", joints), ("scores", scores), ("covariance", covariance),
            ("numbers", numbers),
        ):  # fmt: skip
            object.__setattr__(self, key, value)

    @classmethod
    def of_estimates(
        cls,
        estimates: Iterable[Estimate],
        skeleton: Skeleton = COCO17,
        period: float = PERIOD,
        *,
        untracked: bool = False,
    ) -> Self:
        """Collect the estimates of a recording.

        Args:
            estimates: estimate of every frame in the order of time; ids as a tracker gives them.
            skeleton: the joints of the estimates.
            period: time between frames, seconds. Where no estimate has a time, frame k is at ``k * period``; a frame
                without a time among frames that have one lies between its neighbours.
            untracked: take estimates without ids as well. A person's id is then its row in each frame, which does not
                say who it is in the next frame.

        Returns:
            People in the order of their ids; those without a joint in any frame are left out. Covariances are None
            where any estimate with people has none.

        Raises:
            ValueError: estimates without ids, of another number of joints, with repeated ids in a frame, with scores
                outside 0..1, or with times that do not increase.
        """
        frames = list(estimates)
        rows = [_ids(k, frame, untracked) for k, frame in enumerate(frames)]
        for k, frame in enumerate(frames):
            if len(frame) and frame.joints.shape[1] != len(skeleton):
                raise ValueError(
                    f"frame {k} has {frame.joints.shape[1]} joints, but the skeleton {skeleton.name!r} has "
                    f"{len(skeleton)}; pass the skeleton of the detections"
                )
        seen = [
            row[np.isfinite(frame.joints).all(axis=-1).any(axis=-1)] for row, frame in zip(rows, frames, strict=True)
        ]
        ids = np.unique(np.concatenate(seen)) if seen else np.zeros(0, np.int64)
        shape = len(frames), len(ids), len(skeleton)
        joints, scores = np.full((*shape, 3), np.nan), np.zeros(shape)
        known = all(frame.covariance is not None for frame in frames if len(frame)) and len(ids) > 0
        covariance = np.full((*shape, 3, 3), np.nan) if known else None
        freedom = np.full(shape, np.nan) if any(frame.freedom is not None for frame in frames) else None
        for k, (row, frame) in enumerate(zip(rows, frames, strict=True)):
            kept = np.isin(row, ids)
            columns = np.searchsorted(ids, row[kept])
            joints[k, columns], scores[k, columns] = frame.joints[kept], frame.scores[kept]
            if covariance is not None and frame.covariance is not None:
                covariance[k, columns] = frame.covariance[kept]
            if freedom is not None and frame.freedom is not None:
                freedom[k, columns] = frame.freedom[kept]
        given = np.array([np.nan if frame.time is None else frame.time for frame in frames], float)
        return cls(frame_times(given, period), ids, joints, scores, covariance, skeleton, freedom)

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def frames(self) -> int:
        """Number T of frames."""
        return len(self.times)

    @property
    def present(self) -> Bools:
        """Mask of joints that were estimated, (T, n, J)."""
        return self.scores > 0

    @property
    def rate(self) -> float:
        """Frames per second: one over the median time between frames; that of :data:`PERIOD` for a single frame."""
        return float(1.0 / np.median(np.diff(self.times))) if self.frames > 1 else 1.0 / PERIOD

    def span(self, person: int) -> slice:
        """Return the frames from the first to the last in which a person (its row) has any joint."""
        seen = np.flatnonzero(self.present[:, person].any(axis=1))
        return slice(int(seen[0]), int(seen[-1]) + 1) if len(seen) else slice(0, 0)

    def at(self, numbers: ArrayLike) -> Floats:
        """Return the joints in the frames of some numbers, (F, n, J, 3); NaN where there is no such frame."""
        wanted = np.asarray(numbers, np.int64)
        result = np.full((len(wanted), *self.joints.shape[1:]), np.nan)
        rows = np.searchsorted(self.numbers, wanted)
        rows[rows == self.frames] = 0
        present = self.numbers[rows] == wanted if self.frames else np.zeros(len(wanted), bool)
        result[present] = self.joints[rows[present]]
        return result

    def numbered_from(self, first: int) -> Self:
        """Return the people with ``first`` as the number of the first frame."""
        return replace(self, numbers=self.numbers - self.numbers[:1] + first)

    def uniform(self) -> "People":
        """Return the people at times ``first + k * period``, where the period is the median of theirs.

        Joints between two frames are interpolated linearly where both have them; a lost frame is a gap. Frames are
        numbered anew unless they are uniform already.

        Raises:
            ValueError: pauses so long that there would be ten times as many frames.
        """
        period = 1.0 / self.rate
        steps = (self.times - self.times[:1]) / period
        if self.frames < 2 or np.abs(steps - np.arange(self.frames)).max() < _TOLERANCE:
            return self
        count = round(steps[-1]) + 1
        if count > _MOST_FRAMES * self.frames:
            raise ValueError(
                f"{self.frames} frames over {self.times[-1] - self.times[0]:.6g} s at a median of {period:.6g} s "
                "between frames have pauses too long for a format with a fixed rate; export the parts separately"
            )
        wanted = np.arange(count)
        after = np.searchsorted(steps, wanted - _TOLERANCE)  # first frame that is not earlier
        exact = (after < len(steps)) & (np.abs(steps[np.minimum(after, len(steps) - 1)] - wanted) <= _TOLERANCE)
        after = np.clip(after, 1, len(steps) - 1)
        gap = steps[after] - steps[after - 1]
        share = (wanted - steps[after - 1]) / gap
        share = np.where(exact, np.round(np.clip(share, 0.0, 1.0)), share)
        usable = exact | ((gap <= _LONGEST) & (share >= 0.0) & (share <= 1.0))
        return People(
            self.times[0] + period * wanted,
            self.ids,
            _between(self.joints, after, share, usable),
            np.nan_to_num(_between(self.scores, after, share, usable)),
            None if self.covariance is None else _between(self.covariance, after, share, usable),
            self.skeleton,
        )


def _ids(k: int, frame: Estimate, untracked: bool) -> Integers:
    """Return the identity of each person of frame k, (n,)."""
    if frame.ids is None:
        if len(frame) and not untracked:
            raise ValueError(
                f"the people of frame {k} have no ids; estimate with a tracker (mvpose.preset('track').track), or "
                "pass untracked=True to number the people of each frame"
            )
        return np.arange(len(frame))
    if len(np.unique(frame.ids)) != len(frame.ids):
        raise ValueError(f"ids of frame {k} must be different for different people, got {frame.ids.tolist()}")
    return frame.ids


def frame_times(given: Floats, period: float) -> Floats:
    """Return the time of each frame, (T,), seconds, given those that are known, else NaN; see :class:`People`."""
    if not 0.0 < period < np.inf:
        raise ValueError(f"period must be above 0 s and finite, got {period}")
    known = np.flatnonzero(np.isfinite(given))
    numbers = np.arange(len(given), dtype=np.float64)
    if not len(known):
        return numbers * period
    first, last = known[0], known[-1]
    times: Floats = np.interp(numbers, known, given[known])
    times[:first] = given[first] + (numbers[:first] - first) * period
    times[last + 1 :] = given[last] + (numbers[last + 1 :] - last) * period
    return times


def _between(values: Floats, after: Integers, share: Floats, usable: Bools) -> Floats:
    """Return values between the frames before and ``after``; NaN where not usable or where either is absent."""
    weight = share.reshape(-1, *[1] * (values.ndim - 1))
    with np.errstate(invalid="ignore"):
        mixed = (1.0 - weight) * values[after - 1] + weight * values[after]
    mixed = np.where(weight == 0.0, values[after - 1], np.where(weight == 1.0, values[after], mixed))
    mixed[~usable] = np.nan
    return mixed
