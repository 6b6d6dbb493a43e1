"""Lighting of a room by its name in the scenario; outdoors the sun, the sky and the panorama around the scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import AreaLight, Lighting, LightSources, Panorama, Sun, Vector
from simharness.types.random_streams import stream
from simharness.world.scene.rooms.landscape import MEADOW, panorama
from simharness.world.scene.rooms.weather import WEATHERS

_EXPOSED = 0.30  # radiance of the view as a share of that of the light of a window


@dataclass(frozen=True)
class Mood:
    """Strengths of the lights of a room, relative to each other."""

    window: Vector
    """Radiance of the sky that windows show; zeros for none."""
    lamp: Vector
    """Radiance of the lamps; zeros for lamps that are off."""
    sun: Sun | None = None
    """The sun, if it shines in."""
    brightness: float = 1.0
    """See :class:`~simharness.types.lighting.LightSources`."""
    every: int = 1
    """Every how many lamps one is on."""


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


# Colours of light are those of black bodies and of daylight after the larger part of a camera's white balance: sky
# 7500 K, sun 5200 K, lamps 4000 K and 2700 K. Radiances are relative: an overcast sky has 2000 to 6000 cd/m2, a ceiling
# panel of an office 4000, a lamp in a living room half of it on a smaller part of the ceiling (EN 12464-1).
MOODS: Mapping[str, Mood] = MappingProxyType(
    {
        "day": Mood(window=(5.2, 5.7, 6.3), lamp=(5.0, 4.9, 4.5), brightness=0.88),
        "warm": Mood(window=(0.10, 0.14, 0.22), lamp=(7.0, 5.1, 3.1), brightness=0.78),
        "side": Mood(
            window=(5.4, 5.9, 6.6),
            lamp=(0.0, 0.0, 0.0),
            sun=Sun((0.80, 0.34, 0.50), (3.6, 3.35, 3.0)),
            brightness=0.8,
        ),
        "dim": Mood(window=(0.06, 0.075, 0.11), lamp=(2.6, 2.3, 1.9), brightness=0.4, every=3),
    }
)
"""Moods of the lightings of :data:`LIGHTS`, by their names."""


def room_lighting(room: RoomSection, seed: int, areas: Sequence[AreaLight] | None = None) -> Lighting:
    """Return the lighting of a room; for "any" one of ``LIGHTS`` with a random bearing, drawn by the seed.

    Args:
        room: room.
        seed: seed of the scenario.
        areas: windows and lamps of a room with a ceiling, see
            :func:`~simharness.world.scene.rooms.lamps.area_lights`; None for a room under the sky, whose
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


def room_mood(room: RoomSection, seed: int) -> Mood:
    """Return how strong windows and lamps of a room are."""
    return MOODS[_named(room, seed)[0]]


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
