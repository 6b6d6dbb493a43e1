"""Plots of a study, as SVG."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from mvpose.arrays import Floats
from mvpose.report.svg_plots import FAINT, INK, LINE, VARIANT_COLORS, Color, svg_plot
from simharness.outputs.study.curves import axis_label
from simharness.runtime.number_text import fixed, short
from simharness.scoring.catalogue import ScoreInfo
from simharness.statistics.intervals import Interval

_SIZE = (4.5, 3.0)  # inches of 72 px: the width of a phone
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
_BARS_FROM = 3  # lines from which on intervals are bars: areas of three are one grey area
_APART = 0.012  # distance of variants at one value, as a share of the axis
_NAME_HEIGHT = 0.075  # of the name of a line, as a share of the axis
_ROOM = 0.6  # of the span of the means, for intervals beyond them
_LEAST_SPAN = 0.04  # of the means, as a share of all percent or of the largest mean
_WIDE_RANGE = 30.0  # from this ratio of the largest value to the smallest on, the axis is logarithmic
_MAX_LISTED = 6  # values of a key in a note on a mean
_LINE, _LINE_HEIGHT = 62, 0.15  # letters in a line below an axis, and its height in inches
_LETTER = 0.025  # width of a letter of a label, and gap between two labels, as a share of the axis
_DARK = 0.55  # luma of a cell below which its number is white


def curve(
    name: str,
    *,
    factor: str,
    values: Sequence[Any],
    numeric: bool,
    lines: Mapping[str, Sequence[Interval]],
    score: ScoreInfo,
    threshold: float | None = None,
    title: str = "",
    notes: Sequence[str] = (),
    beside: Sequence[Sequence[Interval]] = (),
) -> str:
    """Plot a score against the values of a factor: a line with intervals for each variant.

    Args:
        name: different from the name of every other plot on the page.
        factor: swept key; the axis label has its name and unit as well.
        values: k values of the factor.
        numeric: whether the values are numbers.
        lines: k means of each variant.
        score: score on the vertical axis.
        threshold: threshold of a breaking point, drawn as a dashed line.
        title: heading above the plot.
        notes: notes below the axis, wrapped.
        beside: lines of the plots that stand beside this one; the vertical axis has room for them as well.
    """
    label = axis_label(factor) if axis_label(factor).startswith(factor) else f"{axis_label(factor)} ({factor})"
    below = [line for each in (label, *notes) for line in textwrap.wrap(each, _LINE, break_long_words=False)]
    height = _SIZE[1] + _LINE_HEIGHT * (len(below) - 1 + 1.5 * bool(title))
    with svg_plot(name, size=(_SIZE[0], height)) as (axes, written):
        places = np.array(values, float) if numeric else np.arange(len(values), dtype=float)
        _ticks(axes, values, places, numeric)
        _limits(axes, [*lines.values(), *beside], score, threshold)
        if threshold is not None:
            axes.axhline(threshold, color=FAINT, lw=0.9, ls=(0, (4, 3)), zorder=1)
        ends = []
        for index, (variant, intervals) in enumerate(lines.items()):
            color, dashes = VARIANT_COLORS[index % len(VARIANT_COLORS)], _DASHES[index % len(_DASHES)]
            mean, low, high = (np.array([getattr(each, end) for each in intervals]) for end in ("mean", "low", "high"))
            at = _beside_each_other(axes, places, index, len(lines), numeric)
            if numeric and len(lines) < _BARS_FROM:
                axes.fill_between(at, low, high, color=color, alpha=0.16, lw=0, zorder=2)
            else:
                axes.vlines(at, low, high, color=color, lw=1.4, alpha=0.5, zorder=3)
            axes.plot(
                at, mean, "o", ls=dashes if numeric else "none", color=color, lw=1.7, ms=4.0, zorder=4, clip_on=False
            )
            _mark_cut_ends(axes, at, low, high, color)
            known = np.flatnonzero(np.isfinite(mean))
            if len(known):
                ends.append((variant, color, float(at[known[-1]]), float(mean[known[-1]])))
        if len(lines) > 1:
            label_lines(axes, ends)
        axes.set(xlabel="\n".join(below), ylabel=f"{score.title}, {score.unit}" if score.unit else score.title)
        if title:
            axes.figure.suptitle(title, fontsize=10, fontweight="bold")
        axes.grid(axis="y")
    return written[0]


def _mark_cut_ends(axes: Axes, at: Floats, low: Floats, high: Floats, color: Color) -> None:
    """Mark intervals that go on beyond the axis with a small arrow at its end."""
    bottom, top = axes.get_ylim()
    for cut, place, mark in ((low < bottom, bottom, "v"), (high > top, top, "^")):
        if cut.any():
            axes.plot(at[cut], np.full(cut.sum(), place), mark, color=color, ms=4.0, mew=0, zorder=5, clip_on=False)


def _beside_each_other(axes: Axes, places: Floats, index: int, count: int, numeric: bool) -> Floats:
    """Return the places of one of several variants: a little apart, so that variants that coincide stay visible."""
    if not numeric:
        return places + min(0.16, 0.6 / max(1, count)) * (index - (count - 1) / 2)
    apart = _APART * (index - (count - 1) / 2)
    if axes.get_xscale() == "log":
        return places * (places.max() / places.min()) ** apart
    return places + apart * (np.ptp(places) or 1.0)


def label_lines(axes: Axes, ends: Sequence[tuple[str, Color, float, float]]) -> None:
    """Write the name of each line behind its end, with a thin line to it; names do not overlap.

    Args:
        axes: plot with its final limits.
        ends: name, colour, and last point of each line.
    """
    heights = (axes.transScale + axes.transLimits).transform(np.reshape([end[-2:] for end in ends], (-1, 2)))[:, 1]
    for (name, color, x, y), height in zip(ends, spread_apart(heights, _NAME_HEIGHT), strict=True):
        axes.annotate(
            name,
            (x, y),
            xytext=(1.045, height),
            textcoords="axes fraction",
            va="center",
            fontsize=8.5,
            color=color,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": color, "lw": 0.7, "alpha": 0.7, "shrinkA": 1, "shrinkB": 3},
        )


def spread_apart(places: Floats, least: float) -> Floats:
    """Return places, (n,) from 0 to 1, at least ``least`` apart, in the same order and near where they were.

    Groups that are too near to each other are spread evenly about their middle, and moved inside.
    """
    order = np.argsort(places, kind="stable")
    groups = [[float(places[k])] for k in order]  # wanted places of the labels that touch
    while True:
        spans = [_span_of(group, least) for group in groups]
        touching = next((k for k in range(len(spans) - 1) if spans[k][1] + least > spans[k + 1][0] + 1e-9), None)
        if touching is None:
            break
        groups[touching : touching + 2] = [groups[touching] + groups[touching + 1]]
    result = np.empty(len(places))
    result[order] = [
        start + least * k for (start, _), group in zip(spans, groups, strict=True) for k in range(len(group))
    ]
    return result


def _span_of(group: Sequence[float], least: float) -> tuple[float, float]:
    """Return the first and the last place of labels that touch each other, about their middle and within 0 to 1."""
    length = least * (len(group) - 1)
    start = min(max(float(np.mean(group)) - length / 2, 0.0), max(1.0 - length, 0.0))
    return start, start + length


def _limits(axes: Axes, lines: Sequence[Sequence[Interval]], score: ScoreInfo, threshold: float | None) -> None:
    """Set the limits of the vertical axis by the means; shares end at 100, errors and counts begin at 0.

    Intervals have room as far as they go beyond the means by no more than :data:`_ROOM` of the span of the means, so
    that one wide interval does not flatten all curves.
    """
    means = np.array([each.mean for line in lines for each in line] + ([] if threshold is None else [threshold]))
    means = means[np.isfinite(means)]
    if not len(means):
        return
    room = _ROOM * max(float(np.ptp(means)), _LEAST_SPAN * (100.0 if score.unit == "%" else float(means.max())))
    ends = np.array([end for line in lines for each in line for end in (each.low, each.high)])
    ends = np.clip(ends[np.isfinite(ends)], means.min() - room, means.max() + room)
    known = np.concatenate([means, ends])
    if score.better == "higher":
        pad = max(0.07 * np.ptp(known), 0.5)
        top = 100.0 + 0.35 * pad if score.unit == "%" and known.max() + pad > 100 else known.max() + pad
        axes.set_ylim(max(0.0, known.min() - pad), top)
        if score.unit == "%":
            axes.set_yticks([tick for tick in axes.get_yticks() if axes.get_ylim()[0] <= tick <= 100])
    else:
        axes.set_ylim(0, 1.08 * known.max() or 1.0)


def _ticks(axes: Axes, values: Sequence[Any], places: Floats, numeric: bool) -> None:
    if not numeric:
        axes.set_xticks(places, [short(value) for value in values])
        axes.set_xlim(-0.6, len(values) - 0.4)
        longest = max(len(short(value)) for value in values)
        if longest * len(values) > 44:
            axes.tick_params(axis="x", labelrotation=30)
            for label in axes.get_xticklabels():
                label.set_horizontalalignment("right")
        return
    if places.min() > 0 and places.max() / places.min() >= _WIDE_RANGE:
        axes.set_xscale("log")
        axes.minorticks_off()
    across = np.log(places) if axes.get_xscale() == "log" else places
    axes.set_xticks(places, _spaced(across, [f"{place:g}" for place in places]))  # only the swept values


def _spaced(places: Floats, labels: Sequence[str]) -> list[str]:
    """Return labels at ascending places along an axis, empty where they would overlap; the ends are always kept."""
    space = np.ptp(places) or 1.0

    def near(one: int, other: int) -> bool:
        return abs(places[one] - places[other]) < space * _LETTER * (len(labels[one]) + len(labels[other]) + 1) / 2

    kept = [0]
    for index in range(len(labels) - 1, 0, -1):
        if not any(near(index, other) for other in kept):
            kept.append(index)
    return [label if index in kept else "" for index, label in enumerate(labels)]


def heat_map(
    name: str,
    *,
    down: tuple[str, Sequence[Any]],
    along: tuple[str, Sequence[Any]],
    means: Floats,
    score: ScoreInfo,
    span: tuple[float, float],
) -> str:
    """Plot a score at every combination of two factors as a heat map.

    Args:
        name: different from the name of every other plot on the page.
        down: key and k1 values of the factor on the vertical axis.
        along: key and k2 values of the factor on the horizontal axis.
        means: mean scores, (k1, k2).
        score: score that the colours show.
        span: scores of the first and the last colour; the same for maps that stand beside each other.
    """
    with svg_plot(name, size=(_SIZE[0], max(1.6, 0.9 + 0.38 * len(down[1])))) as (axes, written):
        colors = "viridis" if score.better == "higher" else "viridis_r"
        mesh = axes.pcolormesh(
            means, cmap=colors, vmin=span[0], vmax=max(span[1], span[0] + 1e-9), edgecolors=LINE, linewidth=0.6
        )
        for row, column in np.ndindex(means.shape):
            value = means[row, column]
            text, ink = "–", INK
            if np.isfinite(value):
                text = fixed(float(value), score.digits)
                ink = "#fbfbfb" if np.dot(mesh.cmap(mesh.norm(value))[:3], (0.299, 0.587, 0.114)) < _DARK else "#14161a"
            axes.text(column + 0.5, row + 0.5, text, ha="center", va="center", color=ink, fontsize=8.5)
        axes.set_xticks(np.arange(means.shape[1]) + 0.5, [short(value) for value in along[1]])
        axes.set_yticks(np.arange(means.shape[0]) + 0.5, [short(value) for value in down[1]])
        beside = textwrap.wrap(axis_label(down[0]), 10 + 5 * len(down[1]), break_long_words=False)
        axes.set(xlabel=axis_label(along[0]), ylabel="\n".join(beside))
        axes.invert_yaxis()
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    return written[0]


def mean_over(over: Mapping[str, Sequence[Any]]) -> str:
    """Return a note on the keys and values that a mean is over; empty without keys."""
    parts = []
    for key, values in over.items():
        text = ", ".join(map(short, values))
        if len(values) > _MAX_LISTED:
            numbers = all(isinstance(value, int | float) for value in values)
            ends = f"{short(values[0])} to {short(values[-1])}, " if numbers else ""
            text = f"({ends}{len(values)} values)"
        parts.append(f"{key} {text}")
    return f"mean over {' and '.join(parts)}" if parts else ""


def time_distribution(times: Mapping[str, Floats]) -> str:
    """Plot the cumulative distribution of the time per frame for each variant; times (n,) in milliseconds.

    The legend stands beside the curves, the fastest variant (by its median) first.
    """
    with svg_plot("time-distribution", size=_SIZE) as (axes, written):
        for (variant, values), color in zip(times.items(), VARIANT_COLORS * max(1, len(times)), strict=False):
            ranked = np.sort(values[np.isfinite(values)])
            if len(ranked):
                share = 100 * np.arange(1, len(ranked) + 1) / len(ranked)
                axes.step([ranked[0], *ranked], [0, *share], where="post", color=color, lw=1.7, label=variant, zorder=3)
        axes.set(xlabel="time per frame, ms", ylabel="share of frames, %", ylim=(0, 101))
        if any(len(values) for values in times.values()):
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{tick:g}"))
            axes.xaxis.set_minor_formatter(FuncFormatter(lambda tick, _: ""))
        axes.grid()
        _legend_beside(axes, times)
    return written[0]


def _legend_beside(axes: Axes, times: Mapping[str, Floats]) -> None:
    handles, names = axes.get_legend_handles_labels()
    if not names:
        return
    order = sorted(range(len(names)), key=lambda k: float(np.nanmedian(times[names[k]])))
    axes.legend(
        [handles[k] for k in order], [names[k] for k in order], loc="upper left", bbox_to_anchor=(1.0, 1.0),
        labelcolor=INK, handlelength=1.1, borderaxespad=0.3,
    )  # fmt: skip
