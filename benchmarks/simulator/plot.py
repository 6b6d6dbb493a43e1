"""The running time of the method as a table and curves: ``python -m benchmarks.simulator.plot bench.json FOLDER``."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator

from benchmarks.method.curve import COSTS, PRESETS, Sweep
from benchmarks.method.published import RELEASED, Beside
from benchmarks.simulator.result import SWEPT, Result, read
from benchmarks.simulator.table import markdown
from simharness.report.figures.svg_plots import INK, STAGE_COLORS, Color, legend_above, plot_sheet, svg_plot
from simharness.runtime.atomic_files import write_whole

_SIZE = (4.5, 3.9)  # inches of 72 px
_RELEASED_COLOR, _PAPER_COLOR = "#d9643a", "#8a63c9"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write ``table.md`` and ``curves.svg`` into a folder; 2 where the figures cannot be read."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.simulator.plot", description="What python -m benchmarks.method measured."
    )
    parser.add_argument("result", type=Path, metavar="RESULT.json", help="of --only published reid curve --json")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where table.md and curves.svg go")
    options = parser.parse_args(arguments)
    try:
        result = read(options.result)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    write_whole(options.folder / "table.md", markdown(result).encode())
    write_whole(options.folder / "curves.svg", curves(result).encode())
    return 0


def curves(result: Result) -> str:
    """Milliseconds a frame of each stage against views and people, a row of plots a preset (SVG).

    Lines have ids ("views-full-matching"), and so have the figures of others: "views-full-released",
    "views-full-paper" and, of its CPU stages alone, "views-full-paper-without".
    """
    swept = [point for grows in SWEPT for point in result.sweep(grows).points]
    known = [point.ms[preset][cost] for point in swept for preset in PRESETS for cost in COSTS]
    known += [beside.others[RELEASED] for beside in result.published]
    span = 10 ** math.floor(math.log10(min(known))), 10 ** math.ceil(math.log10(max(known)))
    return plot_sheet(
        [[_plot(result.sweep(grows), result.published, preset, span) for grows in SWEPT] for preset in PRESETS[::-1]]
    )


def _plot(sweep: Sweep, others: Sequence[Beside], preset: str, span: tuple[float, float]) -> str:
    """One preset along one sweep."""
    name = f"{sweep.grows}-{preset}"
    fixed = "people" if sweep.grows == "views" else "views"
    (rest,) = {getattr(point, fixed) for point in sweep.points}
    with svg_plot(f"time-{name}", size=_SIZE) as (axes, written):
        sizes = [getattr(point, sweep.grows) for point in sweep.points]
        for cost in COSTS:
            whole = cost == "total"
            axes.plot(
                sizes, [point.ms[preset][cost] for point in sweep.points], "o-", gid=f"{name}-{cost}",
                color=INK if whole else STAGE_COLORS[cost], lw=2.0 if whole else 1.4, ms=4.0 if whole else 3.2,
                label="whole frame" if whole else cost, zorder=3 if whole else 4,
            )  # fmt: skip
        _released(axes, _nearest(others, sweep.grows, rest), sweep.grows, f"{name}-released")
        _paper(axes, others, sweep.grows, f"{name}-paper")
        axes.set(xscale="log", yscale="log", ylim=span, xlim=(min(sizes) / 1.15, max(sizes) * 1.15))
        axes.set(xlabel=f"{sweep.grows}, with {rest} {fixed}", ylabel=f"{preset}: ms a frame")
        axes.set_xticks(sizes, [f"{size}" for size in sizes])
        axes.yaxis.set_major_locator(LogLocator(numticks=12))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.minorticks_off()
        axes.grid(axis="y")
        legend_above(axes, columns=3)
    return written[0]


def _nearest(others: Sequence[Beside], grows: str, rest: int) -> list[Beside]:
    """Those that come nearest to a sweep: as many views; of as many views, the number of people nearest to its own."""
    if grows == "people":
        return [beside for beside in others if beside.ours.views == rest]
    best: dict[int, Beside] = {}
    for beside in sorted(others, key=lambda beside: abs(math.log(beside.ours.people / rest)), reverse=True):
        best[beside.ours.views] = beside
    return list(best.values())


def _released(axes: Axes, others: Sequence[Beside], grows: str, gid: str) -> None:
    """The released code, each point with its size."""
    places = [getattr(beside.ours, grows) for beside in others]
    times = [beside.others[RELEASED] for beside in others]
    axes.plot(places, times, "s", gid=gid, ms=4.6, color=_RELEASED_COLOR, label="released code")
    for beside, place, ms in zip(others, places, times, strict=True):
        _label(axes, f"{beside.ours.views} × {beside.ours.people}", (place, ms), _RELEASED_COLOR)


def _paper(axes: Axes, others: Sequence[Beside], grows: str, gid: str) -> None:
    """The paper's sum with its GPU stage, filled, and without, hollow."""
    for beside in others:
        if beside.paper:
            place, whole = getattr(beside.ours, grows), sum(beside.paper.values())
            without = whole - beside.paper["affinity"]
            axes.plot(place, whole, "D", gid=gid, ms=3.4, color=_PAPER_COLOR, label="paper")
            axes.plot(place, without, "D", gid=f"{gid}-without", ms=3.4, color=_PAPER_COLOR, mfc="none")
            told = f"with re-ID {whole:g}\nwithout {without:g}"
            _label(axes, told, (place, math.sqrt(whole * without)), _PAPER_COLOR)


def _label(axes: Axes, text: str, at: tuple[float, float], color: Color) -> None:
    axes.annotate(
        text, at, xytext=(-6, 0), textcoords="offset points", ha="right", va="center", color=color, fontsize=8
    )


if __name__ == "__main__":
    sys.exit(main())
