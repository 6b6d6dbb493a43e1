"""Lamps and windows of a room as area lights, what pictures show of them, and the ceiling."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import AreaLight, Vector
from simharness.world.scene.objects.geoms import Box, carried
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.object_files import load_shipped, variants
from simharness.world.scene.objects.shapes import quad_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.kinds import LampKind, room_kinds
from simharness.world.scene.rooms.openings import Opening
from simharness.world.scene.rooms.room_lighting import Mood, room_mood

_CEILING = (0.93, 0.93, 0.92)  # sRGB of white paint
_CELL = 1.0  # metres: cell size of the ceiling
_BELOW_CEILING = 0.06  # metres: a camera that is nearer to the ceiling, or above it, films a room without one
_AHEAD = 0.004  # metres in front of the rectangle of the light
# Metres from the wall to the area light of its window: behind it, so that it does not light the wall.
_IN_PLANE = -0.002
_LAMPS: dict[LampKind, tuple[tuple[float, float], float, float, float, float]] = {
    "panels": ((0.30, 0.30), 2.6, 0.03, 1.0, 0.0),
    "tubes": ((0.70, 0.09), 2.6, 0.12, 2.2, 0.0),
    "downlights": ((0.10, 0.10), 1.7, 0.02, 4.0, 3.0),
    "pendants": ((0.22, 0.22), 3.6, 0.55, 1.6, 0.0),
    "spots": ((0.10, 0.10), 2.0, 0.30, 6.0, 8.0),
}
"""Half sides, pitch, distance from the ceiling (metres), strength relative to a panel, and focus of a lamp, by kind."""
_MOST = 4  # lamps along a side of the room


def has_ceiling(room: RoomSection, rig: Rig) -> bool:
    """Return whether a room has a ceiling: it has walls, and all cameras hang below their upper edge."""
    return room.walls and bool(rig.centers[:, 2].max(initial=0.0) < room.size[2] - _BELOW_CEILING)


def make_ceiling(room: RoomSection) -> Solid:
    """Return the ceiling of a room, for pictures alone: no ray and no person reaches it."""
    x, y, z = room.size[0] / 2, room.size[1] / 2, room.size[2]
    columns, rows = (np.linspace(-half, half, max(1, round(2 * half / _CELL)) + 1) for half in (x, y))
    grid = np.stack([*np.meshgrid(columns, rows, indexing="ij"), np.full((len(columns), len(rows)), z)], axis=-1)
    i, j = np.meshgrid(np.arange(len(columns) - 1), np.arange(len(rows) - 1), indexing="ij")
    corner = (i * len(rows) + j).ravel()
    quads = np.stack([corner, corner + 1, corner + len(rows) + 1, corner + len(rows)], axis=-1)
    mesh = quad_mesh(grid.reshape(-1, 3), quads, np.broadcast_to(_CEILING, (len(quads), 3)))
    return Solid("room", "ceiling", mesh, (), Box((0.0, 0.0, z), (x, y, 0.0)))


def fixture(light: AreaLight, name: str) -> Solid:
    """Return the glowing front of an area light, for pictures alone: no ray and no person touches it."""
    corners = light.corners + _AHEAD * light.normal
    mesh = quad_mesh(corners, np.array([[0, 1, 2, 3]]), np.ones((1, 3)))
    return Solid("room", name, replace(mesh, emission=light.radiance), (), Box.around(corners))


def area_lights(room: RoomSection, seed: int, openings: Sequence[Opening]) -> tuple[AreaLight, ...]:
    """Return the lamps and windows of a room with a drawn kind and a ceiling; at least one lamp is on."""
    mood = room_mood(room, seed)
    windows = tuple(
        _window_light(opening, mood) for opening in openings if opening.kind == "window" and any(mood.window)
    )
    lamps = _lamps(room, mood)
    return (*lamps, *windows) or _lamps(room, replace(mood, lamp=(2.6, 2.5, 2.3)))


def _window_light(opening: Opening, mood: Mood) -> AreaLight:
    (a, b), (low, high) = opening.span, opening.heights
    middle = opening.wall.at(((a + b) / 2, _IN_PLANE, (low + high) / 2))
    along = np.append(opening.wall.along, 0.0) * (b - a) / 2  # right x up looks into the room
    return AreaLight(_vector(middle), _vector(along), (0.0, 0.0, (high - low) / 2), mood.window, kind="window")


def _lamps(room: RoomSection, mood: Mood) -> tuple[AreaLight, ...]:
    kind = room_kinds()[room.kind].lamps
    if kind == "none" or not any(mood.lamp):
        return ()
    (dx, dy), pitch, down, strength, focus = _LAMPS[kind]
    z = room.size[2] - min(down, 0.15 * room.size[2])
    if room.size[0] < room.size[1]:
        dx, dy = dy, dx
    counts = [min(max(1, round(side / pitch)), _MOST) for side in room.size[:2]]
    places = [((np.arange(n) + 0.5) / n - 0.5) * side for n, side in zip(counts, room.size[:2], strict=True)]
    radiance = _vector(strength * np.array(mood.lamp))
    sides = (0.0, dy, 0.0), (dx, 0.0, 0.0)
    lamps = [AreaLight((float(x), float(y), z), *sides, radiance, focus) for x, y in product(*places)]
    return tuple(lamps[mood.every // 2 :: mood.every])


def shown_lamps(room: RoomSection, seed: int, areas: Sequence[AreaLight]) -> tuple[Solid, ...]:
    """Return what pictures show of the lamps: glowing fronts, and their bodies."""
    lamps = [area for area in areas if area.kind == "lamp"]
    shown = [fixture(lamp, f"lamp{k}") for k, lamp in enumerate(lamps)]
    if lamps:
        sheet, (file,) = draw_sheet(seed), variants(f"fitting_{room_kinds()[room.kind].lamps}")
        model, turn = load_shipped(file), np.pi / 2 * (room.size[0] < room.size[1])
        bodies = []
        for lamp in lamps:
            up = (1.0, 1.0, max(room.size[2] - lamp.center[2], 0.01))
            body = model.fitting(sheet, ((0.0, 0.0, 0.0), up))
            bodies.append(body.moved(carried(body.vertices, lamp.center[:2], turn) + [0.0, 0.0, lamp.center[2]]))
        mesh = sheet.joined(bodies)
        shown.append(Solid("room", "lamp bodies", mesh, (), Box.around(mesh.vertices)))
    return tuple(shown)


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
