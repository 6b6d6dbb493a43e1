"""People in 3D on a page: a drawing that turns, and the same without scripts, seen from one side."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Floats
from simharness.report.figures.overlay import COCO17_LIMBS
from simharness.report.figures.palette import css, person_color
from simharness.report.study.replay import Replay

MOST_FRAMES = 60
"""That one drawing holds: those around the one that it begins with."""

_YAW, _PITCH = math.radians(-58), math.radians(24)  # from where it is seen at first
_WIDTH, _HEIGHT = 640, 400  # of the drawing without scripts
_MIDDLE = 0.45  # of the height, where the middle of the people is: what is nearer needs more room
_PYRAMID = 0.34  # metres from a camera's centre to the base of its pyramid
_FAR = 3.0  # the eye is so many radii from the middle
_LIMB = 55.0  # millimetres, the thickness of an estimated limb
_CORNERS = ((0, 1), (0, 2), (0, 4), (3, 1), (3, 2), (3, 7), (5, 1), (5, 4), (5, 7), (6, 2), (6, 4), (6, 7))


@dataclass(frozen=True)
class Turnable:
    """A drawing of people in 3D over time.

    Attributes:
        data: what ``turnable.js`` draws: lengths in whole millimetres, null where a joint has no place.
        poster: the frame that it begins with as SVG.
    """

    data: dict[str, Any]
    poster: Markup

    @property
    def json(self) -> Markup:
        """The data for a script element."""
        return Markup(json.dumps(self.data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def turnable(replay: Replay, frame: int) -> Turnable:
    """Draw truth and estimates of a trial, cameras, things and the floor; it begins with ``frame``."""
    frames = _around(frame, len(replay.time))
    scene, rig = replay.trial.scene, replay.trial.shots.believed
    people = len(replay.truth[frame].joints)
    size = replay.trial.scenario.room.size
    center, radius = _extent(np.concatenate([replay.truth[each].joints.reshape(-1, 3) for each in frames]), rig.centers)
    estimates = []
    for each in frames:
        owners = replay.owners(each).tolist()
        estimates.append(
            [[owner, *_joints(joints)] for owner, joints in zip(owners, replay.estimates[each].joints, strict=True)]
        )
    data: dict[str, Any] = {
        "first": frames.start,
        "start": frame - frames.start,
        "time": [round(float(replay.time[each]), 3) for each in frames],
        "edges": COCO17_LIMBS,
        "corners": _CORNERS,
        "truth": [[_joints(joints) for joints in replay.truth[each].joints] for each in frames],
        "estimates": estimates,
        "colors": [css(person_color(person)) for person in range(people)],
        "ghost": css(person_color(-1)),
        "cameras": [_millimetres(pyramid(camera)) for camera in rig],
        "boxes": [_millimetres(solid.hull.corners) for solid in scene.solids if solid.kind != "room"],
        "room": _millimetres(size[:2]),
        "center": _millimetres(center),
        "radius": round(1000 * radius),
        "yaw": round(_YAW, 4),
        "pitch": round(_PITCH, 4),
        "far": _FAR,
        "limb": _LIMB,
        "middle": _MIDDLE,
    }
    return Turnable(data, _poster(data))


def _around(frame: int, count: int) -> range:
    first = min(max(0, frame - MOST_FRAMES // 2), max(0, count - MOST_FRAMES))
    return range(first, min(count, first + MOST_FRAMES))


def _extent(joints: Floats, centers: Floats) -> tuple[Floats, float]:
    """The middle of people's joints (n, 3), and how far it reaches: to all of them and almost to the cameras (V, 3)."""
    known = joints[np.isfinite(joints).all(axis=1)]
    points = known if len(known) else centers
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    center[2] = 0.55
    people, cameras = (np.linalg.norm(each[:, :2] - center[:2], axis=1) for each in (points, centers))
    return center, max(1.5, float(people.max()) + 0.5, 0.75 * float(cameras.max()))


def _joints(joints: Floats) -> list[list[int] | None]:
    return [_millimetres(joint) if np.isfinite(joint).all() else None for joint in joints]


def _millimetres(metres: ArrayLike) -> list[Any]:
    return np.rint(1000 * np.asarray(metres, float)).astype(int).tolist()


def pyramid(camera: Camera) -> Floats:
    """The centre of a camera and the corners of what it sees close by, (5, 3), metres in the world."""
    width, height = camera.size
    pixels = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    local = np.column_stack([pixels, np.ones(4)]) @ np.linalg.inv(camera.K).T * _PYRAMID
    return np.vstack([camera.center, camera.center + local @ camera.R])


def _poster(data: dict[str, Any]) -> Markup:
    """The first view of ``turnable.js`` as SVG."""
    project = _Projection(data)
    lines = [_path(project, _grid(data), "var(--line)", 1.0)]
    boxes = (([box[a], box[b]]) for box in data["boxes"] for a, b in data["corners"])
    lines.append(_path(project, boxes, "var(--faint)", 0.7))
    apexes = (
        ends
        for apex, *base in data["cameras"]
        for corner, following in zip(base, base[1:] + base[:1], strict=True)
        for ends in ([apex, corner], [corner, following])
    )
    lines.append(_path(project, apexes, "var(--faint)", 1.0))
    start = data["start"]
    thick = data["limb"] * project.scale / (data["far"] * data["radius"])
    for owner, *joints in data["estimates"][start]:
        color = data["ghost"] if owner < 0 else data["colors"][owner]
        lines.append(_path(project, _limbs(joints, data), color, max(2.0, thick), opacity=0.6))
    found = {estimate[0] for estimate in data["estimates"][start]}
    for person, joints in enumerate(data["truth"][start]):
        dashed = "" if person in found else ' stroke-dasharray="4 3"'
        lines.append(_path(project, _limbs(joints, data), "currentColor", 1.5, extra=dashed))
    about = "People in 3D: truth in thin lines, estimates in thick ones, cameras as pyramids."
    svg = f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{about}">{"".join(lines)}</svg>'
    return Markup(svg)


class _Projection:
    """The eye of the first view: the arithmetic of ``turnable.js``."""

    def __init__(self, data: dict[str, Any]) -> None:
        yaw, pitch, radius = data["yaw"], data["pitch"], data["radius"]
        self._center = np.array(data["center"], float)
        self._axes = np.array(
            [
                [-math.sin(yaw), math.cos(yaw), 0.0],
                [-math.cos(yaw) * math.sin(pitch), -math.sin(yaw) * math.sin(pitch), math.cos(pitch)],
                [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)],
            ]
        )
        self._far = data["far"] * radius
        self.scale = self._far * min(
            _WIDTH / 2 / (1.2 * radius), _HEIGHT / 2 / (1.1 * radius * math.sin(abs(pitch)) + 1100)
        )

    def __call__(self, point: Sequence[float]) -> tuple[float, float]:
        right, up, near = self._axes @ (np.array(point, float) - self._center)
        grow = self.scale / (self._far - near)
        return _WIDTH / 2 + grow * right, _MIDDLE * _HEIGHT - grow * up


def _grid(data: dict[str, Any]) -> Iterator[list[list[float]]]:
    """Lines on the floor, a metre apart, and its border."""
    half = [side / 2 for side in data["room"]]
    for axis in (0, 1):
        steps = [*range(math.ceil(-half[axis] / 1000) * 1000, int(half[axis]) + 1, 1000), -half[axis], half[axis]]
        for step in steps:
            ends = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
            for end, side in zip(ends, (-1, 1), strict=True):
                end[axis], end[1 - axis] = step, side * half[1 - axis]
            yield ends


def _limbs(joints: Sequence[Any], data: dict[str, Any]) -> Iterator[list[Any]]:
    return ([joints[a], joints[b]] for a, b in data["edges"] if joints[a] and joints[b])


def _path(project: _Projection, lines: Any, color: str, width: float, *, opacity: float = 1.0, extra: str = "") -> str:
    drawn = "".join("M{:.1f} {:.1f}L{:.1f} {:.1f}".format(*project(start), *project(end)) for start, end in lines)
    faded = "" if opacity == 1.0 else f' stroke-opacity="{opacity:g}"'
    return (
        f'<path d="{drawn}" fill="none" stroke="{color}" stroke-width="{width:.1f}"{faded}{extra} '
        'stroke-linecap="round"/>'
    )
