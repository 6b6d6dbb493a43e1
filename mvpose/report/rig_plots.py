"""Cameras from above on the axes of a plot, and labels of places, each where it hides no other label, place or line."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from mvpose.arrays import Floats
from mvpose.camera import Camera
from mvpose.report.svg_plots import FAINT, INK, Color, text_width

_LEVEL = 1e-6  # horizontal part of a viewing direction below which the camera looks straight down


_POINTS = 72.0  # in an inch
_LINE, _APART = 1.15, 2.0  # height of a line as a share of the font size, and points between two labels
_DOT = 4.0  # points: half the side of the square around a place that labels keep free
_GAPS = (3.0, 9.0, 16.0, 26.0, 38.0)  # points between a place and its label
_TURNS = np.radians([0, 30, -30, 60, -60, 90, -90, 135, -135, 180])  # from the preferred direction
_TURN_COST = 12.0  # of a label in the opposite direction; points squared, as all costs
_GAP_COST = 1.5  # of a point between a place and its label
_LINE_COST = 14.0  # of a point of a line behind a label
_LABEL_COST = 50.0  # factor of an area that two labels share: worse than any line
_OUTSIDE = 6.0  # factor of an area outside of the map


def camera_from_above(axes: Axes, camera: Camera, *, color: Color = INK, reach: float = 1.2) -> None:
    """Draw a camera from above: its centre, and the cone of its horizontal field of view.

    Args:
        axes: plot in metres, x and y of the world.
        camera: the camera.
        color: colour of the centre.
        reach: length of the cone, metres.
    """
    center, forward = camera.center[:2], camera.R[2, :2]
    if np.linalg.norm(forward) < _LEVEL:
        axes.plot(*center, "s", color=color, ms=4)
        return
    axes.add_patch(Polygon(cone_from_above(camera, reach), fc=FAINT, ec="none", alpha=0.18, zorder=1))
    axes.plot(*center, "o", color=color, ms=3.5, zorder=4)


def name_cameras(
    axes: Axes, cameras: Iterable[Camera], *, lines: Iterable[Floats] = (), areas: Iterable[tuple[Floats, Floats]] = ()
) -> None:
    """Write the name of each camera behind it, or where it hides less.

    Args:
        axes: plot in metres with its final limits.
        cameras: the cameras.
        lines: polylines that names do not cross, as in :func:`mvpose.report.rig_plots.write_labels`.
        areas: rectangles that names keep free, likewise.
    """
    labels = [MapLabel(each.name, each.center[:2], -each.R[2, :2], color=FAINT) for each in cameras]
    write_labels(axes, labels, lines=lines, areas=areas)


def fit_view(axes: Axes, low: Floats, high: Floats, *, tall: float) -> None:
    """Show the rectangle from ``low`` to ``high``, (2,), metres, to scale, in axes ``tall`` times as high as wide."""
    middle, half = (low + high) / 2, (high - low) / 2
    half = np.maximum(half, [half[1] / tall, half[0] * tall])
    axes.set(xlabel="x, m", ylabel="y, m")
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    axes.set_aspect("equal")
    axes.grid()
    axes.spines[:].set_visible(False)


def cone_from_above(camera: Camera, reach: float) -> Floats:
    """Return the centre and the two far corners of the horizontal field of view, (3, 2), metres."""
    forward = camera.R[2]
    bearing = math.atan2(forward[1], forward[0])
    side = math.atan(camera.size[0] / 2 / camera.K[0, 0])
    ends = [
        camera.center[:2] + reach * np.array([math.cos(bearing + turn), math.sin(bearing + turn)])
        for turn in (side, -side)
    ]
    return np.array([camera.center[:2], *ends])


@dataclass(frozen=True)
class MapLabel:
    """Label of a place."""

    text: str
    """One line or more."""
    place: Floats
    """What the label is for, (2,), in the units of the axes."""
    away: Floats
    """Preferred direction of the label from the place, (2,)."""
    color: Color = INK
    """Colour of the letters."""
    size: float = 8.0
    """Font size, points."""

    @property
    def extent(self) -> Floats:
        """Width and height, points."""
        lines = self.text.split("\n")
        return self.size * np.array([max(map(text_width, lines)), _LINE * len(lines)])


def write_labels(
    axes: Axes, labels: Sequence[MapLabel], *, lines: Iterable[Floats] = (), areas: Iterable[tuple[Floats, Floats]] = ()
) -> list[tuple[Floats, Floats]]:
    """Write labels beside their places, one after the other, each where it hides the least.

    Args:
        axes: map with its final limits.
        labels: labels; those before have the better choice.
        lines: polylines that labels do not cross where there is room, each (k, 2) in the units of the axes.
        areas: lower left and upper right corners of rectangles to keep free, (2,) each, in the units of the axes.

    Returns:
        Lower left and upper right corner of each label, points from the lower left corner of the figure.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # fixes where the axes lie in the figure
    frame = axes.get_window_extent()
    low, high = (_points(axes, np.array(corner)) for corner in (frame.min, frame.max))
    segments = [
        np.stack([start, end])
        for line in lines
        for path in [_points(axes, axes.transData.transform(line))]
        for start, end in pairwise(path)
    ]
    dots = [_points(axes, axes.transData.transform(label.place)) for label in labels]
    taken = [(dot - _DOT, dot + _DOT) for dot in dots]
    for corners in areas:
        lower, upper = _points(axes, axes.transData.transform(np.array(corners)))
        taken.append((lower, upper))
    placed: list[tuple[Floats, Floats]] = []
    for label, dot in zip(labels, dots, strict=True):
        box = _best_box(label, dot, taken, segments, (low, high), labels=placed)
        placed.append(box)
        axes.annotate(
            label.text, tuple(label.place), xytext=tuple((box[0] + box[1]) / 2 - dot), textcoords="offset points",
            ha="center", va="center", fontsize=label.size, color=label.color, linespacing=1.0, zorder=7,
            annotation_clip=False,
        )  # fmt: skip
    return placed


def _points(axes: Axes, pixels: Floats) -> Floats:
    return np.asarray(pixels, float) * _POINTS / axes.figure.dpi


def _best_box(
    label: MapLabel,
    dot: Floats,
    taken: Sequence[tuple[Floats, Floats]],
    segments: Sequence[Floats],
    inside: tuple[Floats, Floats],
    *,
    labels: Sequence[tuple[Floats, Floats]],
) -> tuple[Floats, Floats]:
    """Return the corners of the box of a label with the least cost, all in points."""
    half = label.extent / 2
    bearing = np.arctan2(label.away[1], label.away[0])
    best, least = (dot, dot), np.inf
    for gap in _GAPS:
        for turn in _TURNS.tolist():
            way = np.array([np.cos(bearing + turn), np.sin(bearing + turn)])
            center = dot + way * (_DOT + gap + min(half / np.maximum(np.abs(way), 1e-9)))
            box = (center - half, center + half)
            cost = _TURN_COST * abs(turn) / np.pi + _GAP_COST * gap
            cost += sum(shared_area(box, other) for other in taken)
            wide = (box[0] - _APART, box[1] + _APART)
            cost += _LABEL_COST * sum(shared_area(wide, other) for other in labels)
            cost += _LINE_COST * sum(length_within(segment, box) for segment in segments)
            cost += _OUTSIDE * (float(np.prod(box[1] - box[0])) - shared_area(box, inside))
            if cost < least:
                best, least = box, cost
    return best


def shared_area(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> float:
    """Return the area that two rectangles, given by their lower left and upper right corners, (2,), have in common."""
    sides = np.minimum(one[1], other[1]) - np.maximum(one[0], other[0])
    return float(np.prod(np.maximum(sides, 0.0)))


def length_within(segment: Floats, box: tuple[Floats, Floats]) -> float:
    """Return the length of the part of a segment, (2, 2), that lies within a rectangle (Liang and Barsky, 1984)."""
    start, step = segment[0], segment[1] - segment[0]
    first, last = 0.0, 1.0
    for axis in range(2):
        if abs(step[axis]) < 1e-12:
            if not box[0][axis] <= start[axis] <= box[1][axis]:
                return 0.0
            continue
        ends = sorted((corner[axis] - start[axis]) / step[axis] for corner in box)
        first, last = max(first, ends[0]), min(last, ends[1])
    return max(last - first, 0.0) * float(np.hypot(*step))
