"""Maps of the floor: a coloured cell with its number for each place, the cameras, the volume and the room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Ellipse, Polygon, Rectangle

from mvpose import Camera
from mvpose.arrays import Bools, Floats
from mvpose.report.rig_plots import camera_from_above, fit_view, name_cameras
from mvpose.report.svg_plots import FAINT, INK, svg_plot
from simharness.planning.rehearsal import Rehearsal
from simharness.planning.sentences import grid_spacing
from simharness.planning.visibility import Obstacle

GOOD = "#1f8a5b"
"""Colour of the line around places that meet the target."""

EXTRA = "#d9643a"
"""Colour of one more camera."""

SIZE = (4.6, 4.5)
"""Width and height of a map, inches of 72 px."""

_TALL = 1.0  # height of the axes by their width
_USED = 0.82  # share of the width that the axes have
_LEAST = 13.0  # px: smaller cells share a number
_DARK = 0.5  # luminance under which numbers are white
_BETTER = LinearSegmentedColormap.from_list("better", ["#f3efe6", "#b9d3e8", "#5f9bd0", "#1f5f9f"])
_WORSE = LinearSegmentedColormap.from_list("worse", ["#f3f1ee", "#f3cfae", "#dd8452", "#a3341f"])
_NICE = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # factors by which ellipses are drawn larger


@dataclass(frozen=True)
class Scale:
    """Colours and numbers of a map.

    Attributes:
        low, high: values of the first and the last colour.
        digits: decimals of the numbers.
        better: which values are good: "high", "low"; "none" for a risk, which gets warm colours.
    """

    low: float
    high: float
    digits: int = 0
    better: str = "high"

    def color(self, value: float) -> tuple[float, float, float, float]:
        """Return the colour of a value."""
        share = float(Normalize(self.low, self.high, clip=True)(value))
        if self.better == "none":
            red, green, blue, alpha = _WORSE(share)
        else:
            red, green, blue, alpha = _BETTER(1.0 - share if self.better == "low" else share)
        return red, green, blue, alpha


def floor_map(
    rehearsal: Rehearsal,
    values: Floats,
    scale: Scale,
    *,
    name: str,
    outlined: bool = True,
    size: tuple[float, float] = SIZE,
) -> str:
    """Return a map as SVG.

    Args:
        rehearsal: the rehearsal, whose places are shown.
        values: value of each place, (P,); NaN: no cell.
        scale: colours and numbers.
        name: different from the name of every other plot on the page.
        outlined: draw the line around the places that meet the target.
        size: width and height in inches of 72 px; in a small map, cameras have no names.
    """
    places = rehearsal.prediction.places
    spacing = grid_spacing(places)
    with svg_plot(name, size=size) as (axes, written):
        known = np.flatnonzero(np.isfinite(values))
        colors = [scale.color(float(values[k])) for k in known]
        cells = [Rectangle(tuple(places[k] - spacing / 2), spacing, spacing) for k in known]
        axes.add_collection(PatchCollection(cells, facecolors=colors, edgecolors="none", zorder=1.5))
        width = _surroundings(axes, rehearsal, names=size[0] >= SIZE[0])
        step = max(1, int(np.ceil(_LEAST / (spacing / width * _USED * 72 * size[0]))))
        rows = np.rint((places - places.min(axis=0)) / spacing).astype(int)
        for k, color in zip(known, colors, strict=True):
            if (rows[k] % step == step // 2).all():
                axes.text(
                    float(places[k, 0]),
                    float(places[k, 1]),
                    f"{values[k]:.{scale.digits}f}",
                    ha="center",
                    va="center",
                    fontsize=6.2,
                    color="#ffffff" if _luminance(color) < _DARK else "#1b1d21",
                    zorder=3,
                )
        if outlined:
            axes.add_collection(LineCollection(outline_of(places, rehearsal.good), colors=GOOD, lw=2.0, zorder=3.5))
    return written[0]


def ellipse_map(rehearsal: Rehearsal, *, name: str) -> tuple[str, str]:
    """Return the map of the ellipses of one standard deviation of the trunk's joints, and how much larger they are."""
    places, covariance = rehearsal.prediction.places, rehearsal.prediction.ellipse
    spacing = grid_spacing(places)
    known = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))
    axes_of = [np.linalg.eigh(covariance[k]) for k in known]
    longest = np.array([np.sqrt(max(values[1], 0.0)) for values, _ in axes_of])
    wanted = 0.35 * spacing / max(float(np.median(longest)) if len(longest) else 1.0, 1e-6)
    factor = max((each for each in _NICE if each <= wanted), default=_NICE[0])
    with svg_plot(name, size=SIZE) as (axes, written):
        for k, (values, vectors) in zip(known, axes_of, strict=True):
            across, along = (2 * factor * np.sqrt(np.maximum(values, 0.0))).clip(max=1.5 * spacing)
            angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
            axes.add_patch(
                Ellipse(tuple(places[k]), along, across, angle=angle, fc="#3b82c455", ec="#3b82c4", lw=0.8, zorder=2)
            )
        _surroundings(axes, rehearsal)
    return written[0], f"{factor:g}"


def outline_of(places: Floats, chosen: Bools) -> list[Floats]:
    """Return the sides of the cells of a square grid (P, 2) that part chosen cells from others, each (2, 2), metres."""
    if not chosen.any():
        return []
    spacing = grid_spacing(places)
    low = places.min(axis=0)
    cells = {tuple(each) for each in np.rint((places[chosen] - low) / spacing).astype(int).tolist()}
    lines = []
    for x, y in sorted(cells):
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if (x + dx, y + dy) in cells:
                continue
            middle = low + spacing * (np.array([x, y]) + 0.5 * np.array([dx, dy]))
            half = 0.5 * spacing * np.array([dy, dx])
            lines.append(np.stack([middle - half, middle + half]))
    return lines


def corners_of(obstacle: Obstacle) -> Floats:
    """Return the corners of a box, in order around its floor and then around its top, (8, 3), metres."""
    half = obstacle.size / 2
    around = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half[:2]
    cos, sin = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    floor = around @ np.array([[cos, sin], [-sin, cos]]) + obstacle.center[:2]
    low, high = obstacle.center[2] - half[2], obstacle.center[2] + half[2]
    return np.concatenate([np.column_stack([floor, np.full(4, z)]) for z in (low, high)])


def simulated_map(rehearsal: Rehearsal, values: Sequence[Floats], *, least: int = 4) -> Floats:
    """Return the mean of values of simulated people at each place, (P,); NaN where fewer than ``least`` were.

    Args:
        rehearsal: the rehearsal, with its scenes.
        values: a value of each person of each frame, (F, P) for each scene; NaN: none.
        least: least number of values.
    """
    places = rehearsal.prediction.places
    spacing = grid_spacing(places)
    where = np.concatenate([each.places.reshape(-1, 2) for each in rehearsal.scenes])
    flat = np.concatenate([each.ravel() for each in values])
    away = np.abs(where[:, None] - places[None]).max(axis=2)
    cell = np.where(away.min(axis=1) <= spacing / 2 + 1e-9, away.argmin(axis=1), -1)
    known = np.isfinite(flat) & (cell >= 0)
    count = np.bincount(cell[known], minlength=len(places))
    total = np.bincount(cell[known], flat[known], minlength=len(places))
    return np.where(count >= least, total / np.maximum(count, 1), np.nan)


def _surroundings(axes: Axes, rehearsal: Rehearsal, *, names: bool = True) -> float:
    """Draw volume, room and cameras, with their names or plain; return the width that is shown, metres."""
    outline = rehearsal.volume.outline
    axes.add_patch(Polygon(outline, fill=False, ec=INK, lw=1.1, zorder=3.2))
    if len(rehearsal.room):
        axes.add_patch(Polygon(rehearsal.room, fill=False, ec=FAINT, lw=2.2, zorder=1.2))
    for obstacle in rehearsal.obstacles:
        axes.add_patch(Polygon(corners_of(obstacle)[:4, :2], fc=FAINT, ec=INK, lw=0.9, alpha=0.55, zorder=2.5))
    for camera in rehearsal.rig:
        camera_from_above(axes, camera)
    if rehearsal.extra is not None:
        _extra(axes, rehearsal.extra.camera)
    points = np.concatenate([outline, rehearsal.room, rehearsal.rig.centers[:, :2]])
    if rehearsal.extra is not None:
        points = np.concatenate([points, rehearsal.extra.camera.center[None, :2]])
    low, high = points.min(axis=0) - 0.6, points.max(axis=0) + 0.6
    fit_view(axes, low, high, tall=_TALL)
    if names:
        walls = [np.vstack([each, each[:1]]) for each in (outline, rehearsal.room) if len(each)]
        name_cameras(axes, rehearsal.rig, lines=walls, areas=[(outline.min(axis=0), outline.max(axis=0))])
    else:
        axes.set(xlabel="", ylabel="")
    left, right = axes.get_xlim()
    return right - left


def _extra(axes: Axes, camera: Camera) -> None:
    axes.plot(*camera.center[:2], "o", mfc="none", mec=EXTRA, mew=1.6, ms=7, zorder=4.5)


def _luminance(color: tuple[float, ...]) -> float:
    return 0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2]
