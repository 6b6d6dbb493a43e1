"""Plots of a validation, as SVG. Reality is drawn with solid lines, twins with dashed ones."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from mvpose.report.svg_plots import FAINT, INK, VARIANT_COLORS, Color, legend_above, svg_plot
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.variant_comparison import DoseResponse, SubsetComparison
from simharness.reality.validation.verdicts import BOUNDS

REAL_COLOR: Color = "#8b93a1"
TWIN_COLOR: Color = "#3b82c4"

_SQUARE = (4.9, 4.6)
_SMALL = (3.6, 2.6)
_BAND = 0.10  # opacity of accepted ranges
_DASHED = (0, (4, 2))


def colors(variants: Sequence[str]) -> dict[str, Color]:
    """Return the colour of each variant."""
    return {name: VARIANT_COLORS[index % len(VARIANT_COLORS)] for index, name in enumerate(variants)}


def agreement(points: Mapping[str, Mapping[str, Sequence[tuple[float, float]]]], variants: Mapping[str, Color]) -> str:
    """Plot predicted against measured PCP: everything that was scored, with the identity and the accepted range.

    Args:
        points: (real, twin) PCP, percent, by kind of setting and variant.
        variants: colour of each variant.
    """
    markers = ("o", "s", "D", "^", "v", "P", "X", "<")
    everything = np.array([pair for of in points.values() for each in of.values() for pair in each]).reshape(-1, 2)
    with svg_plot("agreement", size=_SQUARE) as (axes, written):
        low = max(0.0, 5 * np.floor(np.nanmin(everything, initial=95.0) / 5 - 0.2))
        ends = np.array([low, 101.0])
        axes.fill_between(ends, ends - BOUNDS.subset, ends + BOUNDS.subset, color=FAINT, alpha=_BAND, lw=0, zorder=1)
        axes.plot(ends, ends, color=FAINT, lw=0.9, zorder=2)
        for marker, of in zip(markers, points.values(), strict=False):
            for variant, pairs in of.items():
                real, twin = np.array(pairs).reshape(-1, 2).T
                axes.plot(real, twin, marker, color=variants[variant], ms=4.4, alpha=0.62, mew=0, zorder=3, ls="")
        kinds = [
            Line2D([], [], marker=marker, color=FAINT, ls="", ms=4.4, label=kind)
            for marker, kind in zip(markers, points, strict=False)
        ]
        shades = [Line2D([], [], marker="o", color=color, ls="", ms=5, label=each) for each, color in variants.items()]
        first = axes.legend(handles=shades, loc="upper left", labelcolor=INK, handlelength=1.0)
        axes.add_artist(first)
        axes.legend(handles=kinds, loc="lower right", labelcolor=INK, handlelength=1.0)
        axes.set(xlabel="PCP measured, %", ylabel="PCP predicted by simulation, %", xlim=ends, ylim=ends)
        axes.set_aspect("equal")
        axes.grid()
    return written[0]


def losses(responses: Sequence[DoseResponse], variants: Mapping[str, Color]) -> str:
    """Plot the predicted against the measured loss of PCP of every treatment, with the accepted range."""
    markers = dict(zip(KINDS, ("o", "s", "D", "^", "v", "P"), strict=True))
    with svg_plot("losses", size=_SQUARE) as (axes, written):
        values = np.array([[each.loss.real.mean, each.loss.twin.mean] for each in responses]).reshape(-1, 2)
        low, high = np.nanmin(values, initial=-2.0) - 1, 1.06 * np.nanmax(values, initial=10.0)
        grid = np.linspace(low, high, 200)
        limit = np.array([BOUNDS.loss_of(each) for each in grid])
        axes.fill_between(grid, grid - limit, grid + limit, color=FAINT, alpha=_BAND, lw=0, zorder=1)
        axes.plot(grid, grid, color=FAINT, lw=0.9, zorder=2)
        for each in responses:
            real, twin = each.loss.real, each.loss.twin
            color = variants[each.variant]
            axes.plot([real.low, real.high], [twin.mean] * 2, color=color, lw=0.8, alpha=0.35, zorder=2)
            axes.plot([real.mean] * 2, [twin.low, twin.high], color=color, lw=0.8, alpha=0.35, zorder=2)
            axes.plot(real.mean, twin.mean, markers[each.kind], color=color, ms=4.6, alpha=0.8, mew=0, zorder=3)
        handles = [
            Line2D([], [], marker=markers[kind], color=FAINT, ls="", ms=4.6, label=KINDS[kind].title)
            for kind in dict.fromkeys(each.kind for each in responses)
        ]
        axes.legend(handles=handles, loc="lower right", labelcolor=INK, handlelength=1.0)
        axes.set(xlabel="loss of PCP measured, points", ylabel="loss predicted by simulation, points")
        axes.set(xlim=(low, high), ylim=(low, high))
        axes.set_aspect("equal")
        axes.grid()
    return written[0]


def subset_curve(subsets: SubsetComparison, variant: str, color: Color, *, name: str, low: float) -> str:
    """Plot the PCP of a variant against the number of cameras, with intervals."""
    counts = list(subsets.curves)
    with svg_plot(name, size=_SMALL) as (axes, written):
        _compared_line(axes, counts, [each[variant] for each in subsets.curves.values()], color)
        axes.set(xlabel="cameras", ylabel="PCP, %", ylim=(low, 101), xticks=counts)
        axes.grid(axis="y")
        legend_above(axes, columns=2)
    return written[0]


def response(responses: Sequence[DoseResponse], variants: Mapping[str, Color], *, name: str) -> str:
    """Plot the loss of PCP against the level of one kind of treatment, for each variant."""
    kind = KINDS[responses[0].kind]
    with svg_plot(name, size=_SMALL) as (axes, written):
        for index, (variant, color) in enumerate(variants.items()):
            chosen = [each for each in responses if each.variant == variant]
            levels = [each.level for each in chosen]
            under = 0.7 * (len(variants) - 1 - index)  # points: lines that coincide stay visible
            _compared_line(axes, levels, [each.loss for each in chosen], color, label=False, shade=0.08, under=under)
        unit = "%" if kind.unit == "share" else kind.unit
        scale = 100 if kind.unit == "share" else 1
        levels = sorted({each.level for each in responses})
        axes.set_xticks(levels, [f"{scale * level:g}" for level in levels])
        axes.set(xlabel=unit, ylabel="loss of PCP, points")
        axes.set_xlim(0, None)
        axes.grid(axis="y")
    return written[0]


def part_differences(parts: Mapping[str, Mapping[str, Compared]], variants: Mapping[str, Color]) -> str:
    """Plot simulated less measured PCP of each part of the body and variant, with intervals and the accepted range."""
    groups = list(next(iter(parts.values())))
    with svg_plot("parts", size=(4.9, 0.9 + 0.5 * len(groups))) as (axes, written):
        axes.axvspan(-BOUNDS.parts, BOUNDS.parts, color=FAINT, alpha=_BAND, lw=0, zorder=1)
        for index, (variant, color) in enumerate(variants.items()):
            figures = [parts[variant][group] for group in groups]
            rows = np.arange(len(groups)) + 0.7 * ((index + 0.5) / len(variants) - 0.5)
            ends = np.array([each.difference + np.array([-1, 1]) * each.uncertainty for each in figures])
            axes.hlines(rows, *ends.T, color=color, lw=1.4, alpha=0.5, zorder=2)
            axes.plot([each.difference for each in figures], rows, "o", color=color, ms=4.4, label=variant, zorder=3)
        axes.set_yticks(np.arange(len(groups)), [group.replace("_", " ") for group in groups])
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.set(xlabel="PCP, simulated − measured, points")
        axes.invert_yaxis()
        axes.grid(axis="x")
        legend_above(axes, columns=4)
    return written[0]


def ratios(figures: Mapping[str, tuple[Compared, tuple[float, float] | None]]) -> str:
    """Plot simulated over measured for many measurements, with intervals and accepted ranges.

    Args:
        figures: figure by title, and the least and greatest accepted ratio, where there is one.
    """
    with svg_plot("ratios", size=(4.9, 0.9 + 0.24 * len(figures))) as (axes, written):
        axes.axvline(1.0, color=FAINT, lw=0.9, zorder=1)
        for row, (figure, accepted) in enumerate(figures.values()):
            real = figure.real.mean
            down, up = figure.uncertainty
            if accepted is not None:
                axes.barh(row, accepted[1] - accepted[0], left=accepted[0], height=0.8, color=FAINT, alpha=_BAND, lw=0)
            ends = np.array([figure.twin.mean - down, figure.twin.mean, figure.twin.mean + up]) / real
            low, ratio, high = np.clip(ends, *_RATIO_AXIS)
            axes.hlines(row, low, high, color=TWIN_COLOR, lw=1.6, alpha=0.5, zorder=2)
            beyond = not _RATIO_AXIS[0] < ends[1] < _RATIO_AXIS[1]
            axes.plot(ratio, row, (">" if ends[1] > 1 else "<") if beyond else "o", color=TWIN_COLOR, ms=5, zorder=3)
        axes.set_xscale("log")
        axes.set_xlim(*_RATIO_AXIS)
        axes.xaxis.set_major_locator(FixedLocator([0.25, 0.5, 0.75, 1, 1.33, 2, 4]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
        axes.set_yticks(np.arange(len(figures)), list(figures))
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.set(xlabel="simulated over measured")
        axes.invert_yaxis()
        axes.grid(axis="x")
    return written[0]


_RATIO_AXIS = (0.2, 5.0)


def _compared_line(
    axes: Axes,
    places: Sequence[float],
    figures: Sequence[Compared],
    color: Color,
    *,
    label: bool = True,
    shade: float = 0.16,
    under: float = 0.0,
) -> None:
    """Draw the line of reality, solid with its interval, and that of twins, dashed with theirs."""
    for side, style, title in (("real", "-", "measured"), ("twin", _DASHED, "simulated")):
        mean, low, high = (np.array([getattr(getattr(each, side), end) for each in figures]) for end in _ENDS)
        shown = REAL_COLOR if label and side == "real" else color
        axes.fill_between(places, low, high, color=shown, alpha=shade, lw=0, zorder=2)
        axes.plot(places, mean, color=shown, ls=style, lw=1.5 + under, label=title if label else None, zorder=3)
        axes.plot(places, mean, "o" if side == "real" else "D", color=shown, ms=3.4 + under, zorder=4, clip_on=False)


_ENDS = ("mean", "low", "high")
