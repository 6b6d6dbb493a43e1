"""Fittings of a room: frames of windows and doors, sockets, radiators, what hangs on the walls, lines of courts.

They are for pictures alone and hide nothing: all lies behind the plane of a wall, or nearer to it than any camera
(:data:`simharness.world.scene.placement.free_space.WALL_MARGIN`), and the line from a camera to a person is nearer to
the wall nowhere. Sizes of courts are those of FIBA (Official Basketball Rules, 2022) and BWF (Laws of Badminton), as
far as the floor has room.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.files.input_files import parse_toml
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box, carried
from simharness.world.scene.objects.materials import Sheet, draw_sheet
from simharness.world.scene.objects.object_files import ASSETS, load_shipped, variants
from simharness.world.scene.objects.shapes import quad_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.kinds import room_kinds
from simharness.world.scene.rooms.openings import Opening, Wall, room_walls
from simharness.world.scene.rooms.room_lighting import room_mood

_GLOW = 0.07  # radiance of white reveals and frames by the daylight from outside, as a share of that of the window
_SOCKETS = 2.6  # metres between sockets
_EDGE = 0.35  # metres between lines and walls, at least
_OUT = 0.6  # metres from the baseline to the wall behind it
_COLORS = np.array([[0.16, 0.20, 0.42], [0.62, 0.14, 0.12], [0.12, 0.12, 0.13], [0.10, 0.34, 0.24]])
_PALE = np.array([[0.93, 0.93, 0.91], [0.90, 0.80, 0.25]])


def make_fittings(
    room: RoomSection, seed: int, openings: Sequence[Opening], solids: Sequence[Solid]
) -> tuple[Solid, ...]:
    """Return the fittings of a room as solids without geoms; none without walls, or behind the curtains of a stage.

    Args:
        room: room with a drawn kind.
        seed: seed of the scenario.
        openings: windows and doors.
        solids: solids in the room: nothing hangs behind one that stands or hangs at the wall.
    """
    if not room.walls or not room_kinds()[room.kind].doors:
        return ()
    sheet, rng = draw_sheet(seed), stream(seed, "room", "fittings")
    style = {kind: int(rng.integers(len(variants(f"fitting_{kind}")))) for kind in ("window", "door")}
    made: list[Mesh] = []
    frames: list[Mesh] = []
    for number, wall in enumerate(room_walls(room)):
        taken = _taken(wall, solids)
        for opening in openings:
            if opening.wall == wall:
                (a, b), (low, high) = opening.span, opening.heights
                hung = _hang(sheet, wall, opening.kind, (a, b, low, high), style[opening.kind])
                (frames if opening.kind == "window" else made).append(hung)
                top = min(low - 0.14, 0.70)  # of a radiator, below a window where nothing stands
                if top >= 0.4 and _is_free(taken, a, b, 0.0, top):
                    made.append(_hang(sheet, wall, "radiator", (a, b, 0.0, top)))
                taken.append((a - 0.12, b + 0.35, low, high + 0.1))
        if room.size[2] >= 1.8:  # lower ones have no fittings
            made += _prints(sheet, room, stream(seed, "room", "prints", number), wall, taken)
        made += _sockets(sheet, wall, taken)
    glow = _GLOW * np.array(room_mood(room, seed).window)
    meshes = {"fittings": sheet.joined(made)} if made else {}
    if frames:
        meshes["window frames"] = replace(sheet.joined(frames), emission=(*glow.tolist(),))
    return tuple(Solid("room", name, mesh, (), Box.around(mesh.vertices)) for name, mesh in meshes.items())


Taken = tuple[float, float, float, float]  # left, right, lower and upper edge of a part of a wall


def _hang(sheet: Sheet, wall: Wall, kind: str, place: Taken, style: int = 0, text: str = "") -> Mesh:
    """Return a shipped fitting at a place of a wall, with a print in place of its own."""
    (left, right, low, high), file = place, load_shipped(variants(f"fitting_{kind}")[style])
    mesh = file.fitting(sheet, ((0.0, left, low), (1.0, right, high)), text)
    return mesh.moved(carried(mesh.vertices, wall.left, wall.yaw))


def _taken(wall: Wall, solids: Sequence[Solid], depth: float = 0.45) -> list[Taken]:
    """Return the parts of a wall that solids near it cover."""
    taken: list[Taken] = []
    for solid in solids:
        if solid.kind == "room" or solid.trajectory is not None:
            continue
        local = solid.hull.corners[:, :2] - wall.left
        into, along = local @ wall.inward, local @ np.array(wall.along)
        if into.min() < depth:
            z = solid.hull.corners[:, 2]
            taken.append((along.min(), along.max(), z.min(), z.max()))
    return taken


def _is_free(taken: Sequence[Taken], left: float, right: float, low: float, high: float, gap: float = 0.08) -> bool:
    return not any(left < b + gap and right > a - gap and low < d + gap and high > c - gap for a, b, c, d in taken)


def _sockets(sheet: Sheet, wall: Wall, taken: Sequence[Taken]) -> list[Mesh]:
    """Return pairs of sockets along the wall, above the skirting board."""
    low = [each for each in taken if each[2] < 0.3]
    middles = [(k + 0.5) * _SOCKETS for k in range(int(wall.length // _SOCKETS))]
    spans = [(y - 0.04, y + 0.04) for middle in middles for y in (middle - 0.04, middle + 0.045)]
    return [_hang(sheet, wall, "socket", (*span, 0.24, 0.32)) for span in spans if _is_free(low, *span, 0.24, 0.34)]


def _prints(sheet: Sheet, room: RoomSection, rng: np.random.Generator, wall: Wall, taken: list[Taken]) -> list[Mesh]:
    """Hang prints on a wall where it is free: each by chance, framed if it is a picture."""
    hung = []
    for name, width, height in room_kinds()[room.kind].prints:
        chance, tries, style = rng.uniform(), rng.uniform(size=8), int(rng.integers(2))
        kind = name.rstrip("0123456789")
        kind = kind if kind in ("whiteboard", "clock", "notice") else "picture"
        if chance < (0.55 if kind in ("whiteboard", "clock") else 0.25):
            continue
        low = {"whiteboard": 0.95, "clock": 2.05}.get(kind, 1.5 - height / 2)
        for share in tries:
            left = 0.3 + share * (wall.length - width - 0.6)
            place = left, left + width, low, low + height
            if left >= 0.2 and low + height <= wall.height - 0.1 and _is_free(taken, *place):
                hung.append(_hang(sheet, wall, kind, place, style if kind == "picture" else 0, name))
                taken.append(place)
                break
    return hung


def make_court(room: RoomSection, seed: int) -> tuple[Solid, ...]:
    """Return the lines on the floor of a gym with a sports floor; nothing for other rooms.

    Args:
        room: room with a drawn kind and floor.
        seed: seed of the scenario.
    """
    if room.kind != "gym" or room.floor != "sports_floor":
        return ()
    rng = stream(seed, "room", "court")
    color, pale = _COLORS[rng.integers(len(_COLORS))], _PALE[rng.integers(len(_PALE))]
    long, wide = max(room.size[:2]), min(room.size[:2])
    limits = np.array([long, wide]) / 2 - _EDGE
    courts = parse_toml((ASSETS / "courts.toml").read_text(encoding="utf-8"))
    vertices, colors = [], []
    for court, start, shade in (("basketball", -long / 2 + _OUT, color), ("badminton", 0.0, pale)):
        width, height = courts[court]["width"], courts[court]["height"]
        for a, b in (ends for path in _lines_of(courts[court], start) for ends in pairwise(_subdivided(path))):
            if (np.abs([a, b]) <= limits).all():
                vertices.append(_strip(a, b, width, height))
                colors.append(shade)
    points = np.concatenate(vertices)
    if room.size[0] < room.size[1]:
        points = points[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    mesh = quad_mesh(points, np.arange(len(points)).reshape(-1, 4), np.array(colors))
    return (Solid("room", "court lines", mesh, (), Box.around(mesh.vertices)),)


def _lines_of(court: Mapping[str, Any], start: float) -> Iterator[Floats]:
    """Yield the lines of a court (n, 2), metres, that begins at ``start`` along x: polygons, then arcs."""
    for line in court["lines"]:
        yield [start, 0.0] + np.array(line, float)
    for arc in court.get("arcs", ()):
        low, high = arc["degrees"]
        turn = np.radians(np.linspace(low, high, 33))
        yield [start + arc["x"], 0.0] + arc["radius"] * np.column_stack([np.cos(turn), np.sin(turn)])


def _subdivided(path: ArrayLike, step: float = 0.1) -> Floats:
    """Return a path (n, 2) with points at most ``step`` metres apart."""
    path = np.asarray(path, float)
    pieces = [path[:1]]
    for a, b in pairwise(path):
        count = max(int(np.ceil(np.linalg.norm(b - a) / step)), 1)
        pieces.append(a + (np.arange(count) + 1)[:, None] / count * (b - a))
    return np.concatenate(pieces)


def _strip(a: Floats, b: Floats, width: float, height: float) -> Floats:
    """Return the corners (4, 3) of a piece of a line, counter-clockwise from above; it overlaps its neighbours."""
    ahead = (b - a) / np.linalg.norm(b - a)
    left, over = width / 2 * np.array([-ahead[1], ahead[0]]), 0.2 * width * ahead
    return np.column_stack([[a - over - left, b + over - left, b + over + left, a - over + left], np.full(4, height)])
