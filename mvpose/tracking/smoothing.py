"""Tracking of whole recordings, with smoothing by later frames (Rauch, Tung & Striebel, AIAA Journal 1965).

The smoother goes backwards over the moments that a tracker has passed. What it needs of a frame is the state before and
after its update, so pictures that were lost, late or taken by one camera alone need no care of their own. A track that
is taken for a person later was one before: its first frames are reported, too, and a ghost that is found out within the
lag never is.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from copy import copy as shallow_copy
from dataclasses import dataclass

import numpy as np

from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.kernels import njit
from mvpose.pipeline import Pipeline
from mvpose.tracking.association import TrackingModel
from mvpose.tracking.existence import FLASH
from mvpose.tracking.frame_kernels import vagueness_of
from mvpose.tracking.motion import transition
from mvpose.tracking.tracker import Tracker
from mvpose.tracking.tracks import Moment

_FASTEST = 1e3  # frames per second; more wait only for a clock that stands still


def track(tracker: Tracker, rig: Rig, frames: Iterable[Detections], *, lag: float = 0.0) -> Iterator[Estimate]:
    """Yield the estimate of every frame, in order.

    Args:
        tracker: tracker at the start of the frames.
        rig: calibrated cameras.
        frames: detections of each frame, in the order of time.
        lag: seconds of later frames that an estimate waits for: 0 for none, infinite for a whole recording. Memory
            grows with the frames within the lag, at most a thousand per second: a clock that stands still holds up
            no more.

    Raises:
        ValueError: a negative lag, or as :meth:`mvpose.tracking.Tracker.estimate`.
    """
    if not lag >= 0.0:
        raise ValueError(f"lag must be 0 s or more, got {lag}")
    waiting: deque[Moment] = deque()
    for detections in frames:
        waiting.append(tracker.advance(rig, detections, keep=lag > 0.0))
        if lag == np.inf:
            continue
        if _is_due(waiting, lag):
            smoothed = deque(_smooth(tracker, waiting, remember=True))
            while _is_due(waiting, lag):
                waiting.popleft()
                yield tracker.report(smoothed.popleft())
    for moment in _smooth(tracker, waiting):
        yield tracker.report(moment)


def _is_due(waiting: deque[Moment], lag: float) -> bool:
    """Return whether the first moment has waited for the lag; one before the first picture waits for nothing."""
    if not waiting:
        return False
    return len(waiting) > _FASTEST * lag + 1.0 or not waiting[-1].time - waiting[0].time < lag


def _smooth(tracker: Tracker, moments: Sequence[Moment], *, remember: bool = False) -> list[Moment]:
    """Return moments improved by all later ones.

    Args:
        tracker: their tracker.
        moments: in the order of time.
        remember: whether the gains are kept for another call with the same moments.
    """
    result: list[Moment] = []
    for moment in reversed(moments):
        result.append(_improved(tracker, moment, result[-1], remember) if result else moment)
    return result[::-1]


def _improved(tracker: Tracker, moment: Moment, later: Moment, remember: bool) -> Moment:
    """Return a moment improved by the next one, which is improved already."""
    tracks, after = moment.tracks, later.tracks
    assert later.predicted is not None, "moments to smooth are kept"
    link = moment.link or _gains(
        tracks.ids, tracks.state, tracks.covariance, after.ids, *later.predicted, later.elapsed,
        tracker.motion.speed, tracker.motion.time,
    )  # fmt: skip
    if remember:
        moment.link = link
    known_later = after.state, after.covariance, later.odds, later.presence, later.elapsed
    state, covariance, odds, presence, shown = _improve(
        tracks.state, tracks.covariance, moment.odds, moment.presence, tracks.born_at, moment.time, link,
        later.predicted, known_later, tracker.model.existence.vague,
    )  # fmt: skip
    improved, smoothed = shallow_copy(moment), shallow_copy(tracks)
    smoothed.state, smoothed.covariance = state, covariance
    improved.tracks, improved.odds, improved.presence, improved.shown = smoothed, odds, presence, shown
    improved.poses = None  # the first frame has a future, so it is no longer that of the pipeline alone
    return improved


@njit(cache=True)
def _gains(ids, state, covariance, later_ids, predicted, predicted_covariance, elapsed, speed, time):
    """Return the row of each track in the next moment, (n,), -1 for none, and gains (n, J, 6, 6), NaN for none.

    Args:
        ids: identities, (n,).
        state: filtered states, (n, J, 6).
        covariance: their covariances, (n, J, 6, 6).
        later_ids: identities in the next moment, (k,).
        predicted: states predicted for the next moment, (k, J, 6).
        predicted_covariance: their covariances, (k, J, 6, 6).
        elapsed: time to the next moment, seconds.
        speed: standard deviation of a component of the velocity of each joint, (J,), m/s.
        time: time after which it is correlated by 1/e, (J,), seconds.
    """
    n, joints = state.shape[:2]
    row, gain, scratch = np.full(n, -1), np.empty((n, joints, 6, 6)), np.empty((7, 6))
    for t in range(n):
        for k in range(len(later_ids)):
            if row[t] < 0 and later_ids[k] == ids[t]:
                row[t] = k
        for j in range(joints):
            known = row[t] >= 0 and not np.isnan(state[t, j, 0]) and not np.isnan(predicted[row[t], j, 0])
            if known:
                reach, decay, _, _, _ = transition(elapsed, speed[j], time[j])
                known = smoother_gain(
                    gain[t, j], covariance[t, j], predicted_covariance[row[t], j], reach, decay, scratch
                )
            if not known:
                gain[t, j, 0, 0] = np.nan
    return row, gain


@njit(cache=True, borrows=True)
def smoother_gain(gain, covariance, predicted_covariance, reach, decay, scratch):
    """Write the gain P Fᵀ S⁻¹ of one joint, with F the transition and S the predicted covariance, as its transpose.

    Args:
        gain: output, (6, 6).
        covariance: P, filtered, (6, 6).
        predicted_covariance: S, for the next moment, before its update, (6, 6).
        reach: reach of the velocity, :func:`mvpose.tracking.motion.transition`.
        decay: decay of the velocity.
        scratch: working memory, (7, 6).

    Returns:
        Whether S is positive definite.
    """
    L, y = scratch[:6], scratch[6]  # solve S gainᵀ = F P by Cholesky
    for r in range(6):
        for c in range(r + 1):
            rest = predicted_covariance[r, c]
            for k in range(c):
                rest -= L[r, k] * L[c, k]
            if r == c:
                if not rest > 0.0:
                    return False
                L[r, r] = np.sqrt(rest)
            else:
                L[r, c] = rest / L[c, c]
    for column in range(6):
        for r in range(6):
            value = (
                covariance[column, r] + reach * covariance[column, r + 3] if r < 3 else decay * covariance[column, r]
            )
            for k in range(r):
                value -= L[r, k] * y[k]
            y[r] = value / L[r, r]
        for r in range(5, -1, -1):
            value = y[r]
            for k in range(r + 1, 6):
                value -= L[k, r] * gain[k, column]
            gain[r, column] = value / L[r, r]
    return True


@njit(cache=True)
def _improve(state, covariance, odds, presence, born_at, time, link, predictions, later, vague):
    """Return the smoothed states of n tracks, their covariances, odds and presence, and whether each is shown.

    Args:
        state: filtered, (n, J, 6).
        covariance: their covariances, (n, J, 6, 6).
        odds: log-odds that each track is a person, (n,).
        presence: log-odds that this person is still here, (n,).
        born_at: time of birth, (n,), seconds.
        time: time of the moment, seconds.
        link: row of each track in the next moment, (n,), or -1; and transposed gains, (n, J, 6, 6).
        predictions: states for the next moment, before its update, (k, J, 6), and their covariances, (k, J, 6, 6).
        later: of the next moment: smoothed states, (k, J, 6), their covariances, (k, J, 6, 6), odds and presence,
            (k,) each, and the time that passes until then, seconds.
        vague: standard deviation of the best-known joint above which nobody is reported, metres.
    """
    row, gain = link
    predicted, predicted_covariance = predictions
    after, after_covariance, later_odds, later_presence, elapsed = later
    state, covariance, odds, presence = state.copy(), covariance.copy(), odds.copy(), presence.copy()
    shown, scratch = np.empty(len(state), np.bool_), np.empty((12, 6))
    for t in range(len(state)):
        k = row[t]
        for j in range(state.shape[1]):
            if k >= 0 and not np.isnan(gain[t, j, 0, 0]) and not np.isnan(after[k, j, 0]):
                smooth_joint(
                    state[t, j], covariance[t, j], predicted[k, j], predicted_covariance[k, j],
                    after[k, j], after_covariance[k, j], gain[t, j], scratch,
                )  # fmt: skip
        if k >= 0:
            # Who has just appeared is judged by what later pictures say; of others they may say that they have left.
            young = time - born_at[t] < FLASH and elapsed < FLASH
            odds[t] = later_odds[k] if young or later_odds[k] == -np.inf else max(odds[t], later_odds[k])
            presence[t] = max(presence[t], later_presence[k])
        elif time - born_at[t] < FLASH and elapsed < FLASH:
            # A track that ends within half a second of its birth was a ghost, unless nobody looked for longer.
            odds[t] = -np.inf
        shown[t] = odds[t] > 0.0 and presence[t] > 0.0 and vagueness_of(state[t], covariance[t]) < vague
    return state, covariance, odds, presence, shown


@njit(cache=True, borrows=True)
def smooth_joint(state, covariance, predicted, predicted_covariance, after, after_covariance, gain, scratch):
    """Smooth position and velocity of one joint, in place.

    Args:
        state: filtered, (6,).
        covariance: filtered, (6, 6).
        predicted: for the next moment, before its update, (6,).
        predicted_covariance: its covariance, (6, 6).
        after: smoothed at the next moment, (6,).
        after_covariance: its covariance, (6, 6).
        gain: transposed, of :func:`smoother_gain`, (6, 6).
        scratch: working memory, (12, 6).
    """
    change, half = scratch[:6], scratch[6:]
    for k in range(6):
        difference = after[k] - predicted[k]
        for r in range(6):
            state[r] += gain[k, r] * difference
            change[k, r] = after_covariance[k, r] - predicted_covariance[k, r]
    # The innermost loops run along rows, which processors do several columns at a time.
    for r in range(6):
        for c in range(6):
            half[r, c] = 0.0
        for k in range(6):
            for c in range(6):
                half[r, c] += gain[k, r] * change[k, c]
    for r in range(6):
        for k in range(6):
            for c in range(6):
                covariance[r, c] += half[r, k] * gain[k, c]


@dataclass(frozen=True)
class TrackingPipeline:
    """Tracker of recordings (:class:`mvpose.estimators.SequenceEstimator`), which keeps no state between them."""

    pipeline: Pipeline = Pipeline()
    """Stages of one frame."""
    model: TrackingModel = TrackingModel()
    """Settings of the tracker."""
    lag: float = 0.2
    """Seconds of later frames that an estimate waits for: 0 for none, infinite for a whole recording. A fifth of a
    second, the default, is long enough to tell a person from two false detections that meet, and short enough for a
    live display."""

    def __post_init__(self) -> None:
        if not self.lag >= 0.0:
            raise ValueError(f"lag must be 0 s or more, got {self.lag}")

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame alone, as the pipeline does, without identities."""
        return self.pipeline.estimate(rig, detections)

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Yield the estimate of every frame of a recording, in order; every call starts without a past.

        Args:
            rig: calibrated cameras.
            frames: detections of each frame, in the order of time.

        Raises:
            ValueError: as :meth:`mvpose.tracking.Tracker.estimate`.
        """
        return track(Tracker(self.pipeline, model=self.model), rig, frames, lag=self.lag)
