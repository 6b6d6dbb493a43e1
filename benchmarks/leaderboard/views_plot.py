"""Plot of PCP against the number of views, with a scale that separates methods near 100 %."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mvpose.report.svg_plots import VARIANT_COLORS, svg_plot
from simharness.outputs.study.plots import label_lines
from simharness.statistics.intervals import Interval

_SIZE = (4.8, 3.7)  # inches of 72 px
_TICKS = (0.0, 50.0, 70.0, 80.0, 90.0, 95.0, 98.0, 99.0, 99.5, 99.8, 99.9)
_LEAST_WRONG = 0.1  # percent of parts: higher PCP is drawn here, as the scale has no end
_APART = 0.045  # of lines at one number of views, to see their intervals
_DASHES = ("-", (0, (4, 1.6)), (0, (1.4, 1.4)))


def views_plot(
    name: str,
    lines: Mapping[str, Sequence[Interval]],
    views: Sequence[int],
    *,
    title: str,
    colors: Mapping[str, int],
    span: tuple[float, float],
) -> str:
    """Return the plot as an SVG element.

    Distances on the vertical axis are of the logarithm of the share of wrong parts, so that 99 and 99.5 % are as far
    apart as 80 and 90 %.

    Args:
        name: different from those of other plots of the page.
        lines: PCP of each method, with intervals over seeds, at the numbers of views.
        views: numbers of views.
        title: heading.
        colors: number of the colour and dash of each method, the same in all plots.
        span: lowest and highest PCP of the axis, the same in plots that stand side by side.
    """
    with svg_plot(name, size=_SIZE) as (axes, written):
        low, high = (_wrong(end) for end in span)
        axes.set_yscale("log")
        axes.set_ylim(low * 1.25, high / 1.3)
        ticks = [tick for tick in _TICKS if high / 1.3 <= _wrong(tick) <= low * 1.25]
        axes.set_yticks([_wrong(tick) for tick in ticks], [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        ends = []
        for index, (method, line) in enumerate(lines.items()):
            color = VARIANT_COLORS[colors[method] % len(VARIANT_COLORS)]
            dash = _DASHES[colors[method] // len(VARIANT_COLORS) % len(_DASHES)]
            at = np.array(views) + _APART * (index - (len(lines) - 1) / 2)
            mean, upper, lower = (
                np.array([_wrong(getattr(each, end)) for each in line]) for end in ("mean", "high", "low")
            )
            axes.vlines(at, upper, lower, color=color, lw=1.2, alpha=0.4, zorder=2)
            axes.plot(at, mean, "o", ls=dash, color=color, lw=1.5, ms=3.2, zorder=3)
            ends.append((method, color, float(at[-1]), float(mean[-1])))
        axes.set_xticks(list(views))
        axes.set(xlabel="cameras", ylabel="PCP, % (scale: log of wrong parts)")
        axes.grid(axis="y")
        axes.figure.suptitle(title, fontsize=10, fontweight="bold")
        label_lines(axes, ends)
    return written[0]


def _wrong(pcp: float) -> float:
    return max(100.0 - pcp, _LEAST_WRONG)
