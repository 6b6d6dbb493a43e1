"""Lighting of a room by its name in the scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from simharness.scenario.sections.room import Room
from simharness.types.lighting import Lighting
from simharness.types.random_streams import stream

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


def room_lighting(room: Room, seed: int) -> Lighting:
    """Return the lighting of a room; for "any" one of ``LIGHTS`` with a random bearing, drawn by the seed."""
    if room.light != "any":
        return LIGHTS[room.light]
    rng = stream(seed, "room", "light")
    light = LIGHTS[list(LIGHTS)[rng.integers(len(LIGHTS))]]
    x, y, z = light.direction
    bearing, reach = rng.uniform(0, 2 * np.pi), float(np.hypot(x, y))
    return replace(light, direction=(float(reach * np.cos(bearing)), float(reach * np.sin(bearing)), z))
