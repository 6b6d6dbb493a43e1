"""Lighting outdoors: the sun, the sky, and the panorama that pictures show around the scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simharness.types.light_sources import LightSources, Vector
from simharness.types.lighting import Lighting
from simharness.world.scene.rooms.landscape import panorama
from simharness.world.scene.rooms.weather import WEATHERS


def open_air(name: str, light: Lighting, seed: int, ground: Vector) -> Lighting:
    """Return the lighting outdoors, with the sun in the bearing of a lighting in closed form.

    Args:
        name: name of the weather, that of the lighting.
        light: lighting in closed form.
        seed: seed of the scenario.
        ground: sRGB albedo of the ground far away.
    """
    bearing = float(np.arctan2(light.direction[1], light.direction[0]))
    weather = replace(WEATHERS[name], bearing=bearing)
    return replace(
        light,
        direction=weather.towards,
        sources=LightSources((), weather.sun, weather.sky, brightness=weather.brightness, balance=weather.balance),
        panorama=panorama(seed, weather, ground),
    )
