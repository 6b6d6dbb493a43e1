"""Scenario for the benchmark: people with everyday motions among furniture, in a ring of cameras."""

from __future__ import annotations

from simharness.scenario.presets import read_profile
from simharness.scenario.sections.scenario import Cameras, Clutter, People, Scenario


def scenario(
    *, people: int = 4, cameras: int = 5, size: tuple[int, int] = (640, 480), duration: float = 4.0
) -> Scenario:
    """Return a scenario with people and clutter; the scene does not depend on the picture size."""
    return Scenario(
        name="bench",
        duration=duration,
        people=People(count=people),
        clutter=Clutter(boxes=2, shelves=1, tables=1, chairs=3, plants=1),
        cameras=Cameras(count=cameras, size=size),
        detector=read_profile("typical"),
    )
