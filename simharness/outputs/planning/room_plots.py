"""Room from above and from the side, with the places for cameras, obstacles, doors, the volume, and a rig."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.map_labels import MapLabel, write_labels
from mvpose.report.rig_plots import cone_from_above
from mvpose.report.svg_plots import FAINT, INK, LINE, svg_plot
from simharness.planning.room import Room

CAMERA, FIXED, PLACE, VOLUME, OBSTACLE, DOOR = "#d9643a", "#8a63c9", "#3b82c4", "#2e9e6b", "#8b93a1", "#d9a514"
_WIDTH, _SIDE_WIDTH = 5.8, 4.9  # inches of 72 px
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
            draw_camera(axes, camera, color=_color(camera, room))
        axes.set(xlabel="x, m", ylabel="y, m", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect("equal")
        axes.spines[:].set_visible(False)
        _label(axes, room, cameras)
    return written[0]


def _color(camera: Camera, room: Room) -> str:
    """Return the colour of a camera: those that hang already have another one."""
    return FIXED if any(camera.name == each.name for each in room.fixed) else CAMERA


def _label(axes: Axes, room: Room, cameras: Sequence[Camera]) -> None:
    """Write names and heights of obstacles and cameras, where they hide neither walls nor each other."""
    middle = room.volume.mean(axis=0)
    labels = []
    for box, keys in zip(room.obstacles, room.keys.obstacles, strict=True):
        text = f"{keys.name}\n{box.center[2] + box.half[2]:.1f} m".strip()
        place = np.array(box.center[:2])
        labels.append(MapLabel(text, place, middle - place, size=7.0))
    for camera in cameras:
        text = f"{camera.name}\n{camera.center[2]:.1f} m"
        labels.append(MapLabel(text, camera.center[:2], camera.center[:2] - middle, size=7.5))
    boxes = [box.corners[:, :2] for box in room.obstacles]
    write_labels(
        axes,
        labels,
        lines=[
            np.vstack([room.outline, room.outline[:1]]),
            np.vstack([room.volume, room.volume[:1]]),
            *(cone_from_above(camera, _REACH)[[1, 0, 2]] for camera in cameras),
        ],
        areas=[(corners.min(axis=0), corners.max(axis=0)) for corners in boxes],
    )


def draw_room(axes: Axes, room: Room) -> None:
    """Draw walls, doors, volume and obstacles of a room from above."""
    axes.add_patch(Polygon(room.outline, closed=True, fc="none", ec=INK, lw=2.2, joinstyle="miter", zorder=2))
    axes.add_patch(
        Polygon(room.volume, closed=True, fc=VOLUME, ec=VOLUME, alpha=0.16, lw=1.2, zorder=1, label="people")
    )
    axes.add_patch(Polygon(room.volume, closed=True, fc="none", ec=VOLUME, lw=1.0, ls=(0, (4, 3)), zorder=1.1))
    for box in room.obstacles:
        corners = box.corners[[0, 4, 6, 2], :2]
        axes.add_patch(Polygon(corners, closed=True, fc=OBSTACLE, ec=FAINT, alpha=0.55, lw=0.8, zorder=1.5))
    for start, end in room.doors:
        axes.plot(*np.stack([start, end]).T, color=DOOR, lw=5.0, solid_capstyle="butt", zorder=2.5)


def draw_camera(axes: Axes, camera: Camera, *, color: str, reach: float = _REACH) -> None:
    """Draw a camera from above with its horizontal field of view."""
    axes.add_patch(Polygon(cone_from_above(camera, reach), fc=color, ec="none", alpha=0.2, zorder=3.5))
    center = camera.center[:2]
    axes.plot(*center, "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=5)


def room_from_side(
    name: str, room: Room, *, axis: int = 0, cameras: Sequence[Camera] = (), places: Floats | None = None
) -> str:
    """Draw a room from one side: heights of the places, the volume, obstacles and cameras.

    Args:
        name: different from the name of every other plot on the page.
        room: the room.
        axis: horizontal axis of the drawing, 0 (x) or 1 (y).
        cameras: cameras of a rig.
        places: places where cameras may hang, (n, 3), metres.

    Returns:
        An SVG element.
    """
    low, high = room.outline[:, axis].min(), room.outline[:, axis].max()
    wide = float(high - low) + 2 * _MARGIN
    height = (_SIDE_WIDTH - _PAD[0]) * (room.height + 0.6) / wide + _PAD[1]
    with svg_plot(name, size=(_SIDE_WIDTH, height)) as (axes, written):
        axes.add_patch(_rectangle(low, high, 0.0, room.height, fc="none", ec=INK, lw=2.2, zorder=2))
        along = room.volume[:, axis]
        axes.add_patch(
            _rectangle(
                along.min(), along.max(), 0.0, room.volume_height, fc=VOLUME, ec=VOLUME, alpha=0.16, lw=1.2, zorder=1
            )
        )
        for box in room.obstacles:
            span, (bottom, top) = box.corners[:, axis], (box.center[2] - box.half[2], box.center[2] + box.half[2])
            axes.add_patch(
                _rectangle(span.min(), span.max(), bottom, top, fc=OBSTACLE, ec=FAINT, alpha=0.5, lw=0.8, zorder=1.5)
            )
        if places is not None and len(places):
            axes.scatter(places[:, axis], places[:, 2], s=10, c=PLACE, alpha=0.25, lw=0, zorder=3)
        for camera in cameras:
            start, end = camera.center, camera.center + 0.8 * camera.R[2]
            color = _color(camera, room)
            axes.plot([start[axis], end[axis]], [start[2], end[2]], color=color, lw=1.6, alpha=0.7, zorder=4)
            axes.plot(start[axis], start[2], "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=5)
        axes.set(xlabel=f"{'xy'[axis]}, m", ylabel="z, m", ylim=(-0.2, room.height + 0.4))
        axes.set_xlim(low - _MARGIN, high + _MARGIN)
        axes.set_yticks(np.arange(0.0, room.height + 0.1))
        axes.set_aspect("equal")
        axes.grid(axis="y", color=LINE)
        axes.spines[:].set_visible(False)
        down = np.array([0.0, -1.0])
        labels = [MapLabel(each.name, each.center[[axis, 2]], down, size=7.5) for each in cameras]
        frame = np.array([[low, 0.0], [low, room.height], [high, room.height], [high, 0.0]])
        sights = [np.stack([each.center, each.center + 0.8 * each.R[2]])[:, [axis, 2]] for each in cameras]
        write_labels(axes, labels, lines=[frame, *sights])
    return written[0]


def _rectangle(left: float, right: float, bottom: float, top: float, **style: object) -> Polygon:
    corners = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
    return Polygon(corners, closed=True, **style)
