"""3D views of a page: lines, faces, round bodies and names that the reader turns with the mouse.

Without scripts, and in print, a still drawing shows the view as it is at first.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.camera import Camera

_YAW, _PITCH = math.radians(-58), math.radians(25)  # first viewing direction
_DISTANCE = 3.0  # from the eye to the middle, in radii of what is shown
_LEAST_RADIUS = 1.5  # metres
_SIZE = (720, 540)  # of the still drawing, pixels; the aspect ratio of the canvas
_EDGE = 8.0  # pixels around what is shown
_TURNS = np.radians(np.arange(0.0, 360.0, 15.0))  # from which the view is to show everything at first
_RIM = 0.72  # width of the middle of a round body, as a share of the whole
_DARKER = 0.28  # share of black in the rim of a round body


class Shape3D(NamedTuple):
    """Lines and triangles between the points of a piece; those with a point of unknown position are left out."""

    lines: tuple[tuple[int, int], ...] = ()
    """Pairs of points."""
    faces: tuple[tuple[int, ...], ...] = ()
    """Corners of polygons."""
    bodies: tuple[tuple[tuple[int, ...], float], ...] = ()
    """Points of a round body and the radius around them, metres: one point is a ball, two are a capsule, more are a
    polygon with round edges."""


def loop(count: int, first: int = 0) -> tuple[tuple[int, int], ...]:
    """Return the sides of a polygon with ``count`` corners, the first of which has the index ``first``."""
    return tuple((first + k, first + (k + 1) % count) for k in range(count))


PYRAMID = Shape3D(lines=(*((0, corner) for corner in range(1, 5)), *loop(4, 1)))
"""Apex and base of a camera's pyramid (:func:`camera_pyramid`)."""


def prism(count: int) -> Shape3D:
    """Return the edges of an upright prism: ``count`` corners of its floor, then as many of its top."""
    return Shape3D(lines=(*loop(count), *loop(count, count), *((k, count + k) for k in range(count))))


class Style3D(NamedTuple):
    """How a piece is drawn."""

    color: str
    """"#rrggbb", or a variable of the page's style: "--ink", "--faint", "--line", "--accent"."""
    width: float = 1.0
    """Of lines, pixels."""
    dashed: bool = False
    """Whether lines are dashed."""
    opacity: float = 1.0
    """Of faces, 0 to 1."""
    rim: str = ""
    """Colour of the edge of round bodies; "": a darker shade of ``color``, which is no variable then."""


@dataclass(frozen=True)
class Piece3D:
    """Piece of a scene."""

    points: Floats = field(repr=False)
    """(n, 3) metres; NaN where unknown."""
    shape: Shape3D
    """What is drawn between the points."""
    style: Style3D
    """How."""

    @classmethod
    def of_lines(cls, lines: Sequence[Floats], style: Style3D) -> Self:
        """Return separate lines, each (2, 3) metres."""
        pairs = tuple((2 * k, 2 * k + 1) for k in range(len(lines)))
        return cls(np.concatenate([np.zeros((0, 3)), *lines]), Shape3D(lines=pairs), style)


@dataclass(frozen=True)
class Scene3D:
    """What a view shows."""

    label: str
    """Description for readers who cannot see it."""
    center: Floats
    """Point that the view turns around, (3,) metres."""
    fitted: Floats = field(repr=False)
    """Points that are in the view from all sides at first, (n, 3) metres."""
    fixed: Sequence[Piece3D] = field(repr=False)
    """What is there all the time."""
    names: Sequence[tuple[str, Floats]] = ()
    """Texts and their places, (3,) metres."""
    frames: Sequence[Sequence[Piece3D]] = field(default=(), repr=False)
    """What is there in each frame; none where nothing moves."""
    times: Sequence[float] = field(default=(), repr=False)
    """Of the frames, seconds."""
    first: int = 0
    """Number of the first frame."""
    start: int = 0
    """Index of the frame that is shown at first."""


@dataclass(frozen=True)
class View3D:
    """A 3D view of a page, which the macro ``view_3d`` of ``parts.html`` shows."""

    label: str
    """Description."""
    data: dict[str, Any] = field(repr=False)
    """Input of ``view_3d.js``: lengths in whole millimetres, null for an unknown point."""
    still: Markup = field(repr=False)
    """The view at first as SVG."""

    @property
    def json(self) -> Markup:
        """The data as JSON for a script element."""
        return Markup(json.dumps(self.data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def view_3d(scene: Scene3D) -> View3D:
    """Return the view of a scene."""
    shapes: dict[Shape3D, int] = {}
    styles: dict[Style3D, int] = {}

    def written(pieces: Iterable[Piece3D]) -> list[list[Any]]:
        return [
            [shapes.setdefault(each.shape, len(shapes)), styles.setdefault(each.style, len(styles)), _mm(each.points)]
            for each in pieces
        ]

    eye = _Eye.of(scene)
    data: dict[str, Any] = {
        "fixed": written(scene.fixed),
        "frames": [written(pieces) for pieces in scene.frames],
        "names": [[name, *_mm([place])] for name, place in scene.names],
        "times": [round(float(time), 3) for time in scene.times],
        "first": scene.first,
        "start": scene.start,
        "center": _mm([scene.center])[0],
        "distance": round(1000 * eye.distance),
        "yaw": round(_YAW, 4),
        "pitch": round(_PITCH, 4),
        "extent": [round(each, 4) for each in eye.extent],
        "shapes": [
            {**shape._asdict(), "bodies": [[points, round(1000 * radius)] for points, radius in shape.bodies]}
            for shape in shapes
        ],
        "styles": [style._asdict() for style in styles],
    }
    return View3D(scene.label, data, _still(scene, eye))


def camera_pyramid(camera: Camera, height: float) -> Floats:
    """Return the centre of a camera and a point on the ray of each picture corner, (5, 3) metres in the world.

    Args:
        camera: the camera.
        height: of the pyramid, metres.
    """
    width, rows = camera.size
    pixels = np.array([[0, 0], [width, 0], [width, rows], [0, rows]]) - 0.5
    local = np.column_stack([pixels, np.ones(4)]) @ np.linalg.inv(camera.K).T * height
    return np.vstack([camera.center, camera.center + local @ camera.R])


def _mm(metres: ArrayLike) -> list[list[int] | None]:
    points = 1000 * np.asarray(metres, float)
    known = np.isfinite(points).all(axis=1)
    whole = np.rint(np.where(known[:, None], points, 0.0)).astype(int).tolist()
    return [point if there else None for point, there in zip(whole, known.tolist(), strict=True)]


class _Eye(NamedTuple):
    """Eye of the first view, a pinhole camera that looks at the centre of the scene.

    ``extent`` is what the fitted points need to the right, up and down, in units of depth, from all sides.
    """

    center: Floats
    distance: float
    extent: tuple[float, float, float]

    @classmethod
    def of(cls, scene: Scene3D) -> Self:
        points = scene.fitted[np.isfinite(scene.fitted).all(axis=1)]
        offsets = points - scene.center
        radius = max(_LEAST_RADIUS, float(np.linalg.norm(offsets[:, :2], axis=1).max(initial=0.0)))
        eye = cls(scene.center, _DISTANCE * radius, (1.0, 1.0, 1.0))
        right, up, near = np.moveaxis(np.stack([offsets @ _axes(turn).T for turn in _TURNS]), -1, 0)
        away = eye.distance - near
        most = [float((each / away).max(initial=1e-3)) for each in (np.abs(right), up, -up)]
        return eye._replace(extent=(most[0], most[1], most[2]))

    @property
    def scale(self) -> float:
        """Pixels of the still drawing for a metre at a depth of one metre."""
        right, up, down = self.extent
        return min((_SIZE[0] / 2 - _EDGE) / right, (_SIZE[1] - 2 * _EDGE) / (up + down))

    def project(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the pixels (n, 2) of points (n, 3), and pixels for a metre there, (n,)."""
        right, up, near = np.moveaxis((np.asarray(points, float) - self.center) @ _axes(_YAW).T, -1, 0)
        scale = self.scale / (self.distance - near)
        middle = _EDGE + (_SIZE[1] - 2 * _EDGE) * self.extent[1] / (self.extent[1] + self.extent[2])
        return np.stack([_SIZE[0] / 2 + scale * right, middle - scale * up], axis=-1), scale


def _axes(yaw: float) -> Floats:
    """Return the directions to the right, up and to the eye of a view at the first pitch, (3, 3) as rows."""
    sy, cy, sp, cp = math.sin(yaw), math.cos(yaw), math.sin(_PITCH), math.cos(_PITCH)
    return np.array([[-sy, cy, 0.0], [-cy * sp, -sy * sp, cp], [cy * cp, sy * cp, sp]])


def _still(scene: Scene3D, eye: _Eye) -> Markup:
    """Return the first view as SVG, in the order of ``view_3d.js``: faces, fixed lines, bodies, other lines, names."""
    moving = scene.frames[scene.start] if scene.frames else ()
    pieces = [*scene.fixed, *moving]
    drawn = [each for piece in pieces for each in _faces(piece, eye)]
    drawn += [each for piece in scene.fixed for each in _lines(piece, eye)]
    drawn += _bodies(pieces, eye)
    drawn += [each for piece in moving for each in _lines(piece, eye)]
    for name, place in scene.names:
        ((x, y),), _ = eye.project(np.array([place]))
        drawn.append(
            f'<text x="{x:.1f}" y="{y - 7:.1f}" font-size="13" text-anchor="middle" fill="currentColor">'
            f"{Markup.escape(name)}</text>"
        )
    label = Markup.escape(scene.label)
    return Markup(f'<svg viewBox="0 0 {_SIZE[0]} {_SIZE[1]}" role="img" aria-label="{label}">{"".join(drawn)}</svg>')


def _faces(piece: Piece3D, eye: _Eye) -> Iterator[str]:
    drawn = "".join(f"M{_corners(eye.project(points)[0])}Z" for points in _known(piece, piece.shape.faces))
    if drawn:
        yield f'<path d="{drawn}" fill="{_css(piece.style.color)}" fill-opacity="{piece.style.opacity:g}"/>'


def _lines(piece: Piece3D, eye: _Eye) -> Iterator[str]:
    drawn = "".join(f"M{_corners(eye.project(points)[0])}" for points in _known(piece, piece.shape.lines))
    if drawn:
        stroke = f'stroke="{_css(piece.style.color)}" stroke-width="{piece.style.width:g}" stroke-linecap="round"'
        dashes = ' stroke-dasharray="4 3"' if piece.style.dashed else ""
        yield f'<path d="{drawn}" fill="none" {stroke}{dashes}/>'


def _bodies(pieces: Iterable[Piece3D], eye: _Eye) -> Iterator[str]:
    """Yield the round bodies of all pieces, the nearest ones last."""
    parts = []
    for piece in pieces:
        if not piece.shape.bodies:
            continue
        style = piece.style
        tones = (_css(style.rim) if style.rim else _darker(style.color), _css(style.color))
        for indices, radius in piece.shape.bodies:
            for points in _known(piece, (indices,)):
                at, scale = eye.project(points)
                parts.append((float(scale.mean()), at, 2 * radius * float(scale.mean()), tones))
    for _, at, width, tones in sorted(parts, key=lambda part: part[0]):
        end = "Z" if len(at) > 2 else f"L{_corners(at)}" if len(at) == 1 else ""  # a line of no length is a dot
        shape = f'd="M{_corners(at)}{end}" stroke-linecap="round" stroke-linejoin="round"'
        for tone, share in zip(tones, (1.0, _RIM), strict=True):
            yield f'<path {shape} fill="{tone}" stroke="{tone}" stroke-width="{share * width:.1f}"/>'


def _known(piece: Piece3D, parts: Iterable[Sequence[int]]) -> Iterator[Floats]:
    """Yield the points (k, 3) of the parts whose points are all known."""
    for indices in parts:
        points = piece.points[list(indices)]
        if np.isfinite(points).all():
            yield points


def _corners(pixels: Floats) -> str:
    return "L".join(f"{x:.1f} {y:.1f}" for x, y in pixels.tolist())


def _css(color: str) -> str:
    return "currentColor" if color == "--ink" else f"var({color})" if color.startswith("--") else color


def _darker(color: str) -> str:
    """Return a darker shade of a colour "#rrggbb"."""
    return "#" + "".join(f"{round((1 - _DARKER) * int(color[at : at + 2], 16)):02x}" for at in (1, 3, 5))
