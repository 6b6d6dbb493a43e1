"""Lighting of a room by its name in the scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from simharness.scenario.sections.room_section import RoomSection
from simharness.types.light_sources import AreaLight, LightSources, Sun, Vector
from simharness.types.lighting import Lighting
from simharness.types.random_streams import stream
from simharness.world.scene.rooms.lamps import MOODS, Mood, ceiling_lamps, wall_windows
from simharness.world.scene.rooms.open_air import open_air, view_outside

LIGHTS: Mapping[str, Lighting] = MappingProxyType(
    {
        "day": Lighting(),
        "warm": Lighting(
            direction=(-0.30, 0.42, 0.86),
            key=0.58,
            sky=0.36,
            tint=(1.0, 0.84, 0.64),
            background=(0.87, 0.80, 0.70),
        ),
        "side": Lighting(direction=(0.86, 0.34, 0.50), key=0.78, sky=0.28, fill=0.10, background=(0.80, 0.84, 0.90)),
        "dim": Lighting(
            direction=(-0.25, -0.35, 0.90),
            key=0.22,
            sky=0.15,
            fill=0.07,
            tint=(0.86, 0.92, 1.0),
            background=(0.36, 0.40, 0.46),
        ),
    }
)
"""Lightings by name: daylight; lamps in the evening; a low sun from one side; little light."""


def room_lighting(room: RoomSection, seed: int, areas: Sequence[AreaLight] | None = None) -> Lighting:
    """Return the lighting of a room; for "any" one of ``LIGHTS`` with a random bearing, drawn by the seed.

    Args:
        room: room.
        seed: seed of the scenario.
        areas: windows and lamps of a room with a ceiling, see :func:`room_areas`; None for a room under the sky, whose
            lighting is in closed form.
    """
    name, light = _named(room, seed)
    if room.kind == "outdoors":
        return open_air(name, light, seed)
    if not areas:
        return light
    mood = MOODS[name]
    sun = None if mood.sun is None else replace(mood.sun, direction=_towards(light.direction, mood.sun))
    sources = LightSources(tuple(areas), sun, brightness=mood.brightness)
    return replace(light, sources=sources, panorama=view_outside(name, light, seed, mood.window))


def room_areas(room: RoomSection, seed: int) -> tuple[AreaLight, ...]:
    """Return the windows and lamps of a room with a ceiling whose kind has none of its own."""
    name, light = _named(room, seed)
    mood = MOODS[name]
    return (*ceiling_lamps(room, mood), *wall_windows(room, mood, light.direction))


def mood_of(room: RoomSection, seed: int) -> Mood:
    """Return how strong windows and lamps of a room are."""
    return MOODS[_named(room, seed)[0]]


def _towards(direction: Vector, sun: Sun) -> Vector:
    """Return the direction of the sun at its own height, in the bearing of another direction."""
    reach = float(np.hypot(direction[0], direction[1])) or 1.0
    across = float(np.hypot(sun.direction[0], sun.direction[1]))
    return direction[0] / reach * across, direction[1] / reach * across, sun.direction[2]


def _named(room: RoomSection, seed: int) -> tuple[str, Lighting]:
    """Return the name of a lighting and the lighting in closed form."""
    if room.light != "any":
        return room.light, LIGHTS[room.light]
    rng = stream(seed, "room", "light")
    name = list(LIGHTS)[rng.integers(len(LIGHTS))]
    light = LIGHTS[name]
    x, y, z = light.direction
    bearing, reach = rng.uniform(0, 2 * np.pi), float(np.hypot(x, y))
    return name, replace(light, direction=(float(reach * np.cos(bearing)), float(reach * np.sin(bearing)), z))
