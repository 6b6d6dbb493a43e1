"""Drawings and plots of the doctor's page, as SVG.

Over pictures: residual arrows of a camera, epipolar lines of a pair. Plots: the rig from above before and after, and
clock offsets with their intervals.
"""

import html
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.calibration.sightings import Sightings
from mvpose.camera import Camera, Rig
from mvpose.report.overlay import USUAL_HEIGHT
from mvpose.report.palette import limbs_of
from mvpose.report.rig_plots import camera_from_above, cone_from_above, fit_view, name_cameras
from mvpose.report.svg_plots import FAINT, INK, VARIANT_COLORS, legend_above, svg_plot

_DEPTHS = np.geomspace(0.3, 60.0, 160)  # metres along a ray, of the points that a line is drawn through
_MOST_LINES = len(VARIANT_COLORS)  # in a pair of pictures: more hide each other
_INEXACT = 0.1  # OKS sigma of joints that are not drawn
_NICE = (1.0, 2.0, 5.0)  # leading digits of factors
_ARROW = 0.16  # of the width of the picture: length of a long arrow
_WIDE = 1280.0  # pixels: width of a picture in which arrows have the sizes below


_MARGIN = 0.7  # metres
_LONGEST, _WIDEST = 0.09, np.radians(25.0)  # of the plot, and angle: how far the largest correction is exaggerated
_TALL = 1.08  # height over width of the plot from above
_MOST_POINTS = 600


@dataclass(frozen=True)
class Field:
    """Mean residual field of one camera: places (c, 2) and offsets (c, 2), pixels."""

    places: Floats
    offsets: Floats


def exaggeration(fields: Sequence[tuple[Field, float]]) -> float:
    """Return one factor for the arrows of all cameras, 1, 2, 5, 10, ..., with which the long ones are easy to see.

    Args:
        fields: fields with the widths of their pictures, pixels.
    """
    relative = [np.hypot(*field.offsets.T) / width for field, width in fields if len(field.offsets)]
    if not relative:
        return 1.0
    return nice_factor(_ARROW / max(float(np.quantile(np.concatenate(relative), 0.9)), 1e-9))


def nice_factor(factor: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... up to a factor, at least 1."""
    if factor <= 1.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(factor) + 1e-9)
    return float(max(digit * power for digit in _NICE if digit * power <= factor * (1 + 1e-9)))


def draw_field(camera: Camera, field: Field, *, kind: str, factor: float) -> Iterator[str]:
    """Yield the arrows of a residual field, from where the other cameras place the joints to where they were detected.

    Args:
        camera: the camera.
        field: its residuals.
        kind: class of the arrows in the style sheet, "before" or "after".
        factor: by which the arrows are longer than the residuals.
    """
    unit = camera.size[0] / _WIDE  # all pictures are shown with the same width
    head = 16.0 * unit
    path = ""
    for (x, y), offset in zip(field.places.tolist(), factor * field.offsets, strict=True):
        length = float(np.hypot(*offset))
        end_x, end_y = x + float(offset[0]), y + float(offset[1])
        path += f"M{x:.1f} {y:.1f}L{end_x:.1f} {end_y:.1f}"
        if length > head:
            along = offset / length * head
            for turn in (0.45, -0.45):
                back_x = end_x - along[0] * math.cos(turn) + along[1] * math.sin(turn)
                back_y = end_y - along[0] * math.sin(turn) - along[1] * math.cos(turn)
                path += f"M{end_x:.1f} {end_y:.1f}L{back_x:.1f} {back_y:.1f}"
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{4 * unit:.2g}"/>' for x, y in field.places.tolist())
    yield f'<g class="field {kind}"><path d="{path}" stroke-width="{4.5 * unit:.3g}"/>{dots}</g>'


@dataclass(frozen=True)
class MatchedJoint:
    """A joint that two views detected in a frame: its pixels in both, (2,), and its name."""

    frame: int
    first: Floats
    second: Floats
    name: str


def matched_joints(sightings: Sightings, pair: tuple[int, int], rig: Rig) -> list[MatchedJoint]:
    """Return joints of one frame that both views of a pair detected, far from each other in the second picture.

    The frame is that with the most people in both views, and then with the most joints. Hips and the like, whose place
    detectors find least exactly, are left out.

    Args:
        sightings: keypoints matched over views.
        pair: the two views.
        rig: the cameras.
    """
    exact = np.array(sightings.skeleton.sigmas)[sightings.joint] < _INEXACT
    keys = list(zip(*(each.tolist() for each in (sightings.frame, sightings.person, sightings.joint)), strict=True))
    first, second = ({keys[k]: k for k in np.flatnonzero(exact & (sightings.view == view)).tolist()} for view in pair)
    frames: dict[int, list[tuple[int, int, int]]] = {}
    for key, k in second.items():
        if key in first and (sightings.pixels[k] >= 0).all() and (sightings.pixels[k] < rig[pair[1]].size).all():
            frames.setdefault(key[0], []).append(key)
    if not frames:
        return []
    best = max(frames.values(), key=lambda keys: (len({person for _, person, _ in keys}), len(keys)))
    chosen = _far_apart(np.array([sightings.pixels[second[key]] for key in best]))
    return [
        MatchedJoint(
            best[k][0],
            sightings.pixels[first[best[k]]],
            sightings.pixels[second[best[k]]],
            sightings.skeleton.joints[best[k][2]].replace("_", " "),
        )
        for k in chosen
    ]


def draw_bodies(camera: Camera, sightings: Sightings, frame: int, view: int) -> Iterator[str]:
    """Yield everybody who was detected in a picture as thin limbs."""
    here = (sightings.frame == frame) & (sightings.view == view)
    edges, unit = limbs_of(sightings.skeleton), camera.size[1] / USUAL_HEIGHT
    path = ""
    for person in np.unique(sightings.person[here]):
        rows = np.flatnonzero(here & (sightings.person == person))
        place = dict(zip(sightings.joint[rows].tolist(), sightings.pixels[rows].tolist(), strict=True))
        path += "".join(
            f"M{place[a][0]:.1f} {place[a][1]:.1f}L{place[b][0]:.1f} {place[b][1]:.1f}"
            for a, b in edges
            if a in place and b in place
        )
    yield f'<path class="body" d="{path}" stroke-width="{1.6 * unit:.3g}"/>'


def _far_apart(points: Floats) -> list[int]:
    """Return the indices of at most :data:`_MOST_LINES` points, each the farthest from those before."""
    chosen = [int(np.argmin(points[:, 1]))]
    while len(chosen) < min(_MOST_LINES, len(points)):
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=-1).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    return chosen


def epipolar_curve(first: Camera, second: Camera, pixel: Floats) -> Floats:
    """Return the image in the second camera of the ray of a pixel of the first, (k, 2), pixels; NaN where not seen.

    It is a line where the second lens has no distortion.
    """
    ray = first.rays(pixel)
    return second.project(first.center + _DEPTHS[:, None] * ray)


def draw_joints(camera: Camera, joints: Sequence[MatchedJoint], *, second: bool) -> Iterator[str]:
    """Yield the joints of a pair in one of its pictures as numbered dots."""
    unit = camera.size[1] / USUAL_HEIGHT
    for number, joint in enumerate(joints):
        x, y = (joint.second if second else joint.first).tolist()
        color = VARIANT_COLORS[number]
        yield (
            f'<g class="joint"><circle cx="{x:.1f}" cy="{y:.1f}" r="{6 * unit:.3g}" style="fill: {color}" '
            f'stroke-width="{1.5 * unit:.3g}"><title>{html.escape(joint.name)}</title></circle>'
            f'<text x="{x + 10 * unit:.1f}" y="{y - 8 * unit:.1f}" font-size="{19 * unit:.3g}">{number + 1}</text></g>'
        )


def draw_lines(first: Camera, second: Camera, joints: Sequence[MatchedJoint], *, kind: str) -> Iterator[str]:
    """Yield the epipolar lines of joints of the first camera in the picture of the second."""
    unit = second.size[1] / USUAL_HEIGHT
    size = np.array(second.size)
    for number, joint in enumerate(joints):
        curve = epipolar_curve(first, second, joint.first)
        with np.errstate(invalid="ignore"):
            near = ((curve > -size) & (curve < 2 * size)).all(axis=1)
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in curve[near].tolist())
        color = VARIANT_COLORS[number]
        yield f'<polyline class="line {kind}" points="{points}" stroke="{color}" stroke-width="{2 * unit:.3g}"/>'


def distance_from_line(first: Camera, second: Camera, joint: MatchedJoint) -> float:
    """Return the distance of a joint in the second picture from the epipolar line of the first, pixels; NaN if none."""
    curve = epipolar_curve(first, second, joint.first)
    known = curve[np.isfinite(curve).all(axis=1)]
    if len(known) < 2:
        return math.nan
    start, step = known[:-1], np.diff(known, axis=0)
    length2 = np.maximum((step**2).sum(axis=1), 1e-12)
    along = np.clip(((joint.second - start) * step).sum(axis=1) / length2, 0.0, 1.0)
    return float(np.linalg.norm(start + along[:, None] * step - joint.second, axis=1).min())


def best_partner(sightings: Sightings, view: int, rig: Rig) -> int | None:
    """Return the view whose epipolar lines in a view say the most about it: its joints are the farthest off them.

    Only views that share at least half as many joints with it as another one does are considered.
    """
    points, count = sightings.points
    seen = np.zeros((count, len(rig)), bool)
    seen[points, sightings.view] = True
    shared = seen[seen[:, view]].sum(axis=0)
    shared[view] = 0
    if not shared.any():
        return None
    candidates = np.flatnonzero(2 * shared >= shared.max()).tolist()
    return max(candidates, key=lambda other: _median_distance(rig, sightings, (other, view)))


def _median_distance(rig: Rig, sightings: Sightings, pair: tuple[int, int]) -> float:
    joints = matched_joints(sightings, pair, rig)
    distances = [distance_from_line(rig[pair[0]], rig[pair[1]], joint) for joint in joints]
    known = [distance for distance in distances if math.isfinite(distance)]
    return float(np.median(known)) if known else -1.0


BEFORE, AFTER = "#d9643a", "#3b82c4"
"""Colours of what the calibration has and of what the doctor finds; safe for colour-blind readers, light and dark."""


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
    turns = [Rotation.from_matrix(b.R @ a.R.T).magnitude() for a, b in zip(before, after, strict=True)]
    extent = float(np.ptp(before.centers[:, :2], axis=0).max()) + 2 * _MARGIN
    return nice_factor(min(_LONGEST * extent / max(float(moved), 1e-9), _WIDEST / max(*turns, 1e-9), 100.0))


def exaggerated(before: Camera, after: Camera, factor: float) -> Camera:
    """Return a camera whose rotation and centre differ from ``before`` by ``factor`` times as much as ``after``."""
    turn = Rotation.from_matrix(after.R @ before.R.T).as_rotvec() * factor
    R = Rotation.from_rotvec(turn).as_matrix() @ before.R
    center = before.center + factor * (after.center - before.center)
    return Camera(after.K, R, -R @ center, after.distortion, after.size, after.name)


def rig_from_above(rig: Rig, *, repaired: Rig | None, moved: Sequence[int], points: Floats, factor: float) -> str:
    """Plot the rig from above: all cameras, those that moved before and after, and where people were.

    Args:
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
    with svg_plot("rig-from-above", size=(5.2, 5.2 * _TALL)) as (axes, written):
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


def clock_offsets(offsets: Sequence[ClockOffset]) -> str:
    """Plot the offset of each camera's clock with its 90 % interval, ms."""
    with svg_plot("clock-offsets", size=(5.2, 0.9 + 0.34 * len(offsets))) as (axes, written):
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
