"""Plots of the doctor's page, as SVG: the rig from above before and after, and clock offsets with their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.camera import Camera, Rig
from mvpose.report.doctor_drawings import nice_factor
from mvpose.report.rig_plots import camera_from_above, cone_from_above, fit_view, name_cameras
from mvpose.report.svg_plots import FAINT, INK, legend_above, svg_plot

BEFORE, AFTER = "#d9643a", "#3b82c4"
"""Colours of what the calibration has and of what the doctor finds; safe for colour-blind readers, light and dark."""

_MARGIN = 0.7  # metres
_LONGEST, _WIDEST = 0.09, np.radians(25.0)  # of the plot, and angle: how far the largest correction is exaggerated
_TALL = 1.08  # height over width of the plot from above
_MOST_POINTS = 600


@dataclass(frozen=True)
class ClockOffset:
    """Offset of a camera's clock, ms; low and high are NaN where no interval is known."""

    name: str
    value: float
    low: float = np.nan
    high: float = np.nan


def motion_factor(before: Rig, after: Rig) -> float:
    """Return one factor, 1, 2, 5, 10, ..., by which corrections are exaggerated so that the largest is easy to see."""
    moved = np.linalg.norm(after.centers - before.centers, axis=1).max()
    turned = max(_rotation_vectors(before, after).max(initial=0.0), 1e-9)
    extent = float(np.ptp(before.centers[:, :2], axis=0).max()) + 2 * _MARGIN
    return nice_factor(min(_LONGEST * extent / max(float(moved), 1e-9), _WIDEST / turned, 100.0))


def _rotation_vectors(before: Rig, after: Rig) -> Floats:
    return np.array([Rotation.from_matrix(b.R @ a.R.T).magnitude() for a, b in zip(before, after, strict=True)])


def exaggerated(before: Camera, after: Camera, factor: float) -> Camera:
    """Return a camera whose rotation and centre differ from ``before`` by ``factor`` times as much as ``after``."""
    turn = Rotation.from_matrix(after.R @ before.R.T).as_rotvec() * factor
    R = Rotation.from_rotvec(turn).as_matrix() @ before.R
    center = before.center + factor * (after.center - before.center)
    return Camera(after.K, R, -R @ center, after.distortion, after.size, after.name)


def rig_from_above(
    name: str, rig: Rig, *, repaired: Rig | None, moved: Sequence[int], points: Floats, factor: float
) -> str:
    """Plot the rig from above: all cameras, those that moved before and after, and where people were.

    Args:
        name: name of the plot, unique on its page.
        rig: the rig as it was given.
        repaired: the rig as the doctor finds it, or None.
        moved: views that are drawn twice, or in the colour of faults where there is no repaired rig.
        points: places of joints, (k, 3), metres.
        factor: by which the difference of the moved cameras is exaggerated.
    """
    shown = points[np.isfinite(points).all(axis=1)][:, :2]
    shown = shown[:: max(1, -(-len(shown) // _MOST_POINTS))]
    where = np.quantile(shown, [0.02, 0.98], axis=0) if len(shown) else rig.centers[:, :2]
    extent = np.vstack([rig.centers[:, :2], where])
    low, high = extent.min(axis=0) - _MARGIN, extent.max(axis=0) + _MARGIN
    reach = 0.2 * float((high - low).max())
    with svg_plot(name, size=(5.2, 5.2 * _TALL)) as (axes, written):
        axes.plot(*shown.T, ".", ms=2.5, mew=0, color=FAINT, alpha=0.5, zorder=2)
        for view, camera in enumerate(rig):
            if view not in moved:
                camera_from_above(axes, camera, reach=reach)
                continue
            _outline(axes, camera, reach, BEFORE, "--")
            if repaired is not None:
                _outline(axes, exaggerated(camera, repaired[view], factor), reach, AFTER, "-")
            camera_from_above(axes, camera, color=BEFORE, reach=0.0)
        if len(moved):
            axes.plot([], [], "--", color=BEFORE, lw=1.4, label="as calibrated")
            if repaired is not None:
                by = f", difference × {factor:g}" if factor > 1 else ""
                axes.plot([], [], color=AFTER, lw=1.6, label=f"as found{by}")
        axes.plot([], [], ".", ms=6, mew=0, color=FAINT, label="joints of people")
        fit_view(axes, low, high, tall=_TALL)
        legend_above(axes, columns=3)
        shown_cones = [cone_from_above(camera, reach)[[1, 0, 2]] for camera in rig]
        name_cameras(axes, rig, lines=shown_cones)
    return written[0]


def _outline(axes: Axes, camera: Camera, reach: float, color: str, style: str) -> None:
    corners = cone_from_above(camera, reach)
    axes.add_patch(Polygon(corners, fc=color, ec="none", alpha=0.12, zorder=2))
    axes.add_patch(Polygon(corners, fill=False, ec=color, lw=1.5, ls=style, zorder=5))
    axes.plot(*camera.center[:2], "o", ms=4, mew=0, color=color, zorder=6)


def clock_offsets(name: str, offsets: Sequence[ClockOffset]) -> str:
    """Plot the offset of each camera's clock with its 90 % interval, ms."""
    with svg_plot(name, size=(5.2, 0.9 + 0.34 * len(offsets))) as (axes, written):
        axes.axvline(0.0, color=FAINT, lw=0.8, zorder=1)
        for row, each in enumerate(offsets):
            sure = np.isfinite([each.low, each.high]).all()
            away = sure and not each.low <= 0.0 <= each.high
            color = BEFORE if away else AFTER
            if sure:
                axes.plot([each.low, each.high], [row, row], color=color, lw=4, alpha=0.45, solid_capstyle="round")
            axes.plot(each.value, row, "o", ms=5.5, mew=0, color=color, zorder=4)
            text = f"{each.value:+.1f}"
            place = (each.value, row)
            axes.annotate(text, place, xytext=(0, 7), textcoords="offset points", ha="center", fontsize=8)
        values = np.abs([(each.value, each.low, each.high) for each in offsets])
        reach = 1.15 * max(5.0, float(np.nanmax(values)))
        axes.set(xlim=(-reach, reach), ylim=(len(offsets) - 0.4, -0.9), xlabel="offset, ms")
        axes.set_yticks(range(len(offsets)), [each.name for each in offsets])
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.spines["left"].set_visible(False)
        axes.grid(axis="x")
    return written[0]
