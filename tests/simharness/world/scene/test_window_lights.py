"""Windows let light into the room."""

from __future__ import annotations

import pytest

from simharness.scenario.sections.room_section import RoomSection
from simharness.world.scene.rooms.lamps import area_lights
from simharness.world.scene.rooms.openings import draw_openings


@pytest.mark.parametrize("kind", ["laboratory", "office", "living_room", "gym", "ward", "shop"])
def test_windows_shine_into_the_room(kind):
    for seed in range(4):
        room = RoomSection(kind=kind, size=(7.0, 6.0, 3.0))
        openings = [each for each in draw_openings(room, seed) if each.kind == "window"]
        windows = [light for light in area_lights(room, seed, openings) if light.kind == "window"]
        assert len(windows) == len(openings)
        for opening, light in zip(openings, windows, strict=True):
            assert light.normal[:2] @ opening.wall.inward == pytest.approx(1.0)
