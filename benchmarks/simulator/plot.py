"""Plot of the running time of the method, and a table: ``python -m benchmarks.simulator.plot bench.json FOLDER``."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator

from benchmarks.method.curve import COSTS, PRESETS, Sweep
from benchmarks.method.published import RELEASED, Comparison
from benchmarks.simulator.result import SWEPT, Result, read
from benchmarks.simulator.table import markdown
from mvpose.files.atomic_files import write_atomic
from mvpose.report.svg_plots import INK, STAGE_COLORS, Color, legend_above, plot_sheet, svg_plot

_SIZE = (4.5, 3.9)  # inches of 72 px
_RELEASED_COLOR, _PAPER_COLOR = "#d9643a", "#8a63c9"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write ``table.md`` and ``curves.svg`` to a folder; return 2 if the result cannot be read."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.simulator.plot", description="Plot the results of python -m benchmarks.method."
    )
    parser.add_argument(
        "result",
        type=Path,
        metavar="RESULT.json",
        help="result of python -m benchmarks.method --only published reid curve --json RESULT.json",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="output folder of table.md and curves.svg")
    options = parser.parse_args(arguments)
    try:
        result = read(options.result)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    options.folder.mkdir(parents=True, exist_ok=True)
    write_atomic(options.folder / "table.md", markdown(result).encode())
    write_atomic(options.folder / "curves.svg", curves(result).encode())
    return 0


def curves(result: Result) -> str:
    """Plot milliseconds per frame of each stage against views and people, one row of plots per preset (SVG).

    Lines have ids such as "views-full-matching". The ids of other times are "views-full-released", "views-full-paper"
    and, for the CPU stages of the paper only, "views-full-paper-without".
    """
    swept = [point for grows in SWEPT for point in result.sweep(grows).points]
    known = [point.ms[preset][cost] for point in swept for preset in PRESETS for cost in COSTS]
    known += [comparison.others[RELEASED] for comparison in result.published]
    span = 10 ** math.floor(math.log10(min(known))), 10 ** math.ceil(math.log10(max(known)))
    return plot_sheet(
        [[_plot(result.sweep(grows), result.published, preset, span) for grows in SWEPT] for preset in PRESETS[::-1]]
    )


def _plot(sweep: Sweep, others: Sequence[Comparison], preset: str, span: tuple[float, float]) -> str:
    """Plot one preset along one sweep."""
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
        axes.set(xlabel=f"{sweep.grows}, with {rest} {fixed}", ylabel=f"{preset}: ms per frame")
        axes.set_xticks(sizes, [f"{size}" for size in sizes])
        axes.yaxis.set_major_locator(LogLocator(numticks=12))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.minorticks_off()
        axes.grid(axis="y")
        legend_above(axes, columns=3)
    return written[0]


def _nearest(others: Sequence[Comparison], grows: str, rest: int) -> list[Comparison]:
    """Select the comparisons nearest to a sweep: equal views, and for each number of views the nearest people."""
    if grows == "people":
        return [comparison for comparison in others if comparison.ours.views == rest]
    best: dict[int, Comparison] = {}
    for comparison in sorted(others, key=lambda comparison: abs(math.log(comparison.ours.people / rest)), reverse=True):
        best[comparison.ours.views] = comparison
    return list(best.values())


def _released(axes: Axes, others: Sequence[Comparison], grows: str, gid: str) -> None:
    """Plot the times of the released code, each point labelled with its size."""
    places = [getattr(comparison.ours, grows) for comparison in others]
    times = [comparison.others[RELEASED] for comparison in others]
    axes.plot(places, times, "s", gid=gid, ms=4.6, color=_RELEASED_COLOR, label="released code")
    for comparison, place, ms in zip(others, places, times, strict=True):
        _label(axes, f"{comparison.ours.views} × {comparison.ours.people}", (place, ms), _RELEASED_COLOR)


def _paper(axes: Axes, others: Sequence[Comparison], grows: str, gid: str) -> None:
    """Plot the total of the paper with its GPU stage (filled marker) and without (hollow marker)."""
    for comparison in others:
        if comparison.paper:
            place, whole = getattr(comparison.ours, grows), sum(comparison.paper.values())
            without = whole - comparison.paper["affinity"]
            axes.plot(place, whole, "D", gid=gid, ms=3.4, color=_PAPER_COLOR, label="paper")
            axes.plot(place, without, "D", gid=f"{gid}-without", ms=3.4, color=_PAPER_COLOR, mfc="none")
            text = f"with re-ID {whole:g}\nwithout {without:g}"
            _label(axes, text, (place, math.sqrt(whole * without)), _PAPER_COLOR)


def _label(axes: Axes, text: str, at: tuple[float, float], color: Color) -> None:
    axes.annotate(
        text, at, xytext=(-6, 0), textcoords="offset points", ha="right", va="center", color=color, fontsize=8
    )


if __name__ == "__main__":
    sys.exit(main())
