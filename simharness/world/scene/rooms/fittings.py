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
from simharness.types.random_streams import stream
from simharness.world.scene.objects.furnishing import Furnishing
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.object_files import ASSETS
from simharness.world.scene.objects.shapes import quad_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.kinds import room_kinds
from simharness.world.scene.rooms.openings import Opening, Wall, room_walls
from simharness.world.scene.rooms.room_lighting import room_mood

REVEAL = 0.16  # metres: depth of the opening of a window, from the inner face of the wall to the glass
DEEPEST = 0.09  # metres that a fitting may stand out from its wall
_GLOW = 0.07  # radiance of white reveals and frames by the daylight from outside, as a share of that of the window
_SOCKETS = 2.6  # metres between sockets
_WHITE, _DARK, _STEEL = np.array([0.90, 0.90, 0.88]), np.array([0.16, 0.16, 0.17]), np.array([0.66, 0.67, 0.69])
_LEAVES = np.array([[0.84, 0.83, 0.80], [0.62, 0.48, 0.34], [0.55, 0.60, 0.64], [0.72, 0.60, 0.44]])
_FRAMES = np.array([[0.90, 0.90, 0.88], [0.90, 0.90, 0.88], [0.36, 0.37, 0.39], [0.60, 0.46, 0.32]])
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
    frame, leaf = _FRAMES[rng.integers(len(_FRAMES))], _LEAVES[rng.integers(len(_LEAVES))]
    made, frames = Furnishing(sheet), Furnishing(sheet)
    for number, wall in enumerate(room_walls(room)):
        local, openings_here = Furnishing(sheet), Furnishing(sheet)  # x into the room, y along the wall, z up
        taken = _taken(wall, solids)
        for opening in openings:
            if opening.wall == wall:
                if opening.kind == "window":
                    _window(openings_here, opening, frame)
                    _radiator(local, opening, taken)
                else:
                    _door(local, opening, leaf)
                (a, b), (low, high) = opening.span, opening.heights
                taken.append((a - 0.12, b + 0.35, low, high + 0.1))
        if room.size[2] >= 1.8:  # lower ones have no fittings
            _prints(local, room, stream(seed, "room", "prints", number), wall, taken)
        _sockets(local, wall, taken)
        if local.parts:
            made.group(local, (*wall.left, 0.0), wall.yaw)
        if openings_here.parts:
            frames.group(openings_here, (*wall.left, 0.0), wall.yaw)
    glow = _GLOW * np.array(room_mood(room, seed).window)
    meshes = {"fittings": made.mesh()} if made.parts else {}
    if frames.parts:
        meshes["window frames"] = replace(frames.mesh(), emission=(float(glow[0]), float(glow[1]), float(glow[2])))
    return tuple(Solid("room", name, mesh, (), Box.around(mesh.vertices)) for name, mesh in meshes.items())


Taken = list[tuple[float, float, float, float]]  # left, right, lower and upper edge of parts of a wall


def _taken(wall: Wall, solids: Sequence[Solid], depth: float = 0.45) -> Taken:
    """Return the parts of a wall that solids near it cover."""
    taken: Taken = []
    for solid in solids:
        if solid.kind == "room" or solid.trajectory is not None:
            continue
        local = solid.hull.corners[:, :2] - wall.left
        into, along = local @ wall.inward, local @ np.array(wall.along)
        if into.min() < depth:
            z = solid.hull.corners[:, 2]
            taken.append((along.min(), along.max(), z.min(), z.max()))
    return taken


def _is_free(taken: Taken, left: float, right: float, low: float, high: float, gap: float = 0.08) -> bool:
    return not any(left < b + gap and right > a - gap and low < d + gap and high > c - gap for a, b, c, d in taken)


def _window(f: Furnishing, opening: Opening, color: np.ndarray) -> None:
    """Add the reveal, the sill, and a casement of two leaves with a fanlight; behind it is the view outside."""
    (a, b), (low, high) = opening.span, opening.heights
    deep, rim, plaster = REVEAL, 0.055, 0.95 * _WHITE
    face = -0.001  # behind the wall: of two surfaces in one plane, rounding would decide which is visible
    f.block((-deep, a - 0.01, low - 0.02), (face, a, high + 0.01), plaster)
    f.block((-deep, b, low - 0.02), (face, b + 0.01, high + 0.01), plaster)
    f.block((-deep, a, high), (face, b, high + 0.01), plaster)
    f.block((-deep, a - 0.04, low - 0.03), (-0.003, b + 0.04, low), 0.94 * _WHITE)
    x0, x1 = -deep, -deep + 0.06
    for y0, y1 in ((a, a + rim), (b - rim, b)):
        f.block((x0, y0, low), (x1, y1, high), color)
    bar = high - 0.30 * (high - low)
    for z0, z1 in ((low, low + rim), (high - rim, high), (bar - 0.03, bar + 0.03)):
        f.block((x0, a + rim, z0), (x1, b - rim, z1), color)
    middle = (a + b) / 2
    f.block((x0, middle - 0.04, low + rim), (x1, middle + 0.04, bar - 0.03), color)
    f.block((x1, middle + 0.01, low + 0.5), (x1 + 0.025, middle + 0.03, low + 0.62), _STEEL, "metal")


def _radiator(f: Furnishing, opening: Opening, taken: Taken) -> None:
    """Add a radiator below a window where nothing stands."""
    (a, b), low = opening.span, opening.heights[0]
    top = min(low - 0.14, 0.70)
    if top < 0.4 or not _is_free(taken, a, b, 0.0, top):
        return
    f.block((0.035, a + 0.06, 0.12), (DEEPEST - 0.008, b - 0.06, top), 0.97 * _WHITE)
    for y in np.arange(a + 0.08, b - 0.08, 0.055):
        f.block((DEEPEST - 0.008, y, 0.13), (DEEPEST, y + 0.03, top - 0.01), 0.97 * _WHITE)
    f.bar((0.06, b - 0.06, top - 0.05), (0.06, b + 0.02, top - 0.05), 0.022, 0.9 * _WHITE)
    f.bar((0.06, b - 0.02, 0.14), (0.06, b - 0.02, 0.0), 0.009, _STEEL, "metal", sides=6)


def _door(f: Furnishing, opening: Opening, color: np.ndarray) -> None:
    """Add a closed door: leaf, architrave, handle, and a switch beside it."""
    (a, b), (_, high) = opening.span, opening.heights
    rim = 0.07
    casing = np.clip(0.5 * color + 0.45, 0, 0.92)
    for y0, y1 in ((a, a + rim), (b - rim, b)):
        f.block((0.0, y0, 0.0), (0.022, y1, high), casing)
    f.block((0.0, a + rim, high - rim), (0.022, b - rim, high), casing)
    f.block((0.0, a + rim, 0.006), (0.012, b - rim, high - rim), color, "wood")
    for z0, z1 in ((0.25, 0.95), (1.15, high - rim - 0.2)):  # panels
        f.block((0.012, a + rim + 0.14, z0), (0.015, b - rim - 0.14, z1), 0.95 * color, "wood")
    y = b - rim - 0.07
    f.block((0.012, y - 0.02, 0.93), (0.017, y + 0.02, 1.13), _STEEL, "metal")
    f.bar((0.017, y, 1.05), (0.055, y, 1.05), 0.009, _STEEL, "metal")
    f.bar((0.055, y + 0.01, 1.05), (0.055, y - 0.11, 1.05), 0.009, _STEEL, "metal")
    f.block((0.0, b + 0.12, 1.06), (0.009, b + 0.20, 1.14), _WHITE)
    f.block((0.009, b + 0.135, 1.075), (0.012, b + 0.185, 1.125), 0.97 * _WHITE)


def _sockets(f: Furnishing, wall: Wall, taken: Taken) -> None:
    """Add pairs of sockets along the wall, above the skirting board."""
    for k in range(int(wall.length // _SOCKETS)):
        for y in ((k + 0.5) * _SOCKETS - 0.04, (k + 0.5) * _SOCKETS + 0.045):
            if _is_free([t for t in taken if t[2] < 0.3], y - 0.04, y + 0.04, 0.24, 0.34):
                f.block((0.0, y - 0.04, 0.24), (0.008, y + 0.04, 0.32), _WHITE)
                f.block((0.008, y - 0.012, 0.272), (0.0085, y + 0.012, 0.288), 0.25 * _WHITE)


def _prints(f: Furnishing, room: RoomSection, rng: np.random.Generator, wall: Wall, taken: Taken) -> None:
    """Hang prints on a wall where it is free: each by chance, framed if it is a picture."""
    for name, width, height in room_kinds()[room.kind].prints:
        chance, tries, shade = rng.uniform(), rng.uniform(size=8), rng.uniform()
        if chance < (0.55 if name in ("whiteboard", "clock") else 0.25):
            continue
        low = {"whiteboard": 0.95, "clock": 2.05}.get(name, 1.5 - height / 2)
        for share in tries:
            left = 0.3 + share * (wall.length - width - 0.6)
            if left < 0.2 or low + height > wall.height - 0.1:
                continue
            if _is_free(taken, left, left + width, low, low + height):
                _hang(f, name, (left, low), (width, height), shade)
                taken.append((left, left + width, low, low + height))
                break


def _hang(f: Furnishing, name: str, corner: tuple[float, float], size: tuple[float, float], shade: float) -> None:
    """Hang one print: papers with nothing around, boards in aluminium, clocks round, pictures in a frame."""
    (y, z), (w, h) = corner, size
    if name == "clock":
        f.bar((0.0, y + w / 2, z + h / 2), (0.018, y + w / 2, z + h / 2), w / 2, _DARK, sides=28)
        f.round_print(name, (0.0185, y + w / 2, z + h / 2), 0.46 * w)
        return
    if name.startswith("notice"):
        f.block((0.0, y, z), (0.001, y + w, z + h), _WHITE)
        f.front_print(name, 0.0015, y + w / 2, z + h / 2, (w, h))
        return
    rim = 0.03
    color = _STEEL if name == "whiteboard" else (_DARK if shade < 0.5 else _LEAVES[1])
    f.block((0.0, y, z), (0.012, y + w, z + h), 0.9 * _WHITE)
    for low, high in (
        ((y, z), (y + w, z + rim)),
        ((y, z + h - rim), (y + w, z + h)),
        ((y, z + rim), (y + rim, z + h - rim)),
        ((y + w - rim, z + rim), (y + w, z + h - rim)),
    ):
        f.block((0.0, *low), (0.02, *high), color)
    f.front_print(name, 0.0125, y + w / 2, z + h / 2, (w - 2 * rim, h - 2 * rim))
    if name == "whiteboard":
        f.block((0.0, y + 0.3 * w, z - 0.02), (0.08, y + 0.7 * w, z - 0.005), _STEEL, "metal")
        for k, ink in enumerate(((0.1, 0.2, 0.6), (0.7, 0.1, 0.1), (0.1, 0.1, 0.1))):
            f.bar(
                (0.05, y + 0.4 * w + 0.2 * k, z + 0.003),
                (0.05, y + 0.4 * w + 0.2 * k + 0.12, z + 0.003),
                0.008,
                ink,
                sides=6,
            )


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
    strips = []
    for court, start, shade in (("basketball", -long / 2 + _OUT, color), ("badminton", 0.0, pale)):
        about = courts[court]
        strips += [(path, about["width"], about["height"], shade) for path in _lines_of(about, start)]
    vertices, colors = [], []
    for path, width, height, shade in strips:
        for a, b in pairwise(_subdivided(path)):
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
