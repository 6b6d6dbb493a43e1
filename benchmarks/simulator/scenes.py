"""Scenario for the benchmark: people with everyday motions among furniture, in a ring of cameras."""

from __future__ import annotations

from simharness.scenario.presets import read_profile
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.scenario import Scenario


def scenario(
    *, people: int = 4, cameras: int = 5, size: tuple[int, int] = (640, 480), duration: float = 4.0
) -> Scenario:
    """Return a scenario with people and clutter; the scene does not depend on the picture size."""
    return Scenario(
        name="bench",
        duration=duration,
        people=PeopleSection(count=people),
        clutter=ClutterSection(boxes=2, shelves=1, tables=1, chairs=3, plants=1),
        cameras=CamerasSection(count=cameras, size=size),
        detector=read_profile("typical"),
    )
