"""Time of both presets compared with published times and times of other code, at the same sizes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.method.curve import COSTS, PRESETS, Point, timed
from benchmarks.method.report import caption, figure, table

SIZES = ((3, 3), (5, 4), (5, 10), (10, 10), (31, 10))  # views, people

PAPER: Mapping[tuple[int, int], Mapping[str, float]] = {
    (5, 4): {"affinity": 25.0, "matching": 20.0, "reconstruction": 60.0}
}
"""Milliseconds per frame that Dong et al. (CVPR 2019, "Running time") report for Shelf, on an Intel i7 at 3.6 GHz with
a GeForce 1080 Ti; their affinity includes the re-ID network on the GPU."""

RELEASED = "released, matching + 3DPS"
"""Key of :data:`OTHERS` with which a whole frame is compared."""

OTHERS: Mapping[str, tuple[float, ...]] = {
    RELEASED: (8.4, 28.0, 75.0, 328.0, 5555.0),
    "released, matching": (2.4, 4.6, 16.0, 51.0, 582.0),
    "released, matching, constrained": (94.0, 526.0, 1133.0, 3785.0, 46000.0),
    "EasyMocap, matching, constrained": (0.35, 3.5, 21.0, 71.0, 1089.0),
}
"""Milliseconds per frame at :data:`SIZES` of other released code, without networks, each measured once on one core of a
2-core machine: zju3dv/mvpose, the code of the paper, and the matching of zju3dv/EasyMocap (C++).

"Constrained" matching limits row and column sums of P to 1, as the paper requires and as ADMM here always does; the
released code does not by default."""


@dataclass(frozen=True)
class Comparison:
    """Times at one size, milliseconds per frame.

    Attributes:
        ours: medians of both presets by stage.
        others: times of :data:`OTHERS`, by name.
        paper: times of :data:`PAPER`, by stage; None at other sizes.
    """

    ours: Point
    others: dict[str, float]
    paper: dict[str, float] | None


def measure(*, quick: bool = False) -> list[Comparison]:
    """Time both presets at :data:`SIZES`."""
    return [
        Comparison(timed(*size, share=0.5, quick=quick), others_at(size), dict(PAPER[size]) if size in PAPER else None)
        for size in (SIZES[:2] if quick else SIZES)
    ]


def others_at(size: tuple[int, int]) -> dict[str, float]:
    """Return the times of :data:`OTHERS` at one of :data:`SIZES`, by name."""
    return {name: figures[SIZES.index(size)] for name, figures in OTHERS.items()}


def table_of(rows: list[Comparison]) -> str:
    """Format the rows as text."""
    text = [["ms per frame", *(f"{row.ours.views}×{row.ours.people}" for row in rows)]]
    for preset in PRESETS:
        for cost in COSTS:
            name = preset if cost == COSTS[0] else f"  {cost}"
            text.append([name, *(figure(row.ours.ms[preset][cost]) for row in rows)])
    ours = len(text) - 1
    text += [[name, *(figure(row.others[name]) for row in rows)] for name in OTHERS]
    for stage in ("affinity", "matching", "reconstruction"):
        text.append([f"paper, {stage}", *(figure(row.paper[stage]) if row.paper else "" for row in rows)])
    return table(text, "<" + ">" * len(rows), rules=(0, ours, ours + len(OTHERS))) + caption(
        "views×people. Ours: medians on one core, without networks. Released code and EasyMocap: timed once, on one "
        "core of a 2-core machine, without networks; constrained: row and column sums of at most 1, which ADMM here "
        "always enforces. The affinity of the paper includes its re-ID network, on a GPU."
    )
