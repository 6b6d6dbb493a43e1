"""Losses of pictures on real Shelf: which they are, and the tracker beside its bounds.

The method without memory (``full``) gets the same pictures; its people are linked from frame to frame by distance, so
that it has identities to compare.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.method.report import MET, MISSED, caption, table
from benchmarks.tracking.trajectories import link, second_differences, short_ghosts
from mvpose import Detections, Estimate, Pipeline, preset
from mvpose.arrays import Bools
from mvpose.tracking import Tracker, track
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.evaluation import score_estimates
from simharness.reality.recording_file import read_recording

_DRAWS = 5  # of the pictures that are lost at random
_SHORT_GHOSTS = 0.05  # in a frame, bound where all pictures are there
_TRACKERS = {"track": "full", "track-fast": "fast"}  # stages of one frame
_TITLES = ["full", "track, lag", "track", "track-fast, lag", "track-fast"]


_CYCLE, _DARK_FROM = 3.0, 2.0  # seconds: cycle of black pictures, and the time in it from which all cameras are black


@dataclass(frozen=True)
class Figures:
    """Figures of one method at one loss, over the draws of lost pictures.

    Attributes:
        loss: name of the loss.
        method: ``full``, ``track`` or ``track-fast``.
        lag: lag, seconds.
        draws: number of draws.
        pcp: mean PCP of actors 1 to 3.
        worst_pcp: least PCP of a draw.
        least_pcp: lower bound of PCP, or None.
        switches: most identity switches of actors 1 to 4 in a draw.
        most_switches: upper bound of the switches, or None.
        short_ghosts: estimates in a frame that are none of the actors, and whose track lives under five frames.
        median_mm: median of the second differences of the joints, mm.
        high_mm: their 95th percentile, mm.
    """

    loss: str
    method: str
    lag: float
    draws: int
    pcp: float
    worst_pcp: float
    least_pcp: float | None
    switches: int
    most_switches: int | None
    short_ghosts: float
    median_mm: float
    high_mm: float


class Shelf:
    """Losses of pictures on real Shelf, the recording in this folder, beside the bounds.

    Args:
        folder: folder of Shelf's calibration, truth and detections, as ``simharness evaluate shelf`` takes it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def measure(self, *, quick: bool = False) -> list[Figures]:
        """Run all methods on what each loss leaves of the recording."""
        recording, losses, draws = read_recording("shelf", self.folder), LOSSES, _DRAWS
        if quick:
            recording, losses, draws = recording.during(np.arange(50)), LOSSES[:2], 1
        return [row for loss in losses for row in _at(loss, recording, draws if loss.chance else 1)]

    def table_of(self, rows: list[Figures]) -> str:
        """Format the rows as text."""
        lines, rules = [["Shelf, 300 frames", "", "bound: lag", "none", *_TITLES]], []
        for loss in dict.fromkeys(row.loss for row in rows):
            cells = [row for row in rows if row.loss == loss]
            rules.append(len(lines) - 1)
            lines += _lines(cells)
        return table(lines, "<<>>" + ">" * len(_TITLES), rules=rules) + caption(
            "PCP of actors 1 to 3: mean over the draws of lost pictures, and in brackets the worst draw, which the "
            "marks judge; switches of actors 1 to 4, the most in a draw. `full` is linked by distance. The lag is "
            "0.2 s, and 1.5 s where all cameras are black at once. Ghosts: estimates in a frame that are no actor and "
            "whose track lives under five frames."
        )


def _lines(cells: Sequence[Figures]) -> list[list[str]]:
    """Return the lines of one loss, from the figures of the methods in the order of the columns."""
    full, lagged, at_once, _, _ = cells
    pcp, switches, most = [], [], _asked("≤", lagged.most_switches)
    for each in cells:
        value = f"{each.pcp:.1f} ({each.worst_pcp:.1f})" if each.draws > 1 else f"{each.pcp:.1f}"
        pcp.append(value + _mark(-each.worst_pcp, None if each.least_pcp is None else -each.least_pcp))
        switches.append(f"{each.switches}{_mark(each.switches, each.most_switches)}")
    lines = [
        [full.loss, "PCP", _asked("≥", lagged.least_pcp), _asked("≥", at_once.least_pcp), *pcp],
        ["", "switches", most, most, *switches],
    ]
    if full.loss == LOSSES[0].name:
        for title, name, limit in (
            ("ghosts under 5 frames", "short_ghosts", _SHORT_GHOSTS),
            ("second difference, mm", "median_mm", full.median_mm / 3.0),
            ("its 95th percentile, mm", "high_mm", full.high_mm / 3.0),
        ):
            values = [getattr(each, name) for each in cells]
            marks = ["", *(_mark(value, limit) for value in values[1:])]
            shown = [f"{value:.3g}{mark}" for value, mark in zip(values, marks, strict=True)]
            lines.append(["", title, _asked("≤", limit), _asked("≤", limit), *shown])
    return lines


def _asked(sign: str, value: float | None) -> str:
    return "" if value is None else f"{sign} {value:.3g}"


def _mark(value: float, most: float | None) -> str:
    """Return whether a value meets the limit that it should not exceed; nothing without a limit."""
    return "" if most is None else f" {MET if value <= most + 1e-9 else MISSED}"


def _at(loss: Loss, recording: AnnotatedRecording, draws: int) -> Iterator[Figures]:
    """Yield the figures of all methods at one loss, in the order of the columns."""
    left = [loss.of(recording, draw) for draw in range(draws)]
    pipeline = _pipeline("full")
    linked = [link([pipeline.estimate(each.rig, detections) for detections in each.detections]) for each in left]
    full = _figures(loss, "full", 0.0, left, linked, None)
    yield full
    equal = None if loss.below_full is None else full.pcp - loss.below_full
    for method, stages in _TRACKERS.items():
        for lag, bound in ((loss.lag, loss.pcp), (0.0, loss.pcp_at_once)):
            runs = [list(track(Tracker(_pipeline(stages)), each.rig, each.detections, lag=lag)) for each in left]
            yield _figures(loss, method, lag, left, runs, equal if bound is None else bound)


def _pipeline(name: str) -> Pipeline:
    pipeline = preset(name)
    assert isinstance(pipeline, Pipeline)
    return pipeline


def _figures(
    loss: Loss,
    method: str,
    lag: float,
    recordings: Sequence[AnnotatedRecording],
    runs: Sequence[Sequence[Estimate]],
    least_pcp: float | None,
) -> Figures:
    pcp, switches, ghosts, differences = [], [], [], []
    for recording, estimates in zip(recordings, runs, strict=True):
        scores = score_estimates(recording, {method: estimates}).summary()["variants"][method]
        pcp.append(scores["pcp"])
        switches.append(scores["tracking"]["mean_joint"]["0.5"]["id_switches"])
        ghosts.append(short_ghosts(recording.truth, estimates))
        differences.append(second_differences(estimates))
    values = 1e3 * np.concatenate(differences)
    return Figures(
        loss=loss.name,
        method=method,
        lag=lag,
        draws=len(runs),
        pcp=float(np.mean(pcp)),
        worst_pcp=float(np.min(pcp)),
        least_pcp=least_pcp,
        switches=int(max(switches)),
        most_switches=None if method == "full" else loss.switches,
        short_ghosts=float(np.mean(ghosts)),
        median_mm=float(np.median(values)),
        high_mm=float(np.percentile(values, 95)),
    )


@dataclass(frozen=True)
class Loss:
    """What is lost of a recording, and the bounds of the tracker then.

    Attributes:
        name: name in the table.
        chance: probability that a picture is lost.
        views: cameras that are left; None for all.
        step: every how many frames one is left.
        black: whether all cameras are black for one second in every three.
        lag: lag of the smoother, seconds.
        pcp: least PCP with the lag; None without a bound.
        pcp_at_once: the same without a lag.
        below_full: PCP by which the tracker may be below ``full`` on the same frames; None without a bound.
        switches: most identity switches.
    """

    name: str
    chance: float = 0.0
    views: tuple[int, ...] | None = None
    step: int = 1
    black: bool = False
    lag: float = 0.2
    pcp: float | None = None
    pcp_at_once: float | None = None
    below_full: float | None = None
    switches: int = 0

    def of(self, recording: AnnotatedRecording, draw: int) -> AnnotatedRecording:
        """Return what is left of a recording; its first pictures are always there, so that all methods start alike."""
        if self.views is not None:
            recording = recording.subset(self.views)
        recording = recording.during(np.arange(0, len(recording), self.step))
        rng, frames = np.random.default_rng(draw), []
        for k, (detections, time) in enumerate(zip(recording.timed_detections, recording.time, strict=True)):
            gone = rng.random(len(recording.rig)) < self.chance
            gone |= self.black and (time - recording.time[0]) % _CYCLE >= _DARK_FROM
            frames.append(without(detections, gone & (k > 0)))
        return replace(recording, detections=tuple(frames))


LOSSES: tuple[Loss, ...] = (
    Loss("all pictures", below_full=0.0),
    Loss("28 % lost", chance=0.28, pcp=96.5, pcp_at_once=95.5),
    Loss("50 % lost", chance=0.5, pcp=94.0, pcp_at_once=91.0),
    Loss("cameras 0 1 2, 28 % lost", chance=0.28, views=(0, 1, 2), pcp=90.0, pcp_at_once=86.0),
    Loss("black 1 s in every 3", black=True, lag=1.5, pcp=88.0, switches=1),
    Loss("cameras 0 and 4", views=(0, 4), pcp=76.0, pcp_at_once=76.0, switches=1),
    Loss("5 Hz", step=5, below_full=0.5),
    Loss("2 Hz", step=12, below_full=0.5),
)
"""Losses on Shelf, 300 frames at 25 Hz."""


def without(detections: Detections, gone: Bools) -> Detections:
    """Return the detections without the pictures of some cameras, (V,).

    Raises:
        ValueError: detections without the times of their pictures.
    """
    if detections.time is None:
        raise ValueError("detections need the time of each camera's picture, so that one can be lost: give time (V,)")
    return replace(detections.select(~gone[detections.view]), time=np.where(gone, np.nan, detections.time))
