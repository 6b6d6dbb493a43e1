"""Tracklets: detections of one view that follow each other in time and show one person.

A detection continues a tracklet where each is the other's nearest and every rival is much farther. Where people pass
each other, the tracklets end and new ones begin: a tracklet that is cut in two costs little, one that changes from a
person to another spoils all that is concluded from it.

The standard deviation of a keypoint is that of :class:`mvpose.reconstruction.likelihood.Noise`, in pixels instead of
metres: an adult has an area of (0.70 m)², so the size of a person in the picture gives the pixels per metre at the
person.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import as_array
from mvpose.detections import Detections
from mvpose.duplicates import Duplicates
from mvpose.kernels import njit
from mvpose.reconstruction.likelihood import Noise
from mvpose.skeleton import COCO17, Skeleton

_LONGEST_GAP = 0.3  # seconds without a detection, after which a tracklet ends
_BODY = 0.70  # metres: square root of the area of an adult (mvpose.reconstruction.likelihood.Noise)
_SPEED = 2.5  # m/s: a fast walk; 99 % of people walk slower (Bohannon, Age and Ageing 1997)
_SCATTER = 0.25  # in square roots of the person's area: mean error of a bad detection
_RIVAL = 0.6  # a link must be shorter than this share of the distance to any other candidate
_SATURATION = 1.0  # in square roots of the area: greatest distance that one joint counts for
_WINDOW = 0.12  # seconds before and after, over which velocities are fitted: limbs swing once in a second

_EDGE = 0.01
"""Share of the picture's longer side from its edge in which keypoints do not count: a detector places joints of people
who are cut off there, tenths of a metre from where they are."""

_NOISE = Noise()
_BOX_SHARE = 0.53  # fraction of its box that a person fills (Ronchi & Perona, ICCV 2017)
_LOWEST_SCORE = 0.2  # a keypoint of a lower score is not less accurate: it is right or grossly wrong


@dataclass(frozen=True)
class Tracklets:
    """Detections of all frames, sorted by tracklet and then by frame."""

    tracklet: Integers
    """Tracklet of each of n detections, 0, 1, ..., (n,)."""
    frame: Integers
    """Frame of each detection, (n,)."""
    view: Integers
    """View of each detection, (n,); the same within a tracklet."""
    keypoints: Floats
    """Pixels as detected, (n, J, 2); NaN where missing."""
    sigma: Floats
    """Standard deviation of each keypoint, pixels, (n, J); infinite where it is missing."""
    velocity: Floats
    """Velocity of each keypoint in its picture, pixels/s, (n, J, 2); 0 where it is unknown."""
    times: Floats
    """Time of each picture, (F, V), seconds; NaN where there is none."""
    skeleton: Skeleton
    """The J joints."""
    descriptors: Floats | None = None
    """Appearance, (n, D), or None; NaN for a detection without."""

    def __len__(self) -> int:
        """Number of tracklets."""
        return int(self.tracklet[-1]) + 1 if len(self.tracklet) else 0

    @property
    def starts(self) -> Integers:
        """First detection of each tracklet, and n at the end, (tracklets + 1,)."""
        return np.searchsorted(self.tracklet, np.arange(len(self) + 1))

    @property
    def views(self) -> Integers:
        """View of each tracklet, (tracklets,)."""
        return self.view[self.starts[:-1]]


def picture_times(frames: Sequence[Detections], views: int, *, period: float) -> Floats:
    """Return the time of each picture, (F, V), seconds; NaN where there is none.

    A frame without times has all its pictures ``period`` after those of the frame before.

    Raises:
        ValueError: a period that is not positive, or times of another number of cameras.
    """
    if not 0.0 < period < np.inf:
        raise ValueError(f"period must be the seconds between two frames, above 0 and finite, got {period}")
    times = np.empty((len(frames), views))
    for number, frame in enumerate(frames):
        if frame.time is None:
            times[number] = number * period
        else:
            times[number] = as_array(frame.time, (views,), f"time of frame {number} (one for each camera)")
    return times


def frame_times(times: Floats) -> Floats:
    """Return the median time of the pictures of each frame, (F,), seconds; NaN for a frame without pictures.

    Args:
        times: of all pictures, (F, V), seconds; NaN where there is none.
    """
    result = np.full(len(times), np.nan)
    pictured = np.isfinite(times).any(axis=1)
    if pictured.any():
        result[pictured] = np.nanmedian(times[pictured], axis=1)
    return result


def link(rig: Rig, frames: Sequence[Detections], *, period: float = 0.04) -> Tracklets:
    """Link the detections of each view over time.

    Args:
        rig: cameras, of which only the number and the sizes of pictures are used.
        frames: detections of each frame, all views.
        period: seconds between frames whose detections carry no time.

    Raises:
        ValueError: no frames, frames of different skeletons, a view that the rig does not have, or wrong times.
    """
    skeleton = _checked(rig, frames)
    times = picture_times(frames, len(rig), period=period)
    suppress = Duplicates()
    kept = [frame.select(suppress(frame) & frame.detected.any(axis=1)) for frame in frames] or [Detections.empty()]
    number: Integers = np.repeat(np.arange(len(kept)), [len(each) for each in kept])
    view = np.concatenate([each.view for each in kept])
    keypoints = np.concatenate([each.keypoints for each in kept])
    scores = np.concatenate([each.scores for each in kept])
    timed = np.isfinite(times[number, view])
    number, view, keypoints, scores = number[timed], view[timed], keypoints[timed], scores[timed]
    area, sigma = keypoint_sigma(keypoints, scores, skeleton)
    for each, camera in enumerate(rig):
        own = np.flatnonzero(view == each)
        sigma[own] = np.where(_at_edge(keypoints[own], camera.size), np.inf, sigma[own])
    tracklet = np.full(len(view), -1)
    count = 0
    for each in range(len(rig)):
        chosen = np.flatnonzero(view == each)
        links = _linked(number[chosen], times[:, each], keypoints[chosen], np.sqrt(area[chosen]))
        tracklet[chosen] = links + count
        count += int(links.max(initial=-1)) + 1
    order = np.lexsort((number, tracklet))
    tracklet, number, view = tracklet[order], number[order], view[order]
    keypoints, sigma = keypoints[order], sigma[order]
    velocity = _velocities(tracklet, times[number, view], keypoints, _WINDOW)
    descriptors = None
    if all(each.descriptors is not None for each in kept):
        descriptors = np.concatenate([np.asarray(each.descriptors) for each in kept])[timed][order]
    return Tracklets(tracklet, number, view, keypoints, sigma, velocity, times, skeleton, descriptors)


def _at_edge(keypoints: Floats, size: tuple[int, int]) -> Bools:
    """Return which keypoints (n, J) of a view are at the edge of its pictures.

    Where the pictures are larger than the size that the calibration states, they are so many times as large as it
    takes to hold the keypoints.
    """
    known = keypoints[np.isfinite(keypoints[..., 0])]
    if not len(known):
        return np.zeros(keypoints.shape[:2], np.bool_)
    stated = np.array(size, float)
    reach = np.quantile(known, 0.99, axis=0)
    larger = (factor * each for factor in (1.0, 4 / 3, 1.5, 2.0, 3.0, 4.0) for each in (stated, stated[::-1]))
    far = next((each for each in larger if (reach <= 1.02 * each).all()), reach)
    margin = _EDGE * far.max()
    with np.errstate(invalid="ignore"):
        return np.asarray(((keypoints < margin) | (keypoints > far - 1.0 - margin)).any(axis=-1))


def _checked(rig: Rig, frames: Sequence[Detections]) -> Skeleton:
    """Return the skeleton of all frames."""
    if not len(frames):
        return COCO17
    for number, frame in enumerate(frames):
        if frame.skeleton != frames[0].skeleton:
            raise ValueError(
                f"frame {number} has skeleton {frame.skeleton.name!r}, frame 0 {frames[0].skeleton.name!r}; expected "
                "one skeleton"
            )
        if len(frame) and frame.view.max() >= len(rig):
            raise ValueError(
                f"frame {number} names view {frame.view.max()}, but the rig has {len(rig)} cameras; pass the rig that "
                "the detections were made with"
            )
    return frames[0].skeleton


def _linked(frame: Integers, times: Floats, keypoints: Floats, size: Floats) -> Integers:
    """Return the tracklet of each detection of one view, (n,), given in the order of frames.

    Args:
        frame: frame of each detection, (n,).
        times: time of the picture of each frame, (F,), seconds.
        keypoints: pixels, (n, J, 2).
        size: square root of the area of each person, (n,), pixels.
    """
    result = np.full(len(frame), -1)
    drift = np.zeros((len(frame), 2))  # velocity of the whole person, pixels/s
    latest = np.zeros(0, np.int64)  # last detection of each tracklet that may go on
    count, starts = 0, np.searchsorted(frame, np.arange(len(times) + 1))
    for k in np.unique(frame):
        new = np.arange(starts[k], starts[k + 1])
        latest = latest[times[k] - times[frame[latest]] <= _LONGEST_GAP]
        after, before = np.full(len(new), -1), np.zeros(0, np.int64)
        if len(latest):
            elapsed = times[k] - times[frame[latest]]
            after, before = _links(keypoints, size, drift, latest, new, elapsed)
        for i, d in enumerate(new):
            if after[i] < 0:
                result[d] = count
                count += 1
                continue
            last = latest[after[i]]
            result[d] = result[last]
            moved = keypoints[d] - keypoints[last]
            speed = np.median(moved[np.isfinite(moved[:, 0])], axis=0) / elapsed[after[i]]
            drift[d] = 0.5 * (drift[last] + speed)
        goes_on = np.ones(len(latest), np.bool_)
        goes_on[after[after >= 0]] = False
        goes_on[before] = False
        latest = np.concatenate([latest[goes_on], new])
    return result


def _links(
    keypoints: Floats, size: Floats, drift: Floats, latest: Integers, new: Integers, elapsed: Floats
) -> tuple[Integers, Integers]:
    """Return the tracklet that each new detection continues, -1 for none, and the tracklets that end in doubt."""
    scale = 0.5 * (size[latest][:, None] + size[new][None])  # (a, b)
    expected = keypoints[latest] + (drift[latest] * elapsed[:, None])[:, None]
    error = np.linalg.norm(expected[:, None] - keypoints[new][None], axis=-1)  # (a, b, J)
    shared = np.isfinite(error)
    error = np.minimum(np.where(shared, error, 0.0) / np.maximum(scale, 1.0)[..., None], _SATURATION)
    common = shared.sum(axis=-1)
    reach = np.minimum(_SCATTER + _SPEED / _BODY * elapsed, 0.9 * _SATURATION)[:, None]
    distance = np.where(common >= 3, np.where(shared, error, 0.0).sum(axis=-1) / np.maximum(common, 1), np.inf)
    after, doubtful = np.full(len(new), -1), []
    for b in range(len(new)):
        a = int(np.argmin(distance[:, b]))
        if not distance[a, b] <= reach[a, 0]:
            continue
        rivals = min(np.delete(distance[:, b], a).min(initial=np.inf), np.delete(distance[a], b).min(initial=np.inf))
        if distance[a, b] <= _RIVAL * rivals:
            after[b] = a
        else:
            doubtful.append(a)
    return after, np.array(doubtful, np.int64)


@njit(cache=True)
def _velocities(tracklet, times, keypoints, window):
    """Return the slope of a line through the keypoints of the same tracklet around each, (n, J, 2), pixels/s."""
    n, joints = keypoints.shape[:2]
    result = np.zeros((n, joints, 2))
    for d in range(n):
        low, high = d, d
        while low > 0 and tracklet[low - 1] == tracklet[d] and times[d] - times[low - 1] <= window:
            low -= 1
        while high + 1 < n and tracklet[high + 1] == tracklet[d] and times[high + 1] - times[d] <= window:
            high += 1
        for j in range(joints):
            count, t, x, y = 0, 0.0, 0.0, 0.0
            for k in range(low, high + 1):
                if not np.isnan(keypoints[k, j, 0]):
                    count += 1
                    t += times[k]
                    x += keypoints[k, j, 0]
                    y += keypoints[k, j, 1]
            if count < 2:
                continue
            t, x, y = t / count, x / count, y / count
            tt, tx, ty = 0.0, 0.0, 0.0
            for k in range(low, high + 1):
                if not np.isnan(keypoints[k, j, 0]):
                    tt += (times[k] - t) ** 2
                    tx += (times[k] - t) * (keypoints[k, j, 0] - x)
                    ty += (times[k] - t) * (keypoints[k, j, 1] - y)
            if tt > 0.0:
                result[d, j, 0], result[d, j, 1] = tx / tt, ty / tt
    return result


def chosen_frames(tracklets: Tracklets, *, spacing: float) -> Bools:
    """Return a mask of frames, (F,), about ``spacing`` seconds apart, those with the most detections of their time.

    Errors of detectors last for tenths of a second, so frames in between add time and little evidence.
    """
    times = tracklets.times
    chosen = np.zeros(len(times), np.bool_)
    when = frame_times(times)
    with_pictures = np.isfinite(when)
    if not with_pictures.any():
        return chosen
    slot = np.where(with_pictures, np.floor((when - np.nanmin(when)) / spacing + 1e-9), -1)
    detections = np.bincount(tracklets.frame, minlength=len(times))
    for each in np.unique(slot[slot >= 0]):
        members = np.flatnonzero(slot == each)
        chosen[members[np.argmax(detections[members])]] = True
    return chosen


def keypoint_sigma(keypoints: Floats, scores: Floats, skeleton: Skeleton) -> tuple[Floats, Floats]:
    """Return the area of each person, (n,), pixels², and the standard deviation of keypoints, (n, J), pixels.

    The area is that of the box around the keypoints, without the fifth of them that are farthest from the median, times
    the share of the box that a person fills. Where only few joints are detected it is too small.

    Args:
        keypoints: pixels, (n, J, 2); NaN where missing.
        scores: scores, (n, J); a keypoint of half the score has twice the standard deviation.
        skeleton: the J joints.

    Returns:
        Areas and standard deviations; the latter are infinite where the keypoint is missing.
    """
    detected = scores > 0
    if not len(keypoints):
        return np.zeros(0), np.zeros(scores.shape)
    center = np.nanmedian(keypoints, axis=1, keepdims=True)
    away = np.abs(keypoints - center).max(axis=-1)
    near = detected & (away <= 5.0 * np.nanmedian(away, axis=1, keepdims=True))
    low = np.where(near[..., None], keypoints, np.inf).min(axis=1)
    high = np.where(near[..., None], keypoints, -np.inf).max(axis=1)
    sides = np.maximum(high - low, 1.0)
    # A person seen from the side, or of whom one part is detected, has a narrow box: no side counts as less than a
    # quarter of the other.
    sides = np.maximum(sides, 0.25 * sides[:, ::-1])
    area = _BOX_SHARE * sides.prod(axis=1)
    relative = _NOISE.sigmas(skeleton) / _NOISE.area
    sigma = np.hypot(np.sqrt(area)[:, None] * relative, _NOISE.pixels) / np.maximum(scores, _LOWEST_SCORE)
    return area, np.where(detected, sigma, np.inf)
