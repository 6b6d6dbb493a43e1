"""The plots of a report: SVG that takes its ink and grid from the page, one for light and dark."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from mvpose.camera import Rig

Floats = NDArray[np.float64]
Color = str

# Stand-ins that matplotlib writes into the SVG and that become the page's own colours.
_INK, _FAINT, _LINE = "#010203", "#010204", "#010205"
_OF_PAGE = {_INK: "currentColor", _FAINT: "var(--faint)", _LINE: "var(--line)"}

_SIZE = (5.2, 3.1)  # inches of 72 px: small, so that the letters stay readable on a phone

VISIBILITY_COLORS: tuple[Color, ...] = ("#2e9e6b", "#d9a514", "#d9643a", "#8a63c9", "#8b93a1")
STAGE_COLORS: Mapping[str, Color] = {
    "affinity": "#3b82c4",
    "matching": "#d9a514",
    "reconstruction": "#2e9e6b",
}
VARIANT_COLORS: tuple[Color, ...] = ("#3b82c4", "#d9643a", "#2e9e6b", "#8a63c9", "#d9a514", "#c2568f")

_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: the page's font, found by the browser's search
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "font.size": 9,
    "axes.titlesize": 9,
    "text.color": _INK,
    "axes.labelcolor": _FAINT,
    "axes.edgecolor": _LINE,
    "xtick.color": _LINE,
    "ytick.color": _LINE,
    "xtick.labelcolor": _FAINT,
    "ytick.labelcolor": _FAINT,
    "grid.color": _LINE,
    "grid.linewidth": 0.6,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}


@contextmanager
def _figure(name: str, *, size: tuple[float, float] = _SIZE) -> Iterator[tuple[Axes, list[str]]]:
    """Axes to draw on; the SVG is in the list afterwards."""
    written: list[str] = []
    with mpl.rc_context({**_STYLE, "svg.hashsalt": name}):  # the salt keeps the ids of two plots of a page apart
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.add_subplot()
        axes.set_axisbelow(True)
        yield axes, written
        buffer = io.StringIO()
        FigureCanvasSVG(figure).print_svg(
            buffer, metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
    figure.clear()
    written.append(_for_page(buffer.getvalue()))


def _for_page(svg: str) -> str:
    """Only the element, as wide as its place, in the page's colours."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    # Ids that two plots would share, and that nothing refers to.
    svg = re.sub(r' id="[a-zA-Z0-9.]+_\d+"', "", svg)
    for stand_in, color in _OF_PAGE.items():
        svg = svg.replace(stand_in, color)
    return re.sub(r"\n\s*", "\n", svg).strip()


def error_over_time(time: Floats, errors: Floats, *, colors: Sequence[Color]) -> str:
    """Mean joint error of each person, (T, P) millimetres; NaN where not found: marked below the axis."""
    with _figure("error-over-time") as (axes, written):
        top = float(np.nanmax(errors)) * 1.15 if np.isfinite(errors).any() else 100.0
        for person in range(errors.shape[1]):
            axes.plot(time, errors[:, person], color=colors[person], lw=1.6, label=f"person {person}", zorder=3)
            lost = np.isnan(errors[:, person])
            row = -top * (0.05 + 0.045 * person)
            axes.plot(time[lost], np.full(lost.sum(), row), "s", ms=3, color=colors[person], clip_on=False)
        axes.set(xlabel="time, s", ylabel="mean joint error, mm")
        axes.set_ylim(-top * (0.05 + 0.045 * errors.shape[1]) if np.isnan(errors).any() else 0, top)
        axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= top])
        axes.set_xlim(time[0], max(time[-1], time[0] + 1e-6))
        axes.grid(axis="y")
        _legend(axes, columns=min(4, max(1, errors.shape[1])))
    return written[0]


def error_distribution(errors: Mapping[str, Floats], *, limit: float = 150.0) -> str:
    """The share of true joints placed within a distance, for each variant; NaN is infinitely far."""
    with _figure("error-distribution") as (axes, written):
        grid = np.linspace(0, limit, 301)
        for (variant, values), color in zip(errors.items(), VARIANT_COLORS * len(errors), strict=False):
            ranked = np.sort(np.where(np.isnan(values), np.inf, values))
            share = np.searchsorted(ranked, grid, side="right") / max(1, len(ranked))
            axes.plot(grid, 100 * share, color=color, lw=1.8, label=variant, zorder=3)
        axes.set(xlabel="within, mm", ylabel="share of all true joints, %", xlim=(0, limit), ylim=(0, 101))
        axes.grid()
        axes.legend(loc="lower right", labelcolor=_INK)
    return written[0]


def visibility_shares(cameras: Sequence[str], shares: Floats, *, labels: Sequence[str]) -> str:
    """How many of the joints each camera sees: shares (V, 5), 0 to 1, by visibility label."""
    with _figure("visibility", size=(5.2, max(2.0, 1.1 + 0.36 * len(cameras)))) as (axes, written):
        left = np.zeros(len(cameras))
        rows = np.arange(len(cameras))
        for column, (label, color) in enumerate(zip(labels, VISIBILITY_COLORS, strict=True)):
            width = 100 * shares[:, column]
            axes.barh(rows, width, left=left, height=0.66, color=color, label=label, lw=0)
            left += width
        axes.set(xlabel="share of joints, %", xlim=(0, 100), yticks=rows, yticklabels=cameras)
        axes.invert_yaxis()
        axes.tick_params(axis="y", length=0, labelcolor=_INK)
        axes.spines["left"].set_visible(False)
        _legend(axes, columns=3)
    return written[0]


def stage_times(times: Mapping[str, Mapping[str, float]]) -> str:
    """Median milliseconds a frame of each stage of each variant."""
    with _figure("stage-times", size=(5.2, max(1.9, 1.2 + 0.42 * len(times)))) as (axes, written):
        rows = np.arange(len(times))
        left = np.zeros(len(times))
        stages = list(dict.fromkeys(stage for each in times.values() for stage in each if stage != "total"))
        for stage, spare in zip(stages, VARIANT_COLORS * len(stages), strict=False):
            width = np.array([each.get(stage, 0.0) for each in times.values()])
            axes.barh(rows, width, left=left, height=0.6, color=STAGE_COLORS.get(stage, spare), label=stage, lw=0)
            left += width
        for row, (end, each) in enumerate(zip(left.tolist(), times.values(), strict=True)):
            told = f"{each.get('total', end):.1f} ms"
            axes.annotate(told, (end, row), xytext=(4, 0), textcoords="offset points", va="center")
        axes.set(xlabel="median, ms", yticks=rows, yticklabels=list(times))
        axes.set_xlim(0, max(1e-6, left.max(initial=0.0)) * 1.18)
        axes.invert_yaxis()
        axes.tick_params(axis="y", length=0, labelcolor=_INK)
        axes.spines["left"].set_visible(False)
        _legend(axes, columns=3)
    return written[0]


def floor_plan(
    rig: Rig,
    room: tuple[float, float],
    *,
    things: Sequence[Floats],
    paths: Floats,
    estimates: Floats,
    colors: Sequence[Color],
) -> str:
    """The scene from above.

    Args:
        rig: cameras, drawn with the wedge that each sees.
        room: its x and y, metres, about the origin.
        things: outlines of the clutter, each (n, 2) metres.
        paths: where the people truly went, (T, P, 2) metres.
        estimates: where the method saw people, (k, 2) metres.
        colors: of the people, P of them.
    """
    with _figure("floor-plan", size=(5.2, 4.8)) as (axes, written):
        half = np.array(room) / 2
        corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        axes.add_patch(Polygon(corners, fill=False, ec=_FAINT, lw=1.2))
        for outline in things:
            axes.add_patch(Polygon(outline, fc=_LINE, ec=_FAINT, lw=0.8))
        for camera in rig:
            tangent = camera.size[0] / 2 / camera.K[0, 0]
            _camera(axes, camera.center[:2], camera.R[2][:2], tangent=tangent, name=camera.name)
        for person in range(paths.shape[1]):
            axes.plot(
                *paths[:, person].T,
                color=colors[person],
                lw=2.2,
                alpha=0.55,
                solid_capstyle="round",
                zorder=3,
            )
            axes.plot(*paths[-1, person], "o", ms=5, color=colors[person], zorder=4, label=f"person {person}")
        if len(estimates):
            axes.plot(*estimates.T, ".", ms=2.2, color=_INK, mew=0, zorder=5)
            axes.plot([], [], ".", ms=5, color=_INK, mew=0, label="estimated")
        reach = np.vstack([corners, rig.centers[:, :2]])
        low, high = reach.min(axis=0) - 0.4, reach.max(axis=0) + 0.4
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x, m", ylabel="y, m")
        axes.set_aspect("equal")
        axes.spines[:].set_visible(False)
        _legend(axes, columns=min(5, paths.shape[1] + 1))
    return written[0]


def _camera(axes: Axes, center: Floats, forward: Floats, *, tangent: float, name: str) -> None:
    length = float(np.linalg.norm(forward))
    if length < 1e-6:  # it looks straight down
        axes.plot(*center, "s", color=_INK, ms=4)
        return
    bearing = math.atan2(forward[1], forward[0])
    side = math.atan(tangent)
    ends = [center + 1.2 * np.array([math.cos(bearing + turn), math.sin(bearing + turn)]) for turn in (side, -side)]
    axes.add_patch(Polygon(np.array([center, *ends]), fc=_FAINT, ec="none", alpha=0.18, zorder=1))
    axes.plot(*center, "o", color=_INK, ms=3.5, zorder=4)
    aside = center + 0.3 * np.array([-forward[1], forward[0]]) / length
    axes.text(float(aside[0]), float(aside[1]), name, ha="center", va="center", fontsize=8, color=_FAINT)


def _legend(axes: Axes, *, columns: int) -> None:
    """Above the axes, out of the way of the data."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0, 1.0),
            ncols=columns,
            labelcolor=_INK,
            handlelength=1.1,
            columnspacing=1.2,
            borderaxespad=0.2,
        )
