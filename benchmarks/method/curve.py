"""Time against the number of views and people, and its exponent."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.method.measure import exponent, interleaved
from benchmarks.method.report import bar, caption, figure, table
from benchmarks.method.scenes import STAGES, estimating, frames, prepare

PRESETS = ("fast", "full")
_BAR = 7  # columns
COSTS = ("total", *STAGES)
SWEEPS: dict[str, tuple[tuple[int, int], ...]] = {
    "views": tuple((views, 5) for views in (2, 3, 5, 8, 12, 20, 31)),
    "people": tuple((5, people) for people in (1, 2, 4, 8, 16, 30)),
    "detections": ((2, 1), (3, 2), (5, 4), (8, 8), (12, 12), (20, 20), (31, 30)),
}


@dataclass(frozen=True)
class Point:
    """Milliseconds by preset and stage at one size; in a curve the first quartile of the calls."""

    views: int
    people: int
    detections: int
    ms: dict[str, dict[str, float]]


@dataclass(frozen=True)
class Sweep:
    """Times along one sweep.

    Attributes:
        grows: swept quantity, "views", "people", or "detections" if both are swept.
        points: times at each size.
        exponents: exponents by preset and stage.
    """

    grows: str
    points: list[Point]
    exponents: dict[str, dict[str, float]]


def measure(*, quick: bool = False) -> list[Sweep]:
    """Time both presets along the three sweeps."""
    return [_sweep(grows, sizes[:4] if quick else sizes, quick) for grows, sizes in SWEEPS.items()]


def _sweep(grows: str, sizes: tuple[tuple[int, int], ...], quick: bool) -> Sweep:
    points = [timed(views, people, quick=quick) for views, people in sizes]
    size = [getattr(point, grows) for point in points]
    exponents = {
        preset: {cost: exponent(size, [point.ms[preset][cost] for point in points]) for cost in COSTS}
        for preset in PRESETS
    }
    return Sweep(grows, points, exponents)


def timed(views: int, people: int, *, share: float = 0.25, quick: bool = False) -> Point:
    """Time both presets at one size.

    Args:
        views: number of cameras.
        people: number of people.
        share: quantile of the calls that is reported, 0 to 1.
        quick: whether to make few calls on few frames.
    """
    cases = prepare(frames(views, people, 3 if quick else 10))
    samples = interleaved(
        {preset: estimating(preset) for preset in PRESETS}, cases, calls=3 if quick else 100, seconds=2.0
    )
    ms = {
        preset: {"total": sample.quantile(share), **{stage: sample.noted(stage, share) for stage in STAGES}}
        for preset, sample in samples.items()
    }
    return Point(views, people, sorted(len(case.scene.detections) for case in cases)[len(cases) // 2], ms)


def table_of(sweeps: list[Sweep]) -> str:
    """Format the sweeps as text, one below the other."""
    totals = [point.ms[preset]["total"] for sweep in sweeps for point in sweep.points for preset in PRESETS]
    scale = min(totals) / 1.5, max(totals)
    rows: list[list[str]] = []
    rules: list[int] = []
    for sweep in sweeps:
        rows.append([f"by {sweep.grows}", "m"])
        for preset in PRESETS:
            rows[-1] += [preset, "aff.", "match", "rec.", ""]
        rules.append(len(rows) - 1)
        for point in sweep.points:
            rows.append([f"{point.views}×{point.people}", str(point.detections)])
            for preset in PRESETS:
                cells = [figure(point.ms[preset][cost]) for cost in COSTS]
                rows[-1] += [*cells, bar(point.ms[preset]["total"], *scale, width=_BAR)]
        rules.append(len(rows) - 1)
        rows.append(["exponent", ""])
        for preset in PRESETS:
            rows[-1] += [*(f"{sweep.exponents[preset][cost]:.2f}" for cost in COSTS), ""]
        rows.append([""] * len(rows[-1]))
    return table(rows[:-1], "<>" + ">>>><" * len(PRESETS), rules=rules) + caption(
        "ms per frame and per stage (affinity, matching, reconstruction): first quartile of the calls, which depends "
        "less on other load on the machine than the median. views×people; m detections. Bars are logarithmic, all on "
        "one scale. Exponents: least squares of log time over log size (views, people, or m) on the larger half of "
        "the sizes."
    )
