"""Plots of a plan: the room from above and from the side, figures at each place, fewer and more cameras."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Polygon, Rectangle

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.rig_plots import MapLabel, cone_from_above, write_labels
from mvpose.report.svg_plots import FAINT, INK, LINE, svg_plot
from simharness.outputs.planning.rehearsal_plots import draw_cells
from simharness.planning.plan_result import RigPlan
from simharness.planning.planned_room import Room

_COLORS = LinearSegmentedColormap.from_list("quality", ["#b3261e", "#e8a33d", "#f2e3a0", "#7cc4a4", "#1f7a51"])
_UNKNOWN = (0.5, 0.5, 0.5, 0.4)
_SIZE = (5.2, 3.1)
_SIMULATED, _LAYER = "#d9643a", "#3b82c4"
CAMERA, FIXED, PLACE, VOLUME, OBSTACLE, DOOR = "#d9643a", "#8a63c9", "#3b82c4", "#2e9e6b", "#8b93a1", "#d9a514"
_WIDTH, _SIDE_WIDTH = 5.8, 4.9  # inches of 72 px
_MARGIN = 0.5  # metres around the room
_REACH = 1.3  # metres: length of the drawn cones
_PAD = (0.75, 0.5)  # inches of a figure that its axes do not fill


def room_from_above(room: Room, *, cameras: Sequence[Camera] = (), places: Floats | None = None) -> str:
    """Draw a room from above.

    Args:
        room: the room.
        cameras: cameras of a rig, with their names; those that hang already have another colour.
        places: places where cameras may hang, (n, 3), metres; darker ones are higher.

    Returns:
        An SVG element.
    """
    low, high = room.space.bounds[0] - _MARGIN, room.space.bounds[1] + _MARGIN
    tall = float((high - low)[1] / (high - low)[0])
    with svg_plot("above", size=(_WIDTH, (_WIDTH - _PAD[0]) * tall + _PAD[1])) as (axes, written):
        draw_room(axes, room)
        if places is not None and len(places):
            shade = np.clip(places[:, 2] / room.space.height, 0.0, 1.0)
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
    low, high = (end[axis] for end in room.space.bounds)
    wide = float(high - low) + 2 * _MARGIN
    height = (_SIDE_WIDTH - _PAD[0]) * (room.space.height + 0.6) / wide + _PAD[1]
    with svg_plot(name, size=(_SIDE_WIDTH, height)) as (axes, written):
        walls = Rectangle((low, 0.0), high - low, room.space.height, fc="none", ec=INK, lw=2.2, zorder=2)
        left, across = room.volume.outline[:, axis].min(), np.ptp(room.volume.outline[:, axis])
        volume = Rectangle((left, 0.0), across, room.volume.height, color=VOLUME, alpha=0.16, lw=1.2, zorder=1)
        boxes = [
            Rectangle(each.corners[:, [axis, 2]].min(axis=0), *np.ptp(each.corners[:, [axis, 2]], axis=0))
            for each in room.obstacles
        ]
        obstacles = PatchCollection(boxes, fc=OBSTACLE, ec=FAINT, alpha=0.5, lw=0.8, zorder=1.5)
        axes.add_patch(walls)
        axes.add_patch(volume)
        axes.add_collection(obstacles)
        if places is not None and len(places):
            axes.scatter(places[:, axis], places[:, 2], s=10, c=PLACE, alpha=0.25, lw=0, zorder=3)
        for camera in cameras:
            start, end = camera.center, camera.center + 0.8 * camera.R[2]
            color = _color(camera, room)
            axes.plot([start[axis], end[axis]], [start[2], end[2]], color=color, lw=1.6, alpha=0.7, zorder=4)
            axes.plot(start[axis], start[2], "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=5)
        axes.set(xlabel=f"{'xy'[axis]}, m", ylabel="z, m", ylim=(-0.2, room.space.height + 0.4))
        axes.set_xlim(low - _MARGIN, high + _MARGIN)
        axes.set_yticks(np.arange(0.0, room.space.height + 0.1))
        axes.set_aspect("equal")
        axes.grid(axis="y", color=LINE)
        axes.spines[:].set_visible(False)
        down = np.array([0.0, -1.0])
        labels = [MapLabel(each.name, each.center[[axis, 2]], down, size=7.5) for each in cameras]
        frame = np.array([[low, 0.0], [low, room.space.height], [high, room.space.height], [high, 0.0]])
        sights = [np.stack([each.center, each.center + 0.8 * each.R[2]])[:, [axis, 2]] for each in cameras]
        write_labels(axes, labels, lines=[frame, *sights])
    return written[0]


def draw_room(axes: Axes, room: Room) -> None:
    """Draw walls, doors, volume and obstacles of a room from above."""
    axes.add_patch(Polygon(room.space.outline, closed=True, fc="none", ec=INK, lw=2.2, joinstyle="miter", zorder=2))
    axes.add_patch(
        Polygon(room.volume.outline, closed=True, fc=VOLUME, ec=VOLUME, alpha=0.16, lw=1.2, zorder=1, label="people")
    )
    axes.add_patch(Polygon(room.volume.outline, closed=True, fc="none", ec=VOLUME, lw=1.0, ls=(0, (4, 3)), zorder=1.1))
    for box in room.obstacles:
        axes.add_patch(
            Polygon(box.footprint.outline, closed=True, fc=OBSTACLE, ec=FAINT, alpha=0.55, lw=0.8, zorder=1.5)
        )
    for start, end in room.doors:
        axes.plot(*np.stack([start, end]).T, color=DOOR, lw=5.0, solid_capstyle="butt", zorder=2.5)


def draw_camera(axes: Axes, camera: Camera, *, color: str) -> None:
    """Draw a camera from above with its horizontal field of view."""
    axes.add_patch(Polygon(cone_from_above(camera, _REACH), fc=color, ec="none", alpha=0.2, zorder=3.5))
    center = camera.center[:2]
    axes.plot(*center, "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=5)


def place_map(name: str, plan: RigPlan, values: Floats, *, worst: float, best: float, digits: int = 0) -> str:
    """Draw values at the places of the volume, from above.

    Args:
        name: different from the name of every other plot on the page.
        plan: the plan.
        values: value at each place of its prediction, (P,).
        worst: value of the worst colour.
        best: value of the best colour.
        digits: digits of the written values.
    """
    low, high = plan.room.space.bounds[0] - 0.3, plan.room.space.bounds[1] + 0.3
    tall = float((high - low)[1] / (high - low)[0])
    with svg_plot(name, size=(_SIZE[0], _SIZE[0] * tall)) as (axes, written):
        draw_room(axes, plan.room)
        shares = np.where(np.isfinite(values), np.clip((values - worst) / (best - worst), 0.0, 1.0), np.nan)
        colors = np.array([_COLORS(share) if np.isfinite(share) else _UNKNOWN for share in shares])
        draw_cells(axes, plan.prediction.places, values, colors, digits=digits)
        for camera in plan.rig:
            axes.plot(*camera.center[:2], "o", color=CAMERA, ms=5, mec="white", mew=0.7, zorder=5)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect("equal")
        axes.axis("off")
    return written[0]


def buying_curve(plan: RigPlan) -> str:
    """Plot the PCP and the share of the volume within the target against the number of cameras."""
    with svg_plot("curve", size=_SIZE) as (axes, written):
        counts = [point.cameras for point in plan.curve]
        axes.plot(counts, [point.figures.pcp.mean for point in plan.curve], "o-", color=_LAYER, ms=5, label="PCP")
        axes.plot(
            counts, [point.figures.share for point in plan.curve], "s--", color=CAMERA, ms=4.5,
            label="share of the volume within the target",
        )  # fmt: skip
        axes.axvline(len(plan.rig), color=LINE, lw=1.2, zorder=0)
        axes.set(xlabel="cameras", ylabel="%")
        axes.set_ylim(top=100.5)
        axes.set_xticks(counts)
        axes.grid(axis="y")
        axes.legend(loc="lower right", labelcolor=INK)
    return written[0]


def rig_bars(plan: RigPlan) -> str:
    """Plot PCP of the plan, of the next best rigs and of usual ones: by the fast layer and by simulation."""
    rows = plan.alternatives
    with svg_plot("bars", size=(_SIZE[0], 0.6 + 0.42 * len(rows))) as (axes, written):
        for k, each in enumerate(rows):
            y = len(rows) - 1 - k
            axes.plot(
                each.predicted.pcp.mean, y + 0.13, "o", color=_LAYER, ms=5, label="fast layer" if k == 0 else None
            )
            if each.simulated is not None:
                pcp = each.simulated.pcp
                axes.plot([pcp.low, pcp.high], [y - 0.13] * 2, color=_SIMULATED, lw=2, alpha=0.6)
                axes.plot(pcp.mean, y - 0.13, "o", color=_SIMULATED, ms=5, label="simulation" if k == 0 else None)
        axes.set_yticks(range(len(rows)), [each.title for each in reversed(rows)], color=INK)
        axes.set(xlabel="PCP, %", ylim=(-0.6, len(rows) - 0.4))
        axes.grid(axis="x")
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2, labelcolor=INK)
        axes.spines["left"].set_color(FAINT)
    return written[0]


def _color(camera: Camera, room: Room) -> str:
    """Return the colour of a camera: those that hang already have another one."""
    return FIXED if any(camera.name == each.name for each in room.fixed) else CAMERA


def _label(axes: Axes, room: Room, cameras: Sequence[Camera]) -> None:
    """Write names and heights of obstacles and cameras, where they hide neither walls nor each other."""
    middle = room.volume.outline.mean(axis=0)
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
            np.vstack([room.space.outline, room.space.outline[:1]]),
            np.vstack([room.volume.outline, room.volume.outline[:1]]),
            *(cone_from_above(camera, _REACH)[[1, 0, 2]] for camera in cameras),
        ],
        areas=[(corners.min(axis=0), corners.max(axis=0)) for corners in boxes],
    )
