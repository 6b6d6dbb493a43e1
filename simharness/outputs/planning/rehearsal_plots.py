"""Plots of a rehearsal: maps of the floor, and curves over people, cameras, and errors of calibration and clocks.

A map has a coloured cell with its number for each place, the cameras, the volume and the room.

The 3D view shows frusta of the cameras, the volume, and the part of it that meets the target.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Ellipse, Polygon, Rectangle

from mvpose.arrays import Bools, Floats
from mvpose.report.rig_plots import camera_from_above, fit_view, name_cameras
from mvpose.report.svg_plots import FAINT, INK, legend_above, svg_plot
from mvpose.report.view_3d import (
    PYRAMID,
    Piece3D,
    Scene3D,
    Shape3D,
    Style3D,
    View3D,
    camera_pyramid,
    loop,
    prism,
    view_3d,
)
from simharness.planning.floor_coverage import grid_spacing
from simharness.planning.rehearsal_result import Rehearsal
from simharness.planning.tolerance import CLIFF, FaultTolerance
from simharness.statistics.intervals import Interval

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
LAYER = "#8a63c9"
"""Colour of the fast layer."""

SIMULATION = "#3b82c4"
"""Colour of the simulation."""

_WIDE = (4.9, 2.9)
_SMALL = (3.5, 2.6)
_FLOOR = 5.0  # PCP: axes begin at a multiple of this


@dataclass(frozen=True)
class MapColors:
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
    scale: MapColors,
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
        colors = np.array([scale.color(value) if np.isfinite(value) else (0, 0, 0, 0) for value in values.tolist()])
        width = _surroundings(axes, rehearsal, names=size[0] >= SIZE[0])
        step = max(1, int(np.ceil(_LEAST / (spacing / width * _USED * 72 * size[0]))))
        draw_cells(axes, places, values, colors, digits=scale.digits, step=step)
        if outlined:
            axes.add_collection(LineCollection(outline_of(places, rehearsal.good), colors=GOOD, lw=2.0, zorder=3.5))
    return written[0]


def draw_cells(axes: Axes, places: Floats, values: Floats, colors: Floats, *, digits: int, step: int = 1) -> None:
    """Draw a cell with its number for each place of a square grid; "–" for NaN.

    Args:
        axes: the plot.
        places: centres of the cells, (P, 2), metres.
        values: numbers, (P,).
        colors: colours of the cells, (P, 4), red, green, blue and opacity; 0: no cell. Numbers on dark ones are white.
        digits: decimals of the numbers.
        step: cells along either axis that share a number.
    """
    side = grid_spacing(places)
    rows = np.rint((places - places.min(axis=0)) / side).astype(int)
    numbered = (rows % step == step // 2).all(axis=1)
    for (x, y), value, color, shown in zip(places.tolist(), values.tolist(), colors, numbered, strict=True):
        if color[3] == 0:
            continue
        axes.add_patch(Rectangle((x - side / 2, y - side / 2), side, side, fc=color, ec="none", zorder=1.5))
        if shown:
            text = f"{value:.{digits}f}" if np.isfinite(value) else "–"
            ink = "#ffffff" if color[:3] @ (0.299, 0.587, 0.114) < _DARK else "#1b1d21"
            axes.text(x, y, text, ha="center", va="center", fontsize=6.2, color=ink, zorder=3)


def ellipse_map(rehearsal: Rehearsal) -> tuple[str, str]:
    """Return the map of the ellipses of one standard deviation of the trunk's joints, and how much larger they are."""
    places, covariance = rehearsal.prediction.places, rehearsal.prediction.ellipse
    spacing = grid_spacing(places)
    known = np.flatnonzero(np.isfinite(covariance).all(axis=(1, 2)))
    axes_of = [np.linalg.eigh(covariance[k]) for k in known]
    longest = np.array([np.sqrt(max(values[1], 0.0)) for values, _ in axes_of])
    wanted = 0.35 * spacing / max(float(np.median(longest)) if len(longest) else 1.0, 1e-6)
    factor = max((each for each in _NICE if each <= wanted), default=_NICE[0])
    with svg_plot("map-ellipses", size=SIZE) as (axes, written):
        for k, (values, vectors) in zip(known, axes_of, strict=True):
            across, along = (2 * factor * np.sqrt(np.maximum(values, 0.0))).clip(max=1.5 * spacing)
            angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
            axes.add_patch(
                Ellipse(tuple(places[k]), along, across, angle=angle, fc="#3b82c455", ec="#3b82c4", lw=0.8, zorder=2)
            )
        _surroundings(axes, rehearsal)
    return written[0], f"{factor:g}"


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


def crowd_curve(rehearsal: Rehearsal) -> str:
    """Plot PCP against the number of people: the fast layer as a line, simulation as points with intervals."""
    crowds = rehearsal.crowds
    with svg_plot("crowd", size=_WIDE) as (axes, written):
        people, layer = [each.people for each in crowds], [each.layer_pcp for each in crowds]
        axes.plot(people, layer, "--", color=LAYER, lw=1.5, label="fast layer")
        known = [(each.people, each.pcp) for each in crowds if each.pcp is not None]
        _points(axes, [number for number, _ in known], [pcp for _, pcp in known], "simulation")
        axes.axhline(rehearsal.setup.target.pcp, color=FAINT, lw=0.9, ls=":")
        values = layer + [_low(pcp) for _, pcp in known]
        axes.set(xlabel="people in the volume", ylabel="PCP, %", ylim=(_bottom(values), 101))
        axes.set_xticks([each.people for each in crowds])
        axes.grid(axis="y")
        legend_above(axes, columns=2)
    return written[0]


def matching_curve(rehearsal: Rehearsal) -> str:
    """Plot the simulated percentage of matches that take two people for one, against the number of people."""
    known = [(each.people, each.mixed) for each in rehearsal.crowds if each.mixed is not None]
    with svg_plot("matching", size=_WIDE) as (axes, written):
        _points(axes, [number for number, _ in known], [mixed for _, mixed in known], "simulation")
        top = max([5.0, *(each.high for _, each in known if np.isfinite(each.high))])
        axes.set(xlabel="people in the volume", ylabel="matches of two people, %", ylim=(0, 1.05 * top))
        axes.set_xticks([each.people for each in rehearsal.crowds])
        axes.grid(axis="y")
    return written[0]


def tolerance_curve(tolerance: FaultTolerance, base: Interval, *, name: str, bottom: float) -> str:
    """Plot PCP against the size of one kind of error, with the level at which it has lost five points."""
    with svg_plot(name, size=_SMALL) as (axes, written):
        _points(axes, [0.0, *tolerance.fault.levels], [base, *tolerance.pcp], "", line=True)
        axes.axhline(base.mean - CLIFF, color=FAINT, lw=0.9, ls=":")
        if tolerance.cliff is not None:
            axes.axvline(tolerance.cliff, color="#d9643a", lw=1.3)
        unit = tolerance.fault.unit
        axes.set(xlabel=f"standard deviation, {unit}", ylabel="PCP, %", ylim=(bottom, 101))
        axes.grid(axis="y")
    return written[0]


def tolerance_bottom(rehearsal: Rehearsal) -> float:
    """Return the lower end of the axes of all tolerances, which they share so that they can be compared."""
    return _bottom([_low(pcp) for each in rehearsal.tolerances for pcp in each.pcp])


def subset_curve(rehearsal: Rehearsal) -> str:
    """Plot the simulated PCP of all sets of cameras against their number, with the best of each number as a line."""
    sets = {names: each for names, each in rehearsal.subsets.items() if np.isfinite(each.pcp.mean)}
    counts = sorted({len(names) for names in sets})
    with svg_plot("sets", size=_WIDE) as (axes, written):
        sizes, pcp = [len(names) for names in sets], [each.pcp.mean for each in sets.values()]
        axes.plot(sizes, pcp, "o", color=SIMULATION, ms=4.5, alpha=0.45, mew=0, label="a set of cameras")
        best = [max(each.pcp.mean for names, each in sets.items() if len(names) == count) for count in counts]
        axes.plot(counts, best, "-", color=SIMULATION, lw=1.5, label="the best of its size")
        axes.axhline(rehearsal.setup.target.pcp, color=FAINT, lw=0.9, ls=":")
        axes.set(xlabel="cameras", ylabel="PCP, %", ylim=(_bottom(pcp), 101))
        axes.set_xticks(counts)
        axes.grid(axis="y")
        legend_above(axes, columns=2)
    return written[0]


def _surroundings(axes: Axes, rehearsal: Rehearsal, *, names: bool = True) -> float:
    """Draw volume, room and cameras, with their names or plain; return the width that is shown, metres."""
    setup = rehearsal.setup
    outline, walls = setup.volume.outline, np.zeros((0, 2)) if setup.space is None else setup.space.outline
    axes.add_patch(Polygon(outline, fill=False, ec=INK, lw=1.1, zorder=3.2))
    if len(walls):
        axes.add_patch(Polygon(walls, fill=False, ec=FAINT, lw=2.2, zorder=1.2))
    for obstacle in setup.obstacles:
        axes.add_patch(Polygon(obstacle.footprint.outline, fc=FAINT, ec=INK, lw=0.9, alpha=0.55, zorder=2.5))
    for camera in rehearsal.rig:
        camera_from_above(axes, camera)
    if rehearsal.extra is not None:
        axes.plot(*rehearsal.extra.camera.center[:2], "o", mfc="none", mec=EXTRA, mew=1.6, ms=7, zorder=4.5)
    points = np.concatenate([outline, walls, rehearsal.rig.centers[:, :2]])
    if rehearsal.extra is not None:
        points = np.concatenate([points, rehearsal.extra.camera.center[None, :2]])
    low, high = points.min(axis=0) - 0.6, points.max(axis=0) + 0.6
    fit_view(axes, low, high, tall=_TALL)
    if names:
        lines = [np.vstack([each, each[:1]]) for each in (outline, walls) if len(each)]
        name_cameras(axes, rehearsal.rig, lines=lines, areas=[(outline.min(axis=0), outline.max(axis=0))])
    else:
        axes.set(xlabel="", ylabel="")
    left, right = axes.get_xlim()
    return right - left


def _points(axes: Axes, at: Sequence[float], values: Sequence[Interval], label: str, *, line: bool = False) -> None:
    """Draw means with their intervals."""
    means = np.array([each.mean for each in values])
    ends = np.array([[each.low, each.high] for each in values]).reshape(-1, 2)
    ends = np.where(np.isfinite(ends), ends, means[:, None])
    for x, (low, high) in zip(at, ends, strict=True):
        axes.plot([x, x], [low, high], color=SIMULATION, lw=1.2, alpha=0.7)
    axes.plot(at, means, "o-" if line else "o", color=SIMULATION, lw=1.4, ms=4.6, mew=0, label=label or None)


def _low(value: Interval) -> float:
    return value.low if np.isfinite(value.low) else value.mean


def _bottom(values: list[float]) -> float:
    known = [each for each in values if np.isfinite(each)]
    return max(0.0, _FLOOR * (np.floor(min(known, default=95.0) / _FLOOR) - 0.2))


_REACH = 1.4  # metres: length of the drawn frusta
_FRUSTUM, _EXTRA = Style3D("--accent", 1.1), Style3D(EXTRA, 1.3)
_VOLUME, _OBSTACLE, _ROOM = Style3D("--ink", 1.2), Style3D("--faint", 1.0), Style3D("--faint", 2.0)
_TILE, _OUTLINE, _GRID = Style3D(GOOD, opacity=0.22), Style3D(GOOD, 1.8), Style3D("--line", 1.0)


def rig_view_3d(rehearsal: Rehearsal) -> View3D:
    """Return the view of a rehearsal."""
    rig, setup = rehearsal.rig, rehearsal.setup
    volume, height = setup.volume.outline, setup.volume.height
    walls = np.zeros((0, 2)) if setup.space is None else setup.space.outline
    points = np.concatenate([volume, rig.centers[:, :2], walls])
    frusta = [Piece3D(camera_pyramid(camera, _REACH), PYRAMID, _FRUSTUM) for camera in rig]
    if rehearsal.extra is not None:
        frusta.append(Piece3D(camera_pyramid(rehearsal.extra.camera, _REACH), PYRAMID, _EXTRA))
    room = _at(walls, 0.0)
    floor, good = _floor(points), outline_of(rehearsal.prediction.places, rehearsal.good)
    scene = Scene3D(
        label="The rig in 3D: frusta of the cameras, the volume, and the part of it that meets the target in green",
        center=np.array([*(points.min(axis=0) + points.max(axis=0)) / 2, height / 2]),
        fitted=np.concatenate([rig.centers, _at(volume, height), *floor]),
        fixed=[
            *_tiles(rehearsal),
            Piece3D.of_lines(floor, _GRID),
            Piece3D(room, Shape3D(lines=loop(len(room))), _ROOM),
            *(Piece3D(each.corners[[0, 4, 6, 2, 1, 5, 7, 3]], prism(4), _OBSTACLE) for each in setup.obstacles),
            Piece3D(np.concatenate([_at(volume, 0.0), _at(volume, height)]), prism(len(volume)), _VOLUME),
            Piece3D.of_lines([_at(each, 0.0) for each in good], _OUTLINE),
            *frusta,
        ],
        names=[(camera.name, camera.center) for camera in rig],
    )
    return view_3d(scene)


def _at(outline: Floats, height: float) -> Floats:
    """Return points of the floor (n, 2) at a height, (n, 3)."""
    return np.column_stack([outline, np.full(len(outline), height)])


def _tiles(rehearsal: Rehearsal) -> list[Piece3D]:
    """Return the places that meet the target as squares of the floor."""
    places = rehearsal.prediction.places
    corner = grid_spacing(places) / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    square = Shape3D(faces=(tuple(range(4)),))
    return [Piece3D(_at(place + corner, 0.0), square, _TILE) for place in places[rehearsal.good]]


def _floor(points: Floats) -> list[Floats]:
    """Return the lines of a grid of one metre under points (n, 2)."""
    (left, front), (right, back) = np.floor(points.min(axis=0)), np.ceil(points.max(axis=0))
    across = [np.array([[x, front, 0.0], [x, back, 0.0]]) for x in np.arange(left, right + 0.5)]
    return across + [np.array([[left, y, 0.0], [right, y, 0.0]]) for y in np.arange(front, back + 0.5)]
