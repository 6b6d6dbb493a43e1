"""3D view of a rig: frusta of the cameras, the volume, and the part of it that meets the target.

The reader turns it with the mouse; without scripts, and in print, a still drawing is shown.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Floats
from simharness.outputs.planning.rehearsal_plots import EXTRA, GOOD, corners_of, outline_of
from simharness.planning.rehearsal_result import Rehearsal
from simharness.planning.sentences import grid_spacing
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.lenses import intrinsics

_REACH = 1.4  # metres: length of the drawn frusta
_YAW, _PITCH = np.radians(-58.0), np.radians(26.0)  # first viewing direction
_FAR = 3.6  # from the eye to the middle, in radii
_STILL = (720, 470)  # px
_FOV = 40.0  # degrees, of the still drawing


@dataclass(frozen=True)
class RigView3D:
    """A 3D view of a rig.

    Attributes:
        data: input of ``rig_view_3d.js``, lengths in whole millimetres.
        still: the same as SVG.
    """

    data: dict[str, Any]
    still: Markup

    @property
    def json(self) -> Markup:
        """The data as JSON for a script element."""
        return Markup(json.dumps(self.data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def rig_view_3d(rehearsal: Rehearsal) -> RigView3D:
    """Return the view of a rehearsal."""
    rig, volume, height = rehearsal.rig, rehearsal.volume.outline, rehearsal.volume.height
    points = np.concatenate([volume, rig.centers[:, :2], rehearsal.room])
    center = np.array([*(points.min(axis=0) + points.max(axis=0)) / 2, height / 2])
    radius = max(1.5, float(np.linalg.norm(points - center[:2], axis=1).max()))
    places = rehearsal.prediction.places
    spacing = grid_spacing(places)
    corner = spacing / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    tiles = [np.array([*place, 0.0]) + corner for place in places[rehearsal.good]]
    sides = _upright(outline_of(places, rehearsal.good), height)
    frusta = [frustum(camera) for camera in rig]
    extra = [] if rehearsal.extra is None else [frustum(rehearsal.extra.camera)]
    edges = _prism(volume, height)
    boxes = [line for each in rehearsal.obstacles for line in _box(corners_of(each))]
    room = [] if not len(rehearsal.room) else _loop(rehearsal.room, 0.0)
    data: dict[str, Any] = {
        "lines": _groups(
            (_floor(points), "--line", 1.0),
            (room, "--faint", 2.0),
            (boxes, "--faint", 1.0),
            (edges, "--ink", 1.2),
            (sides, GOOD, 1.8),
            ([line for each in frusta for line in _pyramid(each)], "--accent", 1.1),
            ([line for each in extra for line in _pyramid(each)], EXTRA, 1.3),
        ),
        "tiles": [_millimetres(tile) for tile in tiles],
        "tile": GOOD,
        "names": [[camera.name, _millimetres(camera.center)] for camera in rig],
        "center": _millimetres(center),
        "radius": round(1000 * radius),
        "yaw": round(float(_YAW), 4),
        "pitch": round(float(_PITCH), 4),
        "far": _FAR,
    }
    return RigView3D(data, _still(data, center, radius))


def frustum(camera: Camera) -> Floats:
    """Return the centre of a camera and the corners of its picture at a distance of 1.4 m, (5, 3), metres."""
    width, height = camera.size
    pixels = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    local = np.column_stack([pixels, np.ones(4)]) @ np.linalg.inv(camera.K).T
    return np.vstack([camera.center, camera.center + _REACH * local @ camera.R])


def _pyramid(frustum: Floats) -> list[Floats]:
    apex, base = frustum[0], frustum[1:]
    return [np.stack([apex, corner]) for corner in base] + _closed(base)


def _closed(points: Floats) -> list[Floats]:
    return list(np.stack([points, np.roll(points, -1, axis=0)], axis=1))


def _loop(outline: Floats, height: float) -> list[Floats]:
    return _closed(np.column_stack([outline, np.full(len(outline), height)]))


def _prism(outline: Floats, height: float) -> list[Floats]:
    posts = [np.array([[*corner, 0.0], [*corner, height]]) for corner in outline]
    return [*_loop(outline, 0.0), *_loop(outline, height), *posts]


def _box(corners: Floats) -> list[Floats]:
    """Return the edges of a box with corners (8, 3), those of its floor before those of its top."""
    return [*_closed(corners[:4]), *_closed(corners[4:]), *(corners[[k, k + 4]] for k in range(4))]


def _upright(lines: list[Floats], height: float) -> list[Floats]:
    """Return lines of the floor on the floor and at a height, with posts where they begin."""
    result = []
    for line in lines:
        low, high = (np.column_stack([line, np.full(2, at)]) for at in (0.0, height))
        result += [low, high]
    corners = {tuple(np.round(end, 6)) for line in lines for end in line}
    turning = {
        corner
        for corner in corners
        if len({tuple(np.abs(np.sign(np.round(line[1] - line[0], 6)))) for line in lines if _ends(line, corner)}) > 1
    }
    return result + [np.array([[*corner, 0.0], [*corner, height]]) for corner in sorted(turning)]


def _ends(line: Floats, corner: tuple[float, ...]) -> bool:
    return any(np.allclose(end, corner, atol=1e-5) for end in line)


def _floor(points: Floats) -> list[Floats]:
    """Return the lines of a grid of one metre under points (n, 2)."""
    low, high = np.floor(points.min(axis=0)) - 0.0, np.ceil(points.max(axis=0))
    lines = []
    for x in np.arange(low[0], high[0] + 0.5):
        lines.append(np.array([[x, low[1], 0.0], [x, high[1], 0.0]]))
    for y in np.arange(low[1], high[1] + 0.5):
        lines.append(np.array([[low[0], y, 0.0], [high[0], y, 0.0]]))
    return lines


def _groups(*groups: tuple[list[Floats], str, float]) -> list[dict[str, Any]]:
    return [
        {"color": color, "width": width, "at": [_millimetres(line) for line in lines]}
        for lines, color, width in groups
        if lines
    ]


def _millimetres(metres: ArrayLike) -> list[Any]:
    return np.rint(1000 * np.asarray(metres, float)).astype(int).tolist()


def _still(data: dict[str, Any], center: Floats, radius: float) -> Markup:
    width, height = _STILL
    toward = np.array([np.cos(_PITCH) * np.cos(_YAW), np.cos(_PITCH) * np.sin(_YAW), np.sin(_PITCH)])
    eye = look_at(center + _FAR * radius * toward, center, K=intrinsics(_FOV, _STILL), size=_STILL)

    def project(points: Any) -> Floats:
        return eye.project(np.asarray(points, float) / 1000)

    tiles = "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in project(tile)) + "Z" for tile in data["tiles"])
    drawn = [f'<path d="{tiles}" fill="{GOOD}" fill-opacity="0.22"/>'] if tiles else []
    for group in data["lines"]:
        drawn.append(_path([project(line) for line in group["at"]], _css(group["color"]), group["width"]))
    for name, place in data["names"]:
        x, y = project([place])[0]
        drawn.append(
            f'<text x="{x:.1f}" y="{y - 7:.1f}" font-size="13" text-anchor="middle" fill="currentColor">'
            f"{Markup.escape(name)}</text>"
        )
    label = "The rig in 3D: frusta of the cameras, the volume, and the part of it that meets the target in green."
    return Markup(f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{label}">{"".join(drawn)}</svg>')


def _css(color: str) -> str:
    return "currentColor" if color == "--ink" else f"var({color})" if color.startswith("--") else color


def _path(lines: Iterable[Floats], color: str, width: float) -> str:
    drawn = "".join(f"M{x:.1f} {y:.1f}L{right:.1f} {down:.1f}" for (x, y), (right, down) in lines)
    return f'<path d="{drawn}" fill="none" stroke="{color}" stroke-width="{width:.1f}" stroke-linecap="round"/>'
