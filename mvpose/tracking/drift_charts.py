"""Charts that tell a camera which has moved from the errors of keypoints: one test a second for each camera.

Each second gives the shift of the camera's pictures (:mod:`mvpose.tracking.picture_shift`) beside the mean of the first
minute. A cumulative sum (Page, Biometrika 1954) of log-likelihood ratios stands for each direction of each number: of
a shift by the smallest that counts against none. It falls while the camera stands and rises when it has moved; its last
zero is when that happened. Without a move it reaches ``h`` once in ``exp(h)`` seconds at most (Lorden, Annals of
Mathematical Statistics 1971), which gives the threshold for a rate of false alarms.

A camera that has moved misplaces people for the others, so one of them may be suspected first. It is cleared when, with
the culprit left out, its pictures are where they were; so is a camera that was put back.

Where a camera has moved so far that its detections fit nobody, no keypoint shows it. A chart of its own counts people
whom other cameras see in its picture, while the detections there belong to nobody.
"""

from typing import NamedTuple, Self

import numpy as np

from mvpose.arrays import Floats
from mvpose.kernels import njit
from mvpose.tracking.existence import in_image
from mvpose.tracking.picture_shift import TERMS, measure_shifts, solve_shift

NUMBERS = TERMS + 1
"""The numbers of a shift, and the share of stray people."""

STRAY = TERMS
"""Row of the share of people in a picture whom its detections do not fit."""

_BATCH = 1.0  # seconds: errors of poses are correlated over 0.3 s, so seconds are independent
INTERVAL = 0.25
"""Seconds between two looks at a camera: in less, errors repeat themselves."""

_LEAST_KEYPOINTS = 40  # of a batch: three people once, or one person three times
_LEARNING, _REFERENCE = 5, 60  # batches before the first test, and until the mean shift is no longer learned
_PRIOR = 0.05  # standard deviation of the numbers of a shift before anything is seen: 3 degrees
_LATEST = 0.3  # weight of the latest batch in the mean deviation
_FEWEST, _FEWEST_STRAY = 3.0, 30.0  # batches that an alarm takes at least; people hide, others come
_CLEARED = 10.0  # batches in a row without a deviation after which a camera is trusted again
_SUSPECTED = 0.25  # share of the threshold from which on a camera may be the one that has moved
_ALL_STRAY, _STRAY_VARIANCE = 0.6, 0.09  # share of stray people where a camera fits nobody, and the variance in a batch


class Charts(NamedTuple):
    """What is known of V cameras, as arrays that kernels update in place."""

    looked: Floats
    """Time of the latest look, (V,), seconds; -inf before the first."""
    start: Floats
    """Start of the batch, (V,), seconds; NaN before the first."""
    keypoints: Floats
    """Number of keypoints of the batch, (V,)."""
    normal: Floats
    """Normal equations of the batch, (V, 4, 5)."""
    people: Floats
    """People of the batch whom the camera found, and stray ones, (V, 2)."""
    residual: Floats
    """Sums over the latest seconds, (V, 3), see :func:`mvpose.tracking.picture_shift.measure_shifts`."""
    batches: Floats
    """Number of batches so far, (V,)."""
    reference: Floats
    """Mean numbers of the first minute, (V, 5)."""
    deviation: Floats
    """Mean deviation from them in the latest seconds, (V, 5)."""
    sums: Floats
    """Cumulative sums, (V, 5, 2), for rising and falling numbers."""
    calm: Floats
    """Number of the latest batches in which the mean deviation was small, (V,)."""
    onset: Floats
    """Time at which each left zero, (V, 5, 2), seconds."""
    alarm: Floats
    """Time at which the camera was found to have moved, (V,), seconds; NaN for none."""
    since: Floats
    """Time since which it has, (V,), seconds."""

    @classmethod
    def empty(cls, cameras: int) -> Self:
        """Return the charts of cameras that nobody has looked at."""
        V, nan = cameras, np.nan
        return cls(
            looked=np.full(V, -np.inf),
            start=np.full(V, nan),
            keypoints=np.zeros(V),
            normal=np.zeros((V, TERMS, TERMS + 1)),
            people=np.zeros((V, 2)),
            residual=np.zeros((V, 3)),
            batches=np.zeros(V),
            reference=np.zeros((V, NUMBERS)),
            deviation=np.zeros((V, NUMBERS)),
            sums=np.zeros((V, NUMBERS, 2)),
            calm=np.zeros(V),
            onset=np.full((V, NUMBERS, 2), nan),
            alarm=np.full(V, nan),
            since=np.full(V, nan),
        )


class DriftTest(NamedTuple):
    """Settings of the test whether a camera has moved."""

    smallest: Floats
    """Least shift that counts, of each number of a shift, (4,)."""
    floor: Floats
    """Standard deviation of the numbers between batches that no residual shows, (4,)."""
    inflation: float
    """Factor of the variance of the mean of keypoints, which are not independent."""
    threshold: float
    """Sum at which a camera has moved."""


@njit(cache=True)
def update_charts(charts, now, since, pictures, people, rays, sigmas, cameras, sizes, test):
    """Look at the cameras whose turn it is, and test those whose batch is full.

    Args:
        charts: :class:`Charts`, updated in place.
        now: time of the frame, seconds.
        since: time since the latest look at any camera, seconds.
        pictures: whether each camera gave a picture, (V,).
        people: :class:`mvpose.tracking.picture_shift.ExpectedPeople`.
        rays: :class:`mvpose.tracking.pose_update.MatchedRays` of the m detections.
        sigmas: standard deviation of a confident keypoint, (J,), metres.
        cameras: :attr:`mvpose.camera.Rig.packed`, (V, 22).
        sizes: width and height, (V, 2), pixels.
        test: :class:`DriftTest`.

    Returns:
        Whether there was a look.
    """
    count = len(pictures)
    trusted = np.isnan(charts.alarm)
    turns = max(1, int(np.ceil(count * min(since / INTERVAL, 1.0))))
    for turn in range(turns):
        watched = -1
        for v in range(count):
            due = pictures[v] and now - charts.looked[v] > 0.5 * INTERVAL
            if due and (watched < 0 or charts.looked[v] < charts.looked[watched]):
                watched = v
        if watched < 0:
            return turn > 0
        v = watched
        age = min(now - charts.looked[v], 1e6)
        charts.looked[v] = now
        if np.isnan(charts.start[v]):
            charts.start[v] = now
        charts.keypoints[v] += measure_shifts(
            v, charts.normal[v], charts.residual[v], age, trusted, people, rays, sigmas, cameras
        )
        _count_people(charts.people[v], v, people, rays, cameras[v], sizes[v])
        full = charts.keypoints[v] >= _LEAST_KEYPOINTS or charts.people[v].sum() >= 5.0
        if full and now - charts.start[v] >= _BATCH:
            _close_batch(charts, v, now, test)
    return True


@njit(cache=True, borrows=True)
def _count_people(counts, watched, people, rays, camera, size):
    """Count the people in a picture whom two other cameras see: those whom its detections fit, and stray ones.

    A person is stray where the picture also has a detection that belongs to nobody, one for each stray person.
    """
    groups, reported, state = people
    labels, view, _, _, _, _, _ = rays  # numba takes an attribute "view" for the method of arrays
    spare, missing = 0, 0
    for d in range(len(labels)):
        owned = False
        for t in range(len(groups)):
            owned = owned or (labels[d] >= 0 and groups[t] == labels[d] and reported[t])
        spare += view[d] == watched and not owned
    for t in range(len(groups)):
        if groups[t] < 0 or not reported[t]:
            continue
        others, found = 0, False
        for d in range(len(labels)):
            if labels[d] == groups[t]:
                others += view[d] != watched
                found = found or view[d] == watched
        if others >= 2 and found:
            counts[0] += 1.0
        elif others >= 2 and in_image(camera, size, state[t]):
            missing += 1
    counts[1] += min(spare, missing)


@njit(cache=True)
def _close_batch(charts, v, now, test):
    """Test one camera by its batch, and start the next."""
    smallest, floor, inflation, threshold = test
    shift, variance = np.zeros(NUMBERS), np.full(NUMBERS, _STRAY_VARIANCE)
    known = charts.keypoints[v] >= _LEAST_KEYPOINTS
    if known:
        solve_shift(shift, variance, charts.normal[v], _PRIOR)
    people = charts.people[v, 0] + charts.people[v, 1]
    shift[STRAY] = charts.people[v, 1] / people if people > 0.0 else 0.0
    quiet = True
    for k in range(NUMBERS):
        if k < TERMS and not known:
            continue
        least, fewest = (_ALL_STRAY, _FEWEST_STRAY) if k == STRAY else (smallest[k], _FEWEST)
        if k < TERMS:
            variance[k] = inflation * variance[k] + floor[k] ** 2
        apart = shift[k] - charts.reference[v, k]
        charts.deviation[v, k] += _LATEST * (apart - charts.deviation[v, k])
        if charts.batches[v] < _LEARNING or not np.isnan(charts.alarm[v]):
            continue
        variance[k] *= 1.0 + 1.0 / charts.batches[v]  # the reference is a mean of as many
        for side in range(1 if k == STRAY else 2):
            ratio = least * ((apart if side == 0 else -apart) - 0.5 * least) / variance[k]
            before = charts.sums[v, k, side]
            charts.sums[v, k, side] = max(before + min(ratio, threshold / fewest), 0.0)
            if before == 0.0 and charts.sums[v, k, side] > 0.0:
                charts.onset[v, k, side] = charts.start[v]
            quiet = quiet and charts.sums[v, k, side] == 0.0
    if known and quiet and charts.batches[v] < _REFERENCE and np.isnan(charts.alarm[v]):
        charts.batches[v] += 1.0
        for k in range(NUMBERS):
            charts.reference[v, k] += (shift[k] - charts.reference[v, k]) / charts.batches[v]
    charts.calm[v] = charts.calm[v] + 1.0 if _is_calm(charts.deviation[v], smallest) else 0.0
    if charts.calm[v] >= _CLEARED and not np.isnan(charts.alarm[v]):
        charts.alarm[v] = charts.since[v] = np.nan
        charts.sums[v] = 0.0
    charts.start[v], charts.keypoints[v] = now, 0.0
    charts.normal[v], charts.people[v] = 0.0, 0.0
    if charts.sums[v].max() >= threshold and np.isnan(charts.alarm[v]):
        _raise_alarm(charts, now, smallest, threshold)


@njit(cache=True, borrows=True)
def _is_calm(deviation, smallest):
    """Return whether no number of a shift deviates by more than a third of the least that counts."""
    calm = 3.0 * deviation[STRAY] < _ALL_STRAY
    for k in range(TERMS):
        calm = calm and 3.0 * np.abs(deviation[k]) < smallest[k]
    return calm


@njit(cache=True, borrows=True)
def _raise_alarm(charts, now, smallest, threshold):
    """Mark the camera that has moved furthest; the others are tested anew, because it has misplaced people for them."""
    moved, furthest, onset = -1, 0.0, np.nan
    for v in range(len(charts.alarm)):
        if not np.isnan(charts.alarm[v]):
            continue
        apart = charts.deviation[v]
        for k in range(NUMBERS):
            far = np.abs(apart[k]) / (_ALL_STRAY if k == STRAY else smallest[k])
            if k < 2:
                far = np.sqrt(apart[0] ** 2 + apart[1] ** 2) / smallest[k]
            for side in range(2):
                if charts.sums[v, k, side] >= _SUSPECTED * threshold and far > furthest:
                    moved, furthest, onset = v, far, charts.onset[v, k, side]
    charts.sums[:] = 0.0
    if moved >= 0:
        charts.calm[moved] = 0.0
        charts.alarm[moved], charts.since[moved] = now, onset
