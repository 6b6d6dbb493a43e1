"""Lighting outdoors: the sun, the sky, and the panorama that pictures show around the scene and through windows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simharness.types.light_sources import LightSources, Vector
from simharness.types.lighting import Lighting
from simharness.types.panorama import Panorama
from simharness.world.scene.rooms.landscape import panorama
from simharness.world.scene.rooms.surroundings import MEADOW
from simharness.world.scene.rooms.weather import WEATHERS

_EXPOSED = 0.30  # radiance of the view as a share of that of the light of a window


def open_air(name: str, light: Lighting, seed: int) -> Lighting:
    """Return the lighting outdoors, with the sun in the bearing of a lighting in closed form.

    Args:
        name: name of the weather, that of the lighting.
        light: lighting in closed form.
        seed: seed of the scenario.
    """
    bearing = float(np.arctan2(light.direction[1], light.direction[0]))
    weather = replace(WEATHERS[name], bearing=bearing)
    return replace(
        light,
        direction=weather.towards,
        sources=LightSources((), weather.sun, weather.sky, brightness=weather.brightness, balance=weather.balance),
        panorama=panorama(seed, weather, MEADOW),
    )


def view_outside(name: str, light: Lighting, seed: int, window: Vector) -> Panorama:
    """Return what the windows of a room show, exposed for itself: outside it is many times as bright as inside.

    Args:
        name: name of the weather, that of the lighting.
        light: lighting in closed form.
        seed: seed of the scenario.
        window: radiance of the windows.
    """
    bearing = float(np.arctan2(light.direction[1], light.direction[0]))
    shown = (_EXPOSED * window[0], _EXPOSED * window[1], _EXPOSED * window[2])
    return panorama(seed, replace(WEATHERS[name], bearing=bearing), MEADOW, shown)
