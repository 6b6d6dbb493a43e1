"""Plots of one run, as SVG."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.patches import Polygon

from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from mvpose.report import svg_plots
from mvpose.report.palette import line_color
from mvpose.report.rig_plots import camera_from_above, name_cameras

VISIBILITY_COLORS: tuple[svg_plots.Color, ...] = ("#2e9e6b", "#d9a514", "#d9643a", "#8a63c9", "#8b93a1")


def error_over_time(time: Floats, errors: Floats, present: Bools) -> str:
    """Plot the mean joint error of each person over time.

    Args:
        time: seconds, (T,).
        errors: millimetres, (T, P); NaN where a person was not found.
        present: who is in the scene, (T, P); where such a person was not found is marked below the axis.
    """
    with svg_plots.svg_plot("error-over-time") as (axes, written):
        top = float(np.nanmax(errors)) * 1.15 if np.isfinite(errors).any() else 100.0
        for person in range(errors.shape[1]):
            color = line_color(person)
            axes.plot(time, errors[:, person], color=color, lw=1.6, label=f"person {person}", zorder=3)
            lost = np.isnan(errors[:, person]) & present[:, person]
            row = -top * (0.05 + 0.045 * person)
            axes.plot(time[lost], np.full(lost.sum(), row), "s", ms=3, color=color, clip_on=False)
        axes.set(xlabel="time, s", ylabel="mean joint error, mm")
        axes.set_ylim(-top * (0.05 + 0.045 * errors.shape[1]) if (np.isnan(errors) & present).any() else 0, top)
        axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= top])
        axes.set_xlim(time[0], max(time[-1], time[0] + 1e-6))
        axes.grid(axis="y")
        svg_plots.legend_above(axes)
    return written[0]


def error_distribution(errors: Mapping[str, Floats]) -> str:
    """Plot the share of true joints with at most a given error, for each variant.

    Args:
        errors: millimetres by variant, (n,); NaN counts as infinite.
    """
    limit = 150.0  # end of the axis, millimetres
    with svg_plots.svg_plot("error-distribution") as (axes, written):
        grid = np.linspace(0, limit, 301)
        for (variant, values), color in zip(errors.items(), svg_plots.VARIANT_COLORS * len(errors), strict=False):
            ranked = np.sort(np.where(np.isnan(values), np.inf, values))
            share = np.searchsorted(ranked, grid, side="right") / max(1, len(ranked))
            axes.plot(grid, 100 * share, color=color, lw=1.8, label=variant, zorder=3)
        axes.set(xlabel="joint error up to, mm", ylabel="share of all true joints, %", xlim=(0, limit), ylim=(0, 101))
        axes.grid()
        axes.legend(loc="lower right", labelcolor=svg_plots.INK)
    return written[0]


def visibility_shares(cameras: Sequence[str], shares: Floats, *, labels: Sequence[str]) -> str:
    """Plot the visibility of the joints in each camera: shares (V, 5), 0 to 1, by visibility label."""
    with svg_plots.svg_plot("visibility", size=(5.2, max(2.0, 1.1 + 0.36 * len(cameras)))) as (axes, written):
        left = np.zeros(len(cameras))
        rows = np.arange(len(cameras))
        for column, (label, color) in enumerate(zip(labels, VISIBILITY_COLORS, strict=True)):
            width = 100 * shares[:, column]
            axes.barh(rows, width, left=left, height=0.66, color=color, label=label, lw=0)
            left += width
        axes.set(xlabel="share of joints, %", xlim=(0, 100), yticks=rows, yticklabels=cameras)
        axes.invert_yaxis()
        axes.tick_params(axis="y", length=0, labelcolor=svg_plots.INK)
        axes.spines["left"].set_visible(False)
        svg_plots.legend_above(axes)
    return written[0]


def stage_times(times: Mapping[str, Mapping[str, float]]) -> str:
    """Plot the median time of each stage of each variant.

    Args:
        times: milliseconds per frame, by variant and stage. A variant with a "total" alone has one stage, "method".
    """
    times = {name: {"method": each["total"]} if set(each) == {"total"} else each for name, each in times.items()}
    with svg_plots.svg_plot("stage-times", size=(5.2, max(1.9, 1.2 + 0.42 * len(times)))) as (axes, written):
        rows = np.arange(len(times))
        left = np.zeros(len(times))
        stages = list(dict.fromkeys(stage for each in times.values() for stage in each if stage != "total"))
        for stage, spare in zip(stages, svg_plots.VARIANT_COLORS * len(stages), strict=False):
            width = np.array([each.get(stage, 0.0) for each in times.values()])
            axes.barh(
                rows, width, left=left, height=0.6, color=svg_plots.STAGE_COLORS.get(stage, spare), label=stage, lw=0
            )
            left += width
        for row, (end, each) in enumerate(zip(left.tolist(), times.values(), strict=True)):
            text = f"{each.get('total', end):.1f} ms"
            axes.annotate(text, (end, row), xytext=(4, 0), textcoords="offset points", va="center")
        axes.set(xlabel="median, ms", yticks=rows, yticklabels=list(times))
        axes.set_xlim(0, max(1e-6, left.max(initial=0.0)) * 1.18)
        axes.invert_yaxis()
        axes.tick_params(axis="y", length=0, labelcolor=svg_plots.INK)
        axes.spines["left"].set_visible(False)
        svg_plots.legend_above(axes)
    return written[0]


def floor_plan(
    rig: Rig, room: tuple[float, float], *, things: Sequence[Floats], paths: Floats, estimates: Floats
) -> str:
    """Plot the scene from above.

    Args:
        rig: cameras, drawn with their horizontal fields of view.
        room: size in x and y, metres, centred at the origin.
        things: outlines of the clutter, each (n, 2) metres.
        paths: true paths of the people, (T, P, 2) metres.
        estimates: positions of the estimates, (k, 2) metres.
    """
    with svg_plots.svg_plot("floor-plan", size=(5.2, 4.8)) as (axes, written):
        half = np.array(room) / 2
        corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        axes.add_patch(Polygon(corners, fill=False, ec=svg_plots.FAINT, lw=1.2))
        for outline in things:
            axes.add_patch(Polygon(outline, fc=svg_plots.LINE, ec=svg_plots.FAINT, lw=0.8))
        for camera in rig:
            camera_from_above(axes, camera)
        for person, color in enumerate(map(line_color, range(paths.shape[1]))):
            axes.plot(*paths[:, person].T, color=color, lw=2.2, alpha=0.55, solid_capstyle="round", zorder=3)
            axes.plot(*paths[-1, person], "o", ms=5, color=color, zorder=4, label=f"person {person}")
        if len(estimates):
            axes.plot(*estimates.T, ".", ms=2.2, color=svg_plots.INK, mew=0, zorder=5)
            axes.plot([], [], ".", ms=5, color=svg_plots.INK, mew=0, label="estimated")
        reach = np.vstack([corners, rig.centers[:, :2]])
        low, high = reach.min(axis=0) - 0.4, reach.max(axis=0) + 0.4
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x, m", ylabel="y, m")
        axes.set_aspect("equal")
        axes.spines[:].set_visible(False)
        svg_plots.legend_above(axes)
        name_cameras(axes, rig, lines=[np.vstack([each, each[:1]]) for each in (corners, *things)])
    return written[0]
