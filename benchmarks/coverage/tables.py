"""Simulations of each method, as tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.special import stdtrit

from benchmarks.coverage.populations import CHANGES, CURVES, EVENTS, MEANS
from simharness.statistics.breaking_points import BreakingPoint, breaking_point
from simharness.statistics.intervals import mean_interval
from simharness.statistics.paired_tests import paired, paired_counts

SCENES = (5, 10, 20, 40)
"""Numbers of scenes of a sample."""

_LEVEL = 0.05


def means(repetitions: int) -> str:
    """Return how often intervals hold the mean of scores, percent, and their median width relative to Student's."""
    rows = []
    for name, score in MEANS.items():
        cells = []
        for scenes in SCENES:
            samples = score.draw(np.random.default_rng(scenes), (repetitions, scenes))
            intervals = [mean_interval(each, unit=score.unit) for each in samples]
            student = 2 * stdtrit(scenes - 1, 0.975) * samples.std(axis=1, ddof=1) / np.sqrt(scenes)
            wider = np.array([each.high - each.low for each in intervals])[student > 0] / student[student > 0]
            held = _percent(each.low <= score.mean <= each.high for each in intervals)
            cells.append(f"{held}, {np.median(wider):.2f}")
        rows.append((name, score.unit, *cells))
    return _table(("score", "unit", *map(str, SCENES)), rows)


def differences(repetitions: int) -> str:
    """Return how often differences with mean zero are significantly below and above zero, percent."""
    rows = []
    for name, draw in CHANGES.items():
        cells = []
        for scenes in SCENES:
            samples = draw(np.random.default_rng(scenes), (repetitions, scenes))
            zeros = np.zeros(scenes)
            below = _percent(paired(zeros, each, alternative="less").p <= _LEVEL for each in samples)
            above = _percent(paired(zeros, each, alternative="greater").p <= _LEVEL for each in samples)
            cells.append(f"{below}, {above}")
        rows.append((name, *cells))
    return _table(("differences", *map(str, SCENES)), rows)


def counts(repetitions: int) -> str:
    """Return how often equal rates of events are found to have grown, percent."""
    rows = []
    for name, draw in EVENTS.items():
        cells = []
        for scenes in SCENES:
            pairs = zip(*draw(np.random.default_rng(scenes), (repetitions, scenes)), strict=True)
            cells.append(_percent(paired_counts(*each, alternative="greater").p <= _LEVEL for each in pairs))
        rows.append((name, *cells))
    return _table(("events", *map(str, SCENES)), rows)


def breaking_points(repetitions: int) -> str:
    """Return the true breaking point, the median of those found, how often intervals hold it, and their width."""
    rows = []
    for name, curve in CURVES.items():
        cells = []
        for scenes in SCENES:
            rng = np.random.default_rng(scenes)
            points = [
                breaking_point(curve.values, curve.draw(rng, scenes), curve.threshold, better="higher")
                for _ in range(repetitions)
            ]
            found = [_value(each, curve.values) for each in points]
            held = _percent(
                (each.low is None or each.low <= curve.breaks) and (each.high is None or each.high >= curve.breaks)
                for each in points
            )
            wide = [(curve.values[-1] if x.high is None else x.high) - (x.low or curve.values[0]) for x in points]
            cells.append(f"{np.median(found):.1f}, {held}, {np.median(wide):.1f}")
        rows.append((name, str(curve.breaks), *cells))
    return _table(("curve", "breaks at", *map(str, SCENES)), rows)


def _value(point: BreakingPoint, values: Sequence[float]) -> float:
    """Return a breaking point; the end of the values that it is beyond, where the mean does not cross."""
    if point.value is not None:
        return point.value
    return values[0] if point.why == "at once" else values[-1]


def _percent(true: Iterable[bool]) -> str:
    return f"{100 * np.mean(list(true)):.0f}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
