"""3D view of people on a page: the reader turns it with the mouse; without scripts a still drawing is shown."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.limbs import COCO17_LIMBS
from mvpose.report.palette import css, person_color
from simharness.outputs.study.body_parts import CAPSULES, HEAD, NECK, TRUNK, body_parts
from simharness.outputs.study.replay import Replay
from simharness.outputs.study.room_view import RoomView, camera_pyramid

MAX_FRAMES = 60
"""Frames of one view: those around the frame that it shows first."""

_YAW, _PITCH = math.radians(-58), math.radians(24)  # first viewing direction
_MIDDLE = 0.45  # share of the height at which the middle of the people is: nearer people need more room
_DISTANCE = 3.0  # from the eye to the middle of the people, in radii
_BOX_EDGES = ((0, 1), (0, 2), (0, 4), (3, 1), (3, 2), (3, 7), (5, 1), (5, 4), (5, 7), (6, 2), (6, 4), (6, 7))
_STILL_SIZE = (640, 400)  # of the still drawing
_RIM = 0.72  # width of the light middle of a limb, as a share of the whole


@dataclass(frozen=True)
class SkeletonView3D:
    """A 3D view of people over time.

    Attributes:
        data: input of ``skeleton_view_3d.js``: lengths in whole millimetres, null for a joint without a position.
        still: the first frame as SVG, for readers without scripts.
    """

    data: dict[str, Any]
    still: Markup

    @property
    def json(self) -> Markup:
        """The data as JSON for a script element."""
        return Markup(json.dumps(self.data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def skeleton_view_3d(replay: Replay, frame: int) -> SkeletonView3D:
    """Return a view of the truth, the estimates, the cameras, the objects and the floor of a trial.

    Args:
        replay: the trial.
        frame: frame that the view shows first.
    """
    frames = _frames_around(frame, len(replay.time))
    scene, rig = replay.trial.scene, replay.trial.exposures.believed_rig
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
        "corners": _BOX_EDGES,
        "truth": [[_joints(joints) for joints in replay.truth[each].joints] for each in frames],
        "estimates": estimates,
        "colors": [css(person_color(person)) for person in range(people)],
        "ghost": css(person_color(-1)),
        "cameras": [_millimetres(camera_pyramid(camera)) for camera in rig],
        "boxes": [_millimetres(solid.hull.corners) for solid in scene.solids if solid.kind != "room"],
        "room": _millimetres(size[:2]),
        "center": _millimetres(center),
        "radius": round(1000 * radius),
        "yaw": round(_YAW, 4),
        "pitch": round(_PITCH, 4),
        "far": _DISTANCE,
        "capsules": CAPSULES,
        "trunk": TRUNK,
        "head": HEAD,
        "neck": NECK,
        "middle": _MIDDLE,
    }
    return SkeletonView3D(data, _still(replay, frame))


def _frames_around(frame: int, count: int) -> range:
    """Return up to :data:`MAX_FRAMES` frames of ``count`` with ``frame`` among them, in the middle where possible."""
    first = min(max(0, frame - MAX_FRAMES // 2), max(0, count - MAX_FRAMES))
    return range(first, min(count, first + MAX_FRAMES))


def _extent(joints: Floats, centers: Floats) -> tuple[Floats, float]:
    """Return the middle of the people's joints (n, 3) and a radius around it, metres.

    The radius reaches all joints, and almost to the cameras' centres (V, 3).
    """
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


def _still(replay: Replay, frame: int) -> Markup:
    """Return one frame as SVG, seen from outside the room."""
    view = RoomView(replay, frame, _STILL_SIZE)
    scene, size = replay.trial.scene, np.array(replay.trial.scenario.room.size[:2])
    floor = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*size / 2, 0]
    boxes = [view.eye.project(solid.hull.corners) for solid in scene.solids if solid.kind != "room"]
    paths = [
        _path(_outline(view.eye.project(floor)), "var(--line)", 1.0),
        _path([box[list(edge)] for box in boxes for edge in _BOX_EDGES], "var(--faint)", 0.7),
        _path([line for apex, *base in view.cameras for line in _pyramid_lines(apex, base)], "var(--faint)", 1.0),
    ]
    owners = replay.owners(frame).tolist()
    truth, estimates = replay.truth[frame].joints, replay.estimates[frame].joints
    bodies = [(joints, css(person_color(owner))) for owner, joints in zip(owners, estimates, strict=True)]
    bodies += [(joints, "") for person, joints in enumerate(truth) if person not in owners]
    paths += _bodies(view.eye, bodies)
    for person, joints in enumerate(view.truth):
        paths.append(_path(_limbs(joints), "currentColor", 1.5, "" if person in owners else ' stroke-dasharray="4 3"'))
    width, height = _STILL_SIZE
    label = "People in 3D: estimates as bodies, truth as thin lines, cameras as pyramids."
    return Markup(f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{label}">{"".join(paths)}</svg>')


def _bodies(eye: Camera, bodies: Sequence[tuple[Floats, str]]) -> list[str]:
    """Return bodies as SVG, the nearest parts last: joints (J, 3) and a colour each, "" for a person who was missed."""
    parts = [(points, radius, color) for joints, color in bodies for points, radius in body_parts(joints)]
    depths = [float(eye.depth(points).mean()) for points, _, _ in parts]
    drawn = []
    for index in np.argsort(depths)[::-1].tolist():
        points, radius, color = parts[index]
        corners = " ".join(f"{x:.1f} {y:.1f}" for x, y in eye.project(points))
        closed = "Z" if len(points) > 2 else f"L{corners}" if len(points) == 1 else ""  # a line of no length is a dot
        width = 2 * radius * float(eye.K[0, 0]) / depths[index]
        shape = f'd="M{corners}{closed}" stroke-linecap="round" stroke-linejoin="round"'
        rim, middle = (_shade(color, -0.28), color) if color else ("var(--faint)", "var(--line)")
        for tone, share in ((rim, 1.0), (middle, _RIM)):
            drawn.append(f'<path {shape} fill="{tone}" stroke="{tone}" stroke-width="{share * width:.1f}"/>')
    return drawn


def _shade(color: str, change: float) -> str:
    """Return a colour "#rrggbb" that is darker by a share."""
    parts = (round((1 + change) * int(color[at : at + 2], 16)) for at in (1, 3, 5))
    return "#" + "".join(f"{part:02x}" for part in parts)


def _outline(corners: Floats) -> list[Floats]:
    """Return the sides of a polygon (n, 2), each (2, 2)."""
    return list(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))


def _pyramid_lines(apex: Floats, base: Sequence[Floats]) -> list[Floats]:
    """Return the eight lines of a camera's pyramid, each (2, 2)."""
    return [*(np.stack([apex, corner]) for corner in base), *_outline(np.stack(base))]


def _limbs(joints: Floats) -> list[Floats]:
    """Return the limbs whose two joints (J, 2) have a position, each (2, 2)."""
    known = np.asarray(np.isfinite(joints).all(axis=1))
    return [joints[[a, b]] for a, b in COCO17_LIMBS if known[a] and known[b]]


def _path(lines: Iterable[Floats], color: str, width: float, attributes: str = "") -> str:
    """Return an SVG path of straight lines, each (2, 2) pixels."""
    drawn = "".join(f"M{x:.1f} {y:.1f}L{right:.1f} {down:.1f}" for (x, y), (right, down) in lines)
    stroke = f'stroke="{color}" stroke-width="{width:.1f}" stroke-linecap="round"{attributes}'
    return f'<path d="{drawn}" fill="none" {stroke}/>'
