"""What belongs to a room, or to the surroundings of an open floor, in the order in which scenes hold it."""

from __future__ import annotations

from collections.abc import Sequence

from mvpose.camera import Rig
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.light_sources import AreaLight
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.court import make_court
from simharness.world.scene.rooms.fittings import make_fittings
from simharness.world.scene.rooms.lamps import make_ceiling
from simharness.world.scene.rooms.lights_of_kinds import shown_lights_of
from simharness.world.scene.rooms.openings import Opening
from simharness.world.scene.rooms.room import make_room
from simharness.world.scene.rooms.surroundings import make_surroundings


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
    above = (make_ceiling(room), *shown_lights_of(room, seed, areas)) if areas else ()
    around = make_surroundings(room, seed, rig) if room.kind == "outdoors" else above
    shell = (*make_room(room, seed, openings), *make_court(room, seed), *around)
    return (*shell, *make_fittings(room, seed, openings, objects))
