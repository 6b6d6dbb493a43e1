"""Memory of the tracker over an hour of five cameras at 30 Hz, with people who come and go."""

from __future__ import annotations

import gc
import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.method.report import caption, figure, table
from benchmarks.tracking.stream import fast, stream
from mvpose.estimate import Estimate
from mvpose.tracking import Tracker, track

VIEWS, PEOPLE, RATE = 5, 4, 30.0
_MINUTES, _EVERY = 60, 5
LAGS = (0.0, 0.2)


@dataclass(frozen=True)
class Sign:
    """State of the process after some minutes of the stream.

    Attributes:
        lag: lag of the smoother, seconds; 0 for the tracker alone.
        minutes: time of the stream.
        frames: frames so far.
        identities: identities so far.
        tracks: tracks that are followed.
        lost: tracks that may come back.
        state: arrays of the tracker, kB.
        resident: resident memory of the process, MB.
        drifts: cameras that the tracker took for moved; none has.
        ms: mean time of a frame since the previous row, with that of its simulation, ms.
    """

    lag: float
    minutes: float
    frames: int
    identities: int
    tracks: int
    lost: int
    state: float
    resident: float
    drifts: int
    ms: float


def measure(*, quick: bool = False) -> list[Sign]:
    """Track an hour of the stream, with and without a lag."""
    minutes, every = (0.2, 0.1) if quick else (_MINUTES, _EVERY)
    return [sign for lag in LAGS for sign in _signs(lag, minutes, every)]


def _signs(lag: float, minutes: float, every: float) -> Iterator[Sign]:
    rig, detections = stream(VIEWS, PEOPLE, rate=RATE)
    tracker = Tracker(fast())
    frames, step = round(minutes * 60 * RATE), round(every * 60 * RATE)
    estimates: Iterator[Estimate] = track(tracker, rig, itertools.islice(detections, frames), lag=lag)
    known, start = -1, time.perf_counter()
    for frame, estimate in enumerate(estimates, 1):
        known = max(known, *estimate.ids) if estimate.ids is not None and len(estimate) else known
        if frame % step == 0:
            gc.collect()
            state, now = tracker.state(), time.perf_counter()
            yield Sign(
                lag, frame / 60 / RATE, frame, int(known) + 1, state.followed, state.lost, state.nbytes / 1e3,
                resident_memory(), len(tracker.drifts), 1e3 * (now - start) / step,
            )  # fmt: skip
            start = now


def resident_memory() -> float:
    """Return the resident memory of this process, MB (10^6 bytes); NaN where the system does not say."""
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmRSS:"):
                return float(line.split()[1]) * 1024 / 1e6
    return float("nan")


def table_of(signs: list[Sign]) -> str:
    """Format the rows as text."""
    counts = ["frames", "identities", "tracks", "lost"]
    rows = [["lag s", "minutes", *counts, "state kB", "resident MB", "moved", "ms/frame"]]
    rows += [
        [
            figure(each.lag), f"{each.minutes:g}", str(each.frames), str(each.identities), str(each.tracks),
            str(each.lost), figure(each.state), figure(each.resident), str(each.drifts), figure(each.ms),
        ]
        for each in signs
    ]  # fmt: skip
    return table(rows, ">" * len(rows[0])) + caption(
        f"{VIEWS} cameras at {RATE:g} Hz, {PEOPLE} people at a time on average, each for a minute, one false "
        "detection a frame. The time has that of the simulation in it."
    )
