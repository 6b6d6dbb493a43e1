"""Lighting of a room by its name in the scenario; outdoors the sun, the sky and the panorama around the scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mvpose.files.input_files import parse_toml
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.lighting import AreaLight, Lighting, LightSources, Sun, Vector
from simharness.types.random_streams import stream
from simharness.world.scene.rooms.landscape import panorama

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

    def __post_init__(self) -> None:
        object.__setattr__(self, "window", tuple(self.window))
        object.__setattr__(self, "lamp", tuple(self.lamp))


def _read_lights() -> Iterator[tuple[str, Lighting, Mood, Mapping[str, Any]]]:
    entries = parse_toml(Path(__file__).parents[1].joinpath("data", "lights.toml").read_text(encoding="utf-8"))
    for name, entry in entries.items():
        open_air, sun = entry.pop("open_air"), Sun(**entry.pop("sun")) if "sun" in entry else None
        mood = Mood(**entry.pop("mood"), sun=sun)
        yield name, Lighting(**entry), mood, open_air


_LIGHTS = tuple(_read_lights())
LIGHTS = MappingProxyType({name: light for name, light, _, _ in _LIGHTS})
"""Lightings in closed form by name."""
MOODS = MappingProxyType({name: mood for name, _, mood, _ in _LIGHTS})
"""Moods by the names of lightings."""
OPEN_AIR = MappingProxyType({name: open_air for name, _, _, open_air in _LIGHTS})
"""Weathers by the names of lightings: see ``lights.toml``."""


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
    # Windows show a view that is exposed for itself: outside it is many times as bright as inside.
    bearing, (red, green, blue) = float(np.arctan2(light.direction[1], light.direction[0])), mood.window
    view = panorama(seed, name, bearing, (_EXPOSED * red, _EXPOSED * green, _EXPOSED * blue))
    return replace(light, sources=sources, panorama=view)


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
    weather, height = OPEN_AIR[name], np.radians(OPEN_AIR[name]["elevation"])
    x, y, z = np.cos(height) * np.cos(bearing), np.cos(height) * np.sin(bearing), np.sin(height)
    sun = Sun((x, y, z), weather["sun"]) if "sun" in weather else None
    sources = LightSources((), sun, weather["sky"], brightness=weather["brightness"], balance=weather["balance"])
    direction = (float(x), float(y), float(z))
    return replace(light, direction=direction, sources=sources, panorama=panorama(seed, name, bearing))


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
