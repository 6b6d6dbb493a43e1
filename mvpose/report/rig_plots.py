"""Cameras from above, on the axes of a plot."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from mvpose.arrays import Floats
from mvpose.camera import Camera
from mvpose.report.map_labels import MapLabel, write_labels
from mvpose.report.svg_plots import FAINT, INK, Color

_LEVEL = 1e-6  # horizontal part of a viewing direction below which the camera looks straight down


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
    axes: Axes,
    cameras: Iterable[Camera],
    *,
    lines: Iterable[Floats] = (),
    areas: Iterable[tuple[Floats, Floats]] = (),
) -> None:
    """Write the name of each camera behind it, or where it hides less.

    Args:
        axes: plot in metres with its final limits.
        cameras: the cameras.
        lines: polylines that names do not cross, as in :func:`mvpose.report.map_labels.write_labels`.
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
