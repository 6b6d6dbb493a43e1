"""Shell of a room: floor and four walls, or a floor alone, with everything fixed to them.

The faces of the floor look up and those of the walls look into the room: counter-clockwise as seen from inside the
room, which is the outside of a wall as a solid. The ceiling is in :mod:`~simharness.world.scene.rooms.lamps`.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.camera import Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import AreaLight
from simharness.types.mesh import Mesh
from simharness.types.random_streams import stream
from simharness.world.humans.face_colors import Color
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import outline, quad_mesh, ring_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.fittings import make_court, make_fittings
from simharness.world.scene.rooms.kinds import settled
from simharness.world.scene.rooms.lamps import make_ceiling, shown_lamps
from simharness.world.scene.rooms.landscape import AROUND, make_surroundings
from simharness.world.scene.rooms.openings import Opening, Wall, room_walls
from simharness.world.scene.rooms.room_lighting import room_lighting
from simharness.world.scene.rooms.tiled_textures import FLOORS, WALLS, TiledTexture, finish

_ANY = 4  # finishes from which "any" is drawn: the first of each list
_CELL = 1.0  # metres: approximate cell size of the grids of floor and walls
_THICK = 0.1  # metres: thickness of floor and walls as solids, outside the room
_LAWN = 0.3  # metres: approximate cell size of the ground around a floor outdoors
_KEPT = 8  # finishes, at most 7 MB each: studies and suites have few seeds
_RIM = 0.25  # metres: approximate cell size of that ground, which fades into the background
# Opposite walls share a tone, so that corners are visible and pictures show the direction of view.
_TONES = {"x": (0.93, 0.97, 1.0), "y": (1.0, 0.98, 0.93)}


def make_interior(
    room: RoomSection,
    seed: int,
    rig: Rig,
    *,
    openings: Sequence[Opening],
    areas: Sequence[AreaLight],
    objects: Sequence[Solid],
) -> tuple[Solid, ...]:
    """Return floor, walls, ceiling, lamps and fittings of a room, or floor and surroundings outdoors.

    Args:
        room: room with a drawn kind.
        seed: seed of the scenario.
        rig: true cameras.
        openings: windows and doors.
        areas: area lights; none without a ceiling.
        objects: objects in the room: nothing hangs behind one that stands or hangs at the wall.
    """
    above = (make_ceiling(room), *shown_lamps(room, seed, areas)) if areas else ()
    around = make_surroundings(room, seed, rig) if room.kind == "outdoors" else above
    shell = (*make_room(room, seed, openings), *make_court(room, seed), *around)
    return (*shell, *make_fittings(room, seed, openings, objects))


def make_room(room: RoomSection, seed: int, openings: Sequence[Opening] = ()) -> tuple[Solid, ...]:
    """Return floor and walls of a room around the origin, floor at z = 0; without walls, floor and ground around it.

    Finishes of floor and walls are drawn by separate streams: the size of the room changes neither, and neither changes
    the other. In pictures the walls have holes at windows; for rays and contacts they are whole.
    """
    room = settled(room, seed)
    x, y = room.size[0] / 2, room.size[1] / 2
    texture = _floor_finish(room.floor, seed)
    slab = Box((0.0, 0.0, -_THICK / 2), (x, y, _THICK / 2))
    grid = _level_grid(_ticks(-x, x, _CELL), _ticks(-y, y, _CELL))
    floor = Solid("room", "floor", _textured_grid(grid, grid[..., :2], texture, (1.0, 1.0, 1.0)), (slab,), slab)
    if room.kind == "outdoors":
        return floor, _open_ground(x, y, texture)
    if not room.walls:
        return floor, _ground(room, seed, texture)
    paper = _wall_finish(room.wall, seed, room.size[2])
    return floor, *(
        _wall(wall, paper, [opening for opening in openings if (opening.wall, opening.kind) == (wall, "window")])
        for wall in room_walls(room)
    )


def wall_color(room: RoomSection, seed: int) -> Color:
    """Return the mean colour of the walls of a room, or of its floor where it has none, sRGB albedo from 0 to 1."""
    room = settled(room, seed)
    finish = _wall_finish(room.wall, seed, room.size[2]) if room.walls else _floor_finish(room.floor, seed)
    red, green, blue = (finish.texture.reshape(-1, 3).mean(axis=0) / 255).tolist()
    return red, green, blue


@lru_cache(maxsize=_KEPT)
def _floor_finish(name: str, seed: int) -> TiledTexture:
    rng = stream(seed, "room", "floor")
    return finish(_chosen(FLOORS, name, rng), rng)


@lru_cache(maxsize=_KEPT)
def _wall_finish(name: str, seed: int, height: float) -> TiledTexture:
    rng = stream(seed, "room", "wall")
    return finish(_chosen(WALLS, name, rng), rng, height)


def _chosen(finishes: Sequence[str], name: str, rng: np.random.Generator) -> str:
    """Return the name of a finish, a drawn one for "any". It is always drawn, so that later draws do not shift."""
    drawn = finishes[int(rng.integers(_ANY))]
    return drawn if name == "any" else name


def _level_grid(columns: Floats, rows: Floats) -> Floats:
    return np.stack([*np.meshgrid(columns, rows, indexing="ij"), np.zeros((len(columns), len(rows)))], axis=-1)


def _wall(wall: Wall, texture: TiledTexture, windows: Sequence[Opening]) -> Solid:
    length, height, along = wall.length, wall.height, np.array(wall.along)
    middle = wall.at((length / 2, -_THICK / 2, height / 2))
    block = Box(
        (float(middle[0]), float(middle[1]), height / 2),
        (length / 2 + _THICK, _THICK / 2, height / 2),
        float(np.arctan2(along[1], along[0])),
    )
    columns = _merged_ticks(_ticks(0.0, length, _CELL), [edge for window in windows for edge in window.span])
    rows = _merged_ticks(_ticks(0.0, height, _CELL), [edge for window in windows for edge in window.heights])
    place = np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1)
    grid = wall.at(np.insert(place, 1, 0.0, axis=-1))
    middles = (place[:-1, :-1] + place[1:, 1:]) / 2
    solid = np.ones(middles.shape[:2], bool)
    for window in windows:
        low, high = np.transpose([window.span, window.heights])
        solid &= ~((middles > low) & (middles < high)).all(axis=-1)
    mesh = _textured_grid(grid, place, texture, _TONES[wall.name[-1]], solid)
    return Solid("room", wall.name, mesh, (block,), block)


def _merged_ticks(ticks: Floats, edges: Sequence[float]) -> Floats:
    """Return sorted positions with additional ones, without those that are closer than a millimetre to another."""
    both = np.sort(np.concatenate([ticks, edges]))
    return both[np.concatenate([[True], np.diff(both) > 1e-3])]


def _ground(room: RoomSection, seed: int, texture: TiledTexture) -> Solid:
    """Return the ground around an open floor, in the mean colour of the floor and fading outwards as in haze."""
    half = np.array(room.size[:2]) / 2
    light = room_lighting(room, seed)
    shown = np.array(light.background) / np.sqrt((light.key * light.direction[2] + light.sky) * np.array(light.tint))
    mean = texture.texture.reshape(-1, 3).mean(axis=0) / 255
    steps = round(AROUND / _RIM)
    rings = np.stack([outline(half + AROUND * k / steps, 8) for k in range(steps + 1)])
    fade = np.repeat(((np.arange(steps) + 1) / steps) ** 1.5, rings.shape[1])[:, None]
    mesh = ring_mesh(rings, (1 - fade) * mean + fade * np.clip(shown, 0, 1))
    slab = Box((0.0, 0.0, -_THICK / 2), (float(half[0] + AROUND), float(half[1] + AROUND), _THICK / 2))
    return Solid("room", "ground", mesh, (slab,), slab)


def _open_ground(x: float, y: float, texture: TiledTexture) -> Solid:
    """Return the ground around a floor outdoors, which goes on like the floor.

    It is smooth, so that its light is computed at its vertices alone.
    """
    columns, rows = (
        _merged_ticks(
            _ticks(-half, half, _LAWN), [side * at for side in (-1, 1) for at in _ticks(half, half + AROUND, _LAWN)]
        )
        for half in (x, y)
    )
    grid = _level_grid(columns, rows)
    middles = (grid[:-1, :-1, :2] + grid[1:, 1:, :2]) / 2
    beside: Bools = np.any(np.abs(middles) > (x, y), axis=-1)
    mesh = replace(_textured_grid(grid, grid[..., :2], texture, (1.0, 1.0, 1.0), beside), smooth=True)
    slab = Box((0.0, 0.0, -_THICK / 2), (x + AROUND, y + AROUND, _THICK / 2))
    return Solid("room", "ground", mesh, (slab,), slab)


def _ticks(low: float, high: float, step: float) -> Floats:
    return np.linspace(low, high, max(1, round((high - low) / step)) + 1)


def _textured_grid(
    grid: Floats, place: Floats, texture: TiledTexture, tone: tuple[float, float, float], kept: Bools | None = None
) -> Mesh:
    """Return the textured mesh of a grid of vertices (c, r, 3).

    Args:
        grid: vertices by column; right, then up, is counter-clockwise.
        place: position of the vertices on the surface, metres to the right and up, (c, r, 2); the lower edge of the
            texture is at height 0.
        texture: texture and its size.
        tone: colour that multiplies the texture.
        kept: cells of the grid that have a surface, (c - 1, r - 1); all by default.
    """
    columns, rows = grid.shape[:2]
    i, j = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1), indexing="ij")
    corner = (i * rows + j).ravel()
    quads = np.stack([corner, corner + rows, corner + rows + 1, corner + 1], axis=-1)
    quads = quads if kept is None else quads[kept.ravel()]
    mesh = quad_mesh(grid.reshape(-1, 3), quads, np.broadcast_to(np.array(tone), (len(quads), 3)))
    uv = place.reshape(-1, 2) / texture.size * [1.0, -1.0] + [0.0, 1.0]
    return replace(mesh, texture=texture.texture, uv=uv[mesh.faces].astype(np.float32))
