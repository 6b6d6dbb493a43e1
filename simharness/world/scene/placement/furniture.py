"""Furniture of a kind of room: along the walls, clear of people, cameras, doors and windows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.object_files import load_shipped, variants
from simharness.world.scene.objects.solids import ObjectModel, Solid
from simharness.world.scene.placement.free_space import FreeSpace, Site
from simharness.world.scene.placement.occlusion_target import lines_in
from simharness.world.scene.placement.sight_lines import SightLines
from simharness.world.scene.rooms.kinds import furniture_of_rooms
from simharness.world.scene.rooms.openings import Opening, Wall, room_walls

_TRIES = 40  # places tried for one piece
_WALLS = 28.0  # metres of walls for which the numbers of a kind are given
_BEHIND = 0.02  # metres between a piece and its wall: room for the skirting board
_MOST_HIDDEN = 0.01  # share of the joints in the pictures that one piece may hide
_LINES = 3000  # lines of sight on which that is measured


def place_furniture(seed: int, space: FreeSpace, openings: Sequence[Opening]) -> tuple[Solid, ...]:
    """Choose the furniture of a room and find places along its walls, or along the edge of an open floor.

    Variant and place of every piece are drawn by streams of its own. It stands outside the square in which people stay
    (``people.area``), obstructs no person, keeps 0.5 m from cameras, leaves doors and windows free, and hides at most
    1 % of the joints in the pictures. A piece that finds no place is left out.

    Args:
        seed: seed of the scenario.
        space: free space, in a room with a drawn kind.
        openings: doors and windows.

    Raises:
        ValueError: the room has furniture, and no piece finds a place.
    """
    furniture = furniture_of_rooms().get(space.room.kind)
    if not furniture:
        return ()
    site, sheet, walls = Site(space), draw_sheet(seed), room_walls(space.room)
    lines = _thinned(lines_in(space))
    area = Box((0.0, 0.0, 1.0), (space.area, space.area, 1.0)) if space.pelvises.size else None
    share = sum(wall.length for wall in walls) / _WALLS
    placed: list[Solid] = []
    for name, (low, high) in furniture.items():
        number = int(stream(seed, "room", "furniture", name).integers(low, high + 1))
        for k in range(max(1, round(share * number))):
            key = ("room", "furniture", name, k)
            files = variants(name)
            model = load_shipped(files[stream(seed, *key).integers(len(files))]).model(sheet)
            solid = _find(stream(seed, *key, "place"), model, f"{name}{k}", site, walls, openings, area, lines)
            if solid is not None:
                site.add(solid)
                placed.append(solid)
    if not placed:
        raise ValueError(
            f'room.kind = "{space.room.kind}": no piece of its furniture finds a place between people.area = '
            f"{space.area:g} m and the walls of room.size = {list(space.room.size)}, clear of people and 0.5 m from "
            'cameras: enlarge room.size, lower people.area, or use room.kind = "laboratory"'
        )
    return tuple(placed)


def _find(
    rng: np.random.Generator,
    model: ObjectModel,
    name: str,
    site: Site,
    walls: Sequence[Wall],
    openings: Sequence[Opening],
    area: Box | None,
    lines: SightLines,
) -> Solid | None:
    """Return a piece of furniture at the first valid place; None if there is none."""
    for share, wall_share in rng.uniform(size=(_TRIES, 2)):
        place, yaw = _along_walls(share, walls[int(wall_share * len(walls))], model)
        hull = model.hull(place, yaw)
        if (
            (area is not None and area.gap_on_floor(hull) <= 0.0)
            or not site.clear(hull, at_wall=True)
            or not all(opening.keeps_free(hull) for opening in openings)
            or site.space.obstructed(hull)
        ):
            continue
        solid = model.at(place, yaw, kind="furniture", name=name)
        if site.leaves_pictures_free(solid) and (not len(lines) or lines.cut_by(solid).mean() <= _MOST_HIDDEN):
            return solid
    return None


def _along_walls(share: float, wall: Wall, model: ObjectModel) -> tuple[Floats, float]:
    """Return the place of a piece with its back to a wall, and its yaw."""
    depth, width = model.extent.half[0], model.extent.half[1]
    along = width + share * max(wall.length - 2 * width, 0.0)
    return wall.at((along, depth + _BEHIND, 0.0))[:2], wall.yaw


def _thinned(lines: SightLines) -> SightLines:
    step = max(1, len(lines) // _LINES)
    return SightLines(lines.starts[::step], lines.ends[::step], lines.time[::step])
