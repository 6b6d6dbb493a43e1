"""Rooms of the filming sites: kinds, finishes, furniture and light as in scenarios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera, Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.placement.clutter import place_furniture
from simharness.world.scene.placement.free_space import FreeSpace
from simharness.world.scene.rooms.kinds import settled
from simharness.world.scene.rooms.lamps import area_lights
from simharness.world.scene.rooms.openings import draw_openings, room_walls
from simharness.world.scene.rooms.room_lighting import room_lighting
from simharness.world.scene.rooms.shell import make_interior

REACH = 1.5
"""Half the side of the square in which people stand, metres."""

_HALF, _HEIGHT = (4.0, 7.5), (2.6, 3.8)  # half the sides and the height of rooms, metres
_OPEN = 0.15  # fraction of sites without walls: outdoors, or a floor under an open sky
_BARE = 0.1  # fraction of rooms without a ceiling, in the light of the closed form, as with cameras above the walls
_TINTED = 0.25  # fraction of sites painted in a random colour
_BALANCE = (0.5, 0.9)  # range of the share of the colour of the light that automatic white balance removes
_ARMS = 0.5  # metres around the places of people that furniture leaves free
_TALL = 1.7  # metres: height to which furniture leaves people visible


@dataclass(frozen=True)
class SiteRoom:
    """Furnished room.

    Attributes:
        room: configuration of the room.
        meshes: floor, walls, ceiling, fittings and furniture, all still.
        lighting: light of the room.
        furniture: bounding boxes of the furniture.
    """

    room: RoomSection
    meshes: tuple[Mesh, ...]
    lighting: Lighting
    furniture: tuple[Box, ...]


def draw_room(rng: np.random.Generator) -> RoomSection:
    """Draw size, kind and walls of a room; finishes and light are drawn from the seed of the site."""
    x, y = 2 * rng.uniform(*_HALF, 2)
    z = rng.uniform(*_HEIGHT)
    is_open, is_bare_floor = rng.random() < _OPEN, rng.random() < 0.5
    kind = "laboratory" if is_open and is_bare_floor else "outdoors" if is_open else "any"
    return RoomSection(size=(float(x), float(y), float(z)), walls=not is_open, kind=kind, light="any")


def furnish(rng: np.random.Generator, room: RoomSection, seed: int, cameras: Sequence[Camera]) -> SiteRoom:
    """Furnish and light a room around the places of people and the cameras, in the order of scenarios.

    Args:
        rng: random numbers of the site, for what scenarios do not vary.
        room: room.
        seed: seed of the site.
        cameras: cameras, below the ceiling.
    """
    is_bare, is_tinted = rng.random(2) < (_BARE, _TINTED)
    paint = rng.uniform(0.4, 1.0, (2, 3)).astype(np.float32)
    room = settled(room, seed)
    openings, rig = draw_openings(room, seed), Rig(cameras)
    areas = area_lights(room, seed, openings) if room.walls and not is_bare else ()
    furniture = place_furniture(seed, _free_space(room, rig), openings)
    solids = make_interior(room, seed, rig, openings=openings, areas=areas, objects=furniture)
    tints = {"floor": paint[0], "ground": paint[0]} | {wall.name: paint[1] for wall in room_walls(room)}
    tinted = [_tinted(solid, tints) if is_tinted else solid.mesh for solid in solids]
    return SiteRoom(
        room=room,
        meshes=(*tinted, *(piece.mesh for piece in furniture)),
        lighting=_varied(rng, room_lighting(room, seed, areas)),
        furniture=tuple(solid.hull for solid in furniture),
    )


def _free_space(room: RoomSection, rig: Rig) -> FreeSpace:
    """Return the space that furniture can use: the area in which people stand must be free and visible."""
    places = np.linspace(-REACH, REACH, 3)
    columns = np.meshgrid(places, places, np.linspace(0.1, _TALL, 6), indexing="ij")
    joints = np.stack(columns, axis=-1).reshape(1, -1, 6, 3)
    return FreeSpace(room=room, area=REACH + _ARMS, time=np.zeros(1), pelvises=joints[:, :, 0], joints=joints, rig=rig)


def _tinted(solid: Solid, tints: Mapping[str, NDArray[np.float32]]) -> Mesh:
    """Return the mesh of a solid, painted if it is a floor or a wall."""
    if solid.name not in tints:
        return solid.mesh
    return replace(solid.mesh, colors=solid.mesh.colors * tints[solid.name])


def _varied(rng: np.random.Generator, light: Lighting) -> Lighting:
    """Return the light of a room with another brightness and white balance."""
    drawn, balance = np.exp(rng.normal(0.0, 0.15, 3)), float(rng.uniform(*_BALANCE))
    if light.sources is not None:
        brightness = float(drawn[0]) * light.sources.brightness
        return replace(light, sources=replace(light.sources, brightness=brightness, balance=balance))
    key, sky, fill = (drawn * (light.key, light.sky, light.fill)).tolist()
    return replace(light, key=key, sky=sky, fill=fill)
