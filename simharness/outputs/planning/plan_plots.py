"""Plots of a plan: figures at each place of the volume, and what fewer or more cameras would give."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Rectangle

from mvpose.arrays import Floats
from mvpose.report.svg_plots import FAINT, INK, LINE, svg_plot
from simharness.outputs.planning.room_plots import CAMERA, draw_room
from simharness.planning.plan_result import Plan

_COLORS = LinearSegmentedColormap.from_list("quality", ["#b3261e", "#e8a33d", "#f2e3a0", "#7cc4a4", "#1f7a51"])
_SIZE = (5.2, 3.1)
_SIMULATED, _LAYER = "#d9643a", "#3b82c4"


def place_map(name: str, plan: Plan, values: Floats, *, worst: float, best: float, digits: int = 0) -> str:
    """Draw values at the places of the volume, from above.

    Args:
        name: different from the name of every other plot on the page.
        plan: the plan.
        values: value at each place of its prediction, (P,).
        worst: value of the worst colour.
        best: value of the best colour.
        digits: digits of the written values.
    """
    places = plan.prediction.places
    low, high = plan.room.outline.min(axis=0) - 0.3, plan.room.outline.max(axis=0) + 0.3
    tall = float((high - low)[1] / (high - low)[0])
    side = _spacing(places)
    with svg_plot(name, size=(_SIZE[0], _SIZE[0] * tall)) as (axes, written):
        draw_room(axes, plan.room)
        for place, value in zip(places, values, strict=True):
            share = float(np.clip((value - worst) / (best - worst), 0.0, 1.0)) if np.isfinite(value) else 0.0
            color = _COLORS(share) if np.isfinite(value) else (0.5, 0.5, 0.5, 0.4)
            axes.add_patch(Rectangle(tuple(place - side / 2), side, side, fc=color, ec="none", zorder=2.2))
            text = f"{value:.{digits}f}" if np.isfinite(value) else "–"
            dark = 0.25 < share < 0.85
            axes.text(
                place[0], place[1], text, ha="center", va="center", fontsize=6.2,
                color="#1b1d21" if dark else "#ffffff", zorder=3,
            )  # fmt: skip
        for camera in plan.rig:
            axes.plot(*camera.center[:2], "o", color=CAMERA, ms=5, mec="white", mew=0.7, zorder=5)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect("equal")
        axes.axis("off")
    return written[0]


def _spacing(places: Floats) -> float:
    """Return the distance between neighbours of a square grid (P, 2), metres."""
    if len(places) < 2:
        return 0.5
    away = np.linalg.norm(places[:, None] - places[None], axis=-1)
    return float(away[away > 1e-6].min())


def buying_curve(name: str, plan: Plan) -> str:
    """Plot the PCP and the share of the volume within the target against the number of cameras."""
    with svg_plot(name, size=_SIZE) as (axes, written):
        counts = [point.cameras for point in plan.curve]
        axes.plot(counts, [point.figures.pcp[0] for point in plan.curve], "o-", color=_LAYER, ms=5, label="PCP")
        axes.plot(
            counts, [point.figures.share for point in plan.curve], "s--", color=CAMERA, ms=4.5,
            label="share of the volume within the target",
        )  # fmt: skip
        axes.axvline(len(plan.rig), color=LINE, lw=1.2, zorder=0)
        axes.set(xlabel="cameras", ylabel="%", ylim=(min(50.0, *_lows(plan)) - 3, 103))
        axes.set_xticks(counts)
        axes.grid(axis="y")
        axes.legend(loc="lower right", labelcolor=INK)
    return written[0]


def _lows(plan: Plan) -> list[float]:
    values = [v for p in plan.curve for v in (p.figures.pcp[0], p.figures.share) if np.isfinite(v)]
    return values or [50.0]


def rig_bars(name: str, plan: Plan) -> str:
    """Plot PCP of the plan, of the next best rigs and of usual ones: by the fast layer and by simulation."""
    rows = plan.alternatives
    with svg_plot(name, size=(_SIZE[0], 0.6 + 0.42 * len(rows))) as (axes, written):
        for k, each in enumerate(rows):
            y = len(rows) - 1 - k
            axes.plot(each.predicted.pcp[0], y + 0.13, "o", color=_LAYER, ms=5, label="fast layer" if k == 0 else None)
            if each.simulated is not None:
                value, low, high = each.simulated.pcp
                axes.plot([low, high], [y - 0.13] * 2, color=_SIMULATED, lw=2, alpha=0.6)
                axes.plot(value, y - 0.13, "o", color=_SIMULATED, ms=5, label="simulation" if k == 0 else None)
        axes.set_yticks(range(len(rows)), [each.title for each in reversed(rows)], color=INK)
        axes.set(xlabel="PCP, %", ylim=(-0.6, len(rows) - 0.4))
        axes.grid(axis="x")
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2, labelcolor=INK)
        axes.spines["left"].set_color(FAINT)
    return written[0]
