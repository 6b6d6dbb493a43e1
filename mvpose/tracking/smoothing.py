"""Smoothing: estimates of earlier frames, improved by later ones (Rauch, Tung & Striebel, AIAA Journal 1965).

The smoother goes backwards over the moments that a tracker has passed. What it needs of a frame is the state before and
after its update, so pictures that were lost, late or taken by one camera alone need no care of their own. A track that
is taken for a person later was one before: its first frames are reported, too, and a ghost that is found out within the
lag never is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.kernels import njit
from mvpose.tracking.existence import FLASH
from mvpose.tracking.frame_kernels import vagueness
from mvpose.tracking.motion import transition
from mvpose.tracking.tracker import Moment, Tracker

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
            smoothed = deque(_smooth(tracker, waiting) if lag > 0.0 else waiting)
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


def _smooth(tracker: Tracker, moments: Iterable[Moment]) -> list[Moment]:
    """Return moments improved by all later ones."""
    result: list[Moment] = []
    for moment in reversed(list(moments)):
        result.append(_improved(tracker, moment, result[-1]) if result else moment)
    return result[::-1]


def _improved(tracker: Tracker, moment: Moment, later: Moment) -> Moment:
    """Return a moment improved by the next one, which is improved already."""
    tracks, after = moment.tracks, later.tracks
    match = (tracks.ids[:, None] == after.ids) if len(after) else np.zeros((len(tracks), 1), np.bool_)
    row = np.where(match.any(axis=1), match.argmax(axis=1), -1)
    assert later.predicted is not None, "moments to smooth are kept"
    smoothed = replace(tracks, state=tracks.state.copy(), covariance=tracks.covariance.copy())
    _smooth_people(
        smoothed.state, smoothed.covariance, row, *later.predicted, after.state, after.covariance, later.elapsed,
        tracker.motion.speed, tracker.motion.time,
    )  # fmt: skip
    odds = np.where(row >= 0, np.maximum(moment.odds, later.odds[row]), moment.odds) if len(after) else moment.odds
    # A track that ends within half a second of its birth was a ghost, unless nobody looked for longer.
    ended = (row < 0) & (moment.time - tracks.born_at < FLASH) & (later.elapsed < FLASH)
    odds = np.where(ended, -np.inf, odds)
    if len(after):
        odds = np.where((row >= 0) & np.isneginf(later.odds[row]), -np.inf, odds)
    if moment.poses is not None:
        return moment
    presence = (
        np.where(row >= 0, np.maximum(moment.presence, later.presence[row]), moment.presence)
        if len(after)
        else moment.presence
    )
    shown = (
        (odds > 0.0)
        & (presence > 0.0)
        & (vagueness(smoothed.state, smoothed.covariance) < tracker.model.existence.vague)
    )
    return replace(moment, tracks=smoothed, odds=odds, presence=presence, shown=shown)


@njit(cache=True)
def _smooth_people(states, covariances, row, predicted, predicted_covariance, after, after_covariance, dt, speed, time):
    """Smooth the states of n tracks, in place; see :func:`_smooth_joint`."""
    for t in range(len(states)):
        if row[t] < 0:
            continue
        for j in range(states.shape[1]):
            k = row[t]
            if np.isnan(states[t, j, 0]) or np.isnan(predicted[k, j, 0]) or np.isnan(after[k, j, 0]):
                continue
            reach, decay, _, _, _ = transition(dt, speed[j], time[j])
            _smooth_joint(
                states[t, j], covariances[t, j], predicted[k, j], predicted_covariance[k, j],
                after[k, j], after_covariance[k, j], reach, decay,
            )  # fmt: skip


@njit(cache=True)
def _smooth_joint(state, covariance, predicted, predicted_covariance, after, after_covariance, reach, decay):
    """Smooth position and velocity of one joint, in place.

    Args:
        state: filtered, (6,).
        covariance: filtered, (6, 6).
        predicted: for the next moment, before its update, (6,).
        predicted_covariance: its covariance, (6, 6).
        after: smoothed at the next moment, (6,).
        after_covariance: its covariance, (6, 6).
        reach: reach of the velocity, :func:`mvpose.tracking.motion.transition`.
        decay: decay of the velocity.
    """
    # gain = P Fᵀ S⁻¹, with F the transition and S the predicted covariance: solve S gainᵀ = F P by Cholesky
    L, gain = np.zeros((6, 6)), np.empty((6, 6))
    for r in range(6):
        for c in range(r + 1):
            rest = predicted_covariance[r, c]
            for k in range(c):
                rest -= L[r, k] * L[c, k]
            if r == c:
                if not rest > 0.0:
                    return
                L[r, r] = np.sqrt(rest)
            else:
                L[r, c] = rest / L[c, c]
    y = np.empty(6)
    for column in range(6):  # a row of the gain
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
                value -= L[k, r] * gain[column, k]
            gain[column, r] = value / L[r, r]
    change = np.empty((6, 6))
    for r in range(6):
        for c in range(6):
            state[r] += gain[r, c] * (after[c] - predicted[c])
            change[r, c] = after_covariance[r, c] - predicted_covariance[r, c]
    half = np.zeros((6, 6))
    for r in range(6):
        for c in range(6):
            for k in range(6):
                half[r, c] += gain[r, k] * change[k, c]
    for r in range(6):
        for c in range(6):
            for k in range(6):
                covariance[r, c] += half[r, k] * gain[c, k]
