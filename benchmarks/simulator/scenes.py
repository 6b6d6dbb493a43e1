"""The scenes that are timed: people at everyday things among furniture, in a ring of cameras."""

from __future__ import annotations

from simharness.scenario.presets import read_profile
from simharness.scenario.sections.scenario import Cameras, Clutter, People, Scenario


def scenario(
    *, people: int = 4, cameras: int = 5, size: tuple[int, int] = (640, 480), duration: float = 4.0
) -> Scenario:
    """A room with ``people`` and some clutter, seen by ``cameras``; the same people and things whatever the size."""
    return Scenario(
        name="bench",
        duration=duration,
        people=People(count=people),
        clutter=Clutter(boxes=2, shelves=1, tables=1, chairs=3, plants=1),
        cameras=Cameras(count=cameras, size=size),
        detector=read_profile("typical"),
    )
