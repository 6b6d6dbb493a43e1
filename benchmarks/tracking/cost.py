"""Time of a frame of the tracker beyond that of its pipeline, in pairs of calls on the same frames."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass

import numpy as np

from benchmarks.method.measure import collector_off
from benchmarks.method.report import against, caption, figure, table
from benchmarks.tracking.stream import fast, stream
from mvpose.tracking import Tracker, track

SIZES = ((5, 4), (10, 10), (31, 10))
TARGETS = {(5, 4): 0.1, (31, 10): 3.0}  # milliseconds beyond the pipeline
_LAG = 0.2  # seconds
_WARM = 10  # frames: the first ones compile, and everybody is new in them


@dataclass(frozen=True)
class Cost:
    """Median times of a frame at one size, milliseconds.

    Attributes:
        views: number of cameras.
        people: number of people.
        detections: median number of detections of a frame.
        frames: number of timed frames.
        alone: time of ``fast``.
        tracked: time of the tracker with the stages of ``fast``.
        beyond: median of the differences frame by frame.
        lagged: the same of the tracker with a lag of 0.2 s.
        target: limit of ``beyond``, or None.
    """

    views: int
    people: int
    detections: int
    frames: int
    alone: float
    tracked: float
    beyond: float
    lagged: float
    target: float | None


def measure(*, quick: bool = False) -> list[Cost]:
    """Time ``fast`` and the tracker at the sizes."""
    return [_cost(*size, frames=20 if quick else 400) for size in (SIZES[:1] if quick else SIZES)]


def _cost(views: int, people: int, frames: int) -> Cost:
    rig, detections = stream(views, people, stay=np.inf, phantoms=0.0)
    given = list(itertools.islice(detections, frames + _WARM))
    pipeline, tracker, times = fast(), Tracker(fast()), np.empty((len(given), 3))
    smoothed = track(Tracker(fast()), rig, itertools.chain(given, detections), lag=_LAG)
    with collector_off():
        for k, frame in enumerate(given):
            start = time.perf_counter()
            pipeline.estimate(rig, frame)
            middle = time.perf_counter()
            tracker.estimate(rig, frame)
            end = time.perf_counter()
            next(smoothed)
            times[k] = middle - start, end - middle, time.perf_counter() - end
    times = 1e3 * times[_WARM:-_WARM]  # the last of the smoothed frames are simulated within the call
    alone, tracked, _ = np.median(times, axis=0)
    return Cost(
        views=views,
        people=people,
        detections=int(np.median([len(frame) for frame in given])),
        frames=frames,
        alone=float(alone),
        tracked=float(tracked),
        beyond=float(np.median(times[:, 1] - times[:, 0])),
        lagged=float(np.median(times[:, 2] - times[:, 0])),
        target=TARGETS.get((views, people)),
    )


def table_of(costs: list[Cost]) -> str:
    """Format the rows as text."""
    rows = [["ms per frame, one core", "detections", "fast", "tracked", "beyond", "", "target", "with a lag"]]
    for cost in costs:
        rows.append(
            [
                f"{cost.views}×{cost.people}", str(cost.detections), figure(cost.alone), figure(cost.tracked),
                figure(cost.beyond), *against(cost.beyond, cost.target), figure(cost.lagged),
            ]
        )  # fmt: skip
    return table(rows, "<>>>>^>>") + caption(
        "Medians; those of the differences frame by frame for the time beyond, also with a lag of 0.2 s."
    )
