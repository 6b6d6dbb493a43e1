"""Room from above and from the side, with the places for cameras, obstacles, doors, the volume, and a rig."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.rig_plots import cone_from_above
from mvpose.report.svg_plots import FAINT, INK, LINE, svg_plot
from simharness.planning.room import Room

CAMERA, FIXED, PLACE, VOLUME, OBSTACLE, DOOR = "#d9643a", "#8a63c9", "#3b82c4", "#2e9e6b", "#8b93a1", "#d9a514"
_WIDTH = 7.4  # inches of 72 px
_MARGIN = 0.5  # metres around the room
_REACH = 1.3  # metres: length of the drawn cones
_PAD = (0.75, 0.5)  # inches of a figure that its axes do not fill


def room_from_above(
    name: str, room: Room, *, cameras: Sequence[Camera] = (), places: Floats | None = None, width: float = _WIDTH
) -> str:
    """Draw a room from above.

    Args:
        name: different from the name of every other plot on the page.
        room: the room.
        cameras: cameras of a rig, with their names; those that hang already have another colour.
        places: places where cameras may hang, (n, 3), metres; darker ones are higher.
        width: width of the plot, inches of 72 px.

    Returns:
        An SVG element.
    """
    low, high = room.outline.min(axis=0) - _MARGIN, room.outline.max(axis=0) + _MARGIN
    tall = float((high - low)[1] / (high - low)[0])
    with svg_plot(name, size=(width, (width - _PAD[0]) * tall + _PAD[1])) as (axes, written):
        draw_room(axes, room)
        if places is not None and len(places):
            shade = np.clip(places[:, 2] / room.height, 0.0, 1.0)
            order = np.argsort(places[:, 2])[::-1]  # low ones on top, smaller
            axes.scatter(
                places[order, 0], places[order, 1], s=6 + 22 * shade[order], c=PLACE, alpha=0.35, lw=0, zorder=3,
                label="cameras may hang",
            )  # fmt: skip
        for camera in cameras:
            fixed = any(camera.name == each.name for each in room.fixed)
            draw_camera(axes, camera, color=FIXED if fixed else CAMERA, middle=room.volume.mean(axis=0))
        axes.set(xlabel="x, m", ylabel="y, m", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect("equal")
        axes.spines[:].set_visible(False)
    return written[0]


def draw_room(axes: Axes, room: Room, *, labels: bool = True) -> None:
    """Draw walls, doors, volume and obstacles of a room from above; obstacles with their names and heights."""
    axes.add_patch(Polygon(room.outline, closed=True, fc="none", ec=INK, lw=2.2, joinstyle="miter", zorder=2))
    axes.add_patch(
        Polygon(room.volume, closed=True, fc=VOLUME, ec=VOLUME, alpha=0.16, lw=1.2, zorder=1, label="people")
    )
    axes.add_patch(Polygon(room.volume, closed=True, fc="none", ec=VOLUME, lw=1.0, ls=(0, (4, 3)), zorder=1.1))
    for k, box in enumerate(room.obstacles):
        corners = box.corners[[0, 4, 6, 2], :2]
        axes.add_patch(Polygon(corners, closed=True, fc=OBSTACLE, ec=FAINT, alpha=0.55, lw=0.8, zorder=1.5))
        top = box.center[2] + box.half[2]
        text = f"{room.keys.obstacles[k].name}\n{top:.1f} m".strip()
        if labels:
            axes.text(box.center[0], box.center[1], text, ha="center", va="center", fontsize=7, color=INK, zorder=3)
    for start, end in room.doors:
        axes.plot(*np.stack([start, end]).T, color=DOOR, lw=5.0, solid_capstyle="butt", zorder=2.5)


def draw_camera(axes: Axes, camera: Camera, *, color: str, middle: Floats, reach: float = _REACH) -> None:
    """Draw a camera from above with its name and height, which are written on the side away from ``middle`` (2,)."""
    axes.add_patch(Polygon(cone_from_above(camera, reach), fc=color, ec="none", alpha=0.2, zorder=3.5))
    center = camera.center[:2]
    axes.plot(*center, "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=5)
    away = center - middle
    away = away / max(float(np.linalg.norm(away)), 1e-9)
    place = center + 0.42 * away
    axes.text(
        float(place[0]), float(place[1]), f"{camera.name}\n{camera.center[2]:.1f} m", ha="center", va="center",
        fontsize=7.5, color=INK, zorder=6, linespacing=1.0,
    )  # fmt: skip


def room_from_side(name: str, room: Room, *, cameras: Sequence[Camera] = (), places: Floats | None = None) -> str:
    """Draw a room from the -y side: heights of the places, the volume, obstacles and cameras; arguments as above."""
    (low, _), (high, _) = room.outline.min(axis=0), room.outline.max(axis=0)
    wide = float(high - low) + 2 * _MARGIN
    with svg_plot(name, size=(_WIDTH, (_WIDTH - _PAD[0]) * (room.height + 0.6) / wide + _PAD[1])) as (axes, written):
        axes.add_patch(_rectangle(low, high, 0.0, room.height, fc="none", ec=INK, lw=2.2, zorder=2))
        x = room.volume[:, 0]
        axes.add_patch(
            _rectangle(x.min(), x.max(), 0.0, room.volume_height, fc=VOLUME, ec=VOLUME, alpha=0.16, lw=1.2, zorder=1)
        )
        for box in room.obstacles:
            span, (bottom, top) = box.corners[:, 0], (box.center[2] - box.half[2], box.center[2] + box.half[2])
            axes.add_patch(
                _rectangle(span.min(), span.max(), bottom, top, fc=OBSTACLE, ec=FAINT, alpha=0.5, lw=0.8, zorder=1.5)
            )
        if places is not None and len(places):
            axes.scatter(places[:, 0], places[:, 2], s=10, c=PLACE, alpha=0.25, lw=0, zorder=3)
        for camera in cameras:
            center, forward = camera.center, camera.R[2]
            axes.plot(
                [center[0], center[0] + 0.8 * forward[0]], [center[2], center[2] + 0.8 * forward[2]],
                color=CAMERA, lw=1.6, alpha=0.7, zorder=4,
            )  # fmt: skip
            axes.plot(center[0], center[2], "o", color=CAMERA, ms=5.5, mec="white", mew=0.8, zorder=5)
        axes.set(xlabel="x, m", ylabel="z, m", xlim=(low - _MARGIN, high + _MARGIN), ylim=(-0.2, room.height + 0.4))
        axes.set_aspect("equal")
        axes.grid(axis="y", color=LINE)
        axes.spines[:].set_visible(False)
    return written[0]


def _rectangle(left: float, right: float, bottom: float, top: float, **style: object) -> Polygon:
    corners = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
    return Polygon(corners, closed=True, **style)
