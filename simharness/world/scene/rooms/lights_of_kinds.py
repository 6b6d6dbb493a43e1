"""Lamps and windows of the kinds of rooms: area lights, and what pictures show of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.checks import seal
from simharness.scenario.sections.room import Room
from simharness.types.light_sources import AreaLight, Vector
from simharness.types.random_streams import stream
from simharness.world.scene.objects.furnishing import Furnishing
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.materials import draw_sheet
from simharness.world.scene.objects.shapes import quad_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.fittings import REVEAL
from simharness.world.scene.rooms.fixtures import fixture
from simharness.world.scene.rooms.kinds import ROOM_KINDS, LampKind
from simharness.world.scene.rooms.lamps import Mood
from simharness.world.scene.rooms.lighting import mood_of
from simharness.world.scene.rooms.noise import smooth_noise
from simharness.world.scene.rooms.openings import Opening

_IN_PLANE = 0.012  # metres from the wall to the area light of its window
_LAMPS: dict[LampKind, tuple[tuple[float, float], float, float, float, float]] = {
    "panels": ((0.30, 0.30), 2.6, 0.03, 1.0, 0.0),
    "tubes": ((0.70, 0.09), 2.6, 0.12, 2.2, 0.0),
    "downlights": ((0.10, 0.10), 1.7, 0.02, 4.0, 3.0),
    "pendants": ((0.22, 0.22), 3.6, 0.55, 1.6, 0.0),
    "spots": ((0.10, 0.10), 2.0, 0.30, 6.0, 8.0),
}
"""Half sides, pitch, distance from the ceiling (metres), strength relative to a panel, and focus of a lamp, by kind."""
_BRIGHTEST = 4.0  # radiance that a picture shows of the sky; a brighter one is as white
_SHOWN = 0.15  # radiance of the view as a share of that of the light: what is in the light of the sky, exposed by hand
_MOST = 4  # lamps along a side of the room
_DARK, _SHADE = np.array([0.14, 0.14, 0.15]), np.array([0.92, 0.90, 0.84])


def lights_of(room: Room, seed: int, openings: Sequence[Opening]) -> tuple[AreaLight, ...]:
    """Return the lamps and windows of a room with a drawn kind and a ceiling; at least one lamp is on."""
    mood = mood_of(room, seed)
    windows = tuple(
        _window_light(opening, mood) for opening in openings if opening.kind == "window" and any(mood.window)
    )
    lamps = _lamps(room, mood)
    return (*lamps, *windows) or _lamps(room, replace(mood, lamp=(2.6, 2.5, 2.3)))


def _window_light(opening: Opening, mood: Mood) -> AreaLight:
    (a, b), (low, high) = opening.span, opening.heights
    middle = opening.wall.at(((a + b) / 2, _IN_PLANE, (low + high) / 2))
    along = np.append(opening.wall.along, 0.0) * (b - a) / 2  # right x up looks into the room
    return AreaLight(_vector(middle), _vector(along), (0.0, 0.0, (high - low) / 2), mood.window, kind="window")


def _lamps(room: Room, mood: Mood) -> tuple[AreaLight, ...]:
    kind = ROOM_KINDS[room.kind].lamps
    if kind == "none" or not any(mood.lamp):
        return ()
    (dx, dy), pitch, down, strength, focus = _LAMPS[kind]
    z = room.size[2] - min(down, 0.15 * room.size[2])
    if room.size[0] < room.size[1]:
        dx, dy = dy, dx
    counts = [min(max(1, round(side / pitch)), _MOST) for side in room.size[:2]]
    places = [((np.arange(n) + 0.5) / n - 0.5) * side for n, side in zip(counts, room.size[:2], strict=True)]
    radiance = _vector(strength * np.array(mood.lamp))
    lamps = [
        AreaLight((float(x), float(y), z), (0.0, dy, 0.0), (dx, 0.0, 0.0), radiance, focus)
        for x in places[0]
        for y in places[1]
    ]
    return tuple(lamps[mood.every // 2 :: mood.every])


def shown_lights_of(
    room: Room, seed: int, openings: Sequence[Opening], areas: Sequence[AreaLight]
) -> tuple[Solid, ...]:
    """Return what pictures show of the lights: glowing lamps with their bodies, and the view through the windows."""
    lamps = [area for area in areas if area.kind == "lamp"]
    shown = [fixture(lamp, f"lamp{k}") for k, lamp in enumerate(lamps)]
    bodies = Furnishing(draw_sheet(seed))
    for lamp in lamps:
        _lamp_body(bodies, ROOM_KINDS[room.kind].lamps, lamp, room.size[2])
    if bodies.parts:
        mesh = bodies.mesh()
        shown.append(Solid("room", "lamp bodies", mesh, (), Box.around(mesh.vertices)))
    return (*shown, *_views(room, seed, [opening for opening in openings if opening.kind == "window"]))


def _lamp_body(f: Furnishing, kind: LampKind, lamp: AreaLight, ceiling: float) -> None:
    """Add the housing of a lamp above its glowing front."""
    x, y, z = lamp.center
    dx, dy, up = abs(lamp.up[0]), abs(lamp.right[1]), max(ceiling - z, 0.01)
    if kind == "panels":
        f.block((x - dx - 0.02, y - dy - 0.02, z), (x + dx + 0.02, y + dy + 0.02, ceiling), 0.95 * _SHADE)
    elif kind == "tubes":
        f.block((x - dx - 0.02, y - dy - 0.02, z), (x + dx + 0.02, y + dy + 0.02, z + 0.06), 0.95 * _SHADE)
        for side in (-0.6, 0.6):
            end = (x + side * dx, y + (side * dy if dy > dx else 0.0), 0.0)
            f.bar((end[0], end[1], z + 0.06), (end[0], end[1], ceiling), 0.006, _DARK, sides=5)
    elif kind == "downlights":
        f.turned([(0.0, 0.0), (0.15, 0.0), (0.15, up), (0.0, up)], _SHADE, at=(x, y, z), sides=20)
    elif kind == "pendants":
        f.turned([(0.33, 0.0), (0.30, 0.12), (0.06, 0.24), (0.0, 0.25)], _SHADE, "fabric", at=(x, y, z), sides=22)
        f.bar((x, y, z + 0.24), (x, y, ceiling), 0.006, _DARK, sides=5)
    else:
        f.turned([(0.15, -0.04), (0.15, 0.16), (0.08, 0.22), (0.0, 0.22)], _DARK, at=(x, y, z), sides=14)
        f.bar((x, y, z + 0.2), (x, y, ceiling), 0.015, _DARK, sides=6)


def _views(room: Room, seed: int, windows: Sequence[Opening]) -> list[Solid]:
    """Return the views through the windows: glowing pictures behind their frames, each a part of one panorama."""
    mood, picture = mood_of(room, seed), draw_view(seed)
    glow = _vector(np.minimum(_SHOWN * np.array(mood.window), _BRIGHTEST))
    solids = []
    for k, opening in enumerate(windows):
        (a, b), (low, high) = opening.span, opening.heights
        places = [
            (a, -REVEAL - 0.01, low),
            (b, -REVEAL - 0.01, low),
            (b, -REVEAL - 0.01, high),
            (a, -REVEAL - 0.01, high),
        ]
        corners = opening.wall.at(places)
        u = np.array([a, b, b, a]) / 9.0 + 0.31 * (hash_of(opening.wall.name) % 7)
        v = 1.0 - (np.array([low, low, high, high]) - 0.2) / 2.6
        uv = np.column_stack([u, np.clip(v, 0.01, 0.99)])[[0, 1, 2, 0, 2, 3]].reshape(2, 3, 2)
        mesh = quad_mesh(corners, np.array([[0, 1, 2, 3]]), np.ones((1, 3)))
        mesh = replace(mesh, texture=picture, uv=uv.astype(np.float32), emission=glow)
        solids.append(Solid("room", f"view{k}", mesh, (), Box.around(corners)))
    return solids


def hash_of(name: str) -> int:
    """Return a number of a name that is the same in every process."""
    return sum(map(ord, name))


@lru_cache(maxsize=2)
def draw_view(seed: int) -> NDArray[np.uint8]:
    """Draw what is outside, out of focus: sky with clouds, trees and houses, a lawn; seamless from left to right."""
    rng = stream(seed, "room", "view")
    height, width = shape = (288, 1024)
    y = np.linspace(0, 1, height)[:, None, None]
    picture = (1 - y) * np.array([0.62, 0.76, 0.93]) + y * np.array([0.90, 0.94, 0.97])
    picture = np.repeat(picture, width, axis=1)
    clouds = np.clip(smooth_noise(rng, shape, 256, across=96) + 0.5 * smooth_noise(rng, shape, 64, across=24), 0, 1)
    picture += (0.97 - picture) * (0.8 * clouds * np.clip(1.4 - 2 * y[..., 0], 0, 1))[..., None]
    horizon = int(0.66 * height)
    x = 0
    while x < width:
        wide, tall = int(rng.uniform(70, 150)), int(rng.uniform(0.10, 0.34) * height)
        if rng.uniform() < 0.45:
            color = np.array([[0.72, 0.62, 0.52], [0.66, 0.64, 0.62], [0.62, 0.42, 0.34], [0.80, 0.77, 0.70]])[
                rng.integers(4)
            ]
            picture[horizon - tall : horizon, x : x + wide] = color
            picture[horizon - tall : horizon - tall + 12, x : x + wide] = 0.5 * color
            for row in range(horizon - tall + 22, horizon - 14, 26):
                for column in range(x + 10, min(x + wide, width) - 14, 24):
                    picture[row : row + 14, column : column + 11] = (0.30, 0.36, 0.42)
        x += wide
    for place, size, shade in zip(
        rng.uniform(0, width, 46), rng.uniform(12, 42, 46), rng.uniform(0.7, 1.2, 46), strict=True
    ):
        color = (np.array([0.26, 0.38, 0.18]) * shade).tolist()
        for shift in (-width, 0, width):
            middle = (int(place + shift), int(horizon - 0.7 * size))
            cv2.ellipse(picture, middle, (int(size), int(0.9 * size)), 0, 0, 360, color, -1, cv2.LINE_AA)
    picture[horizon:] = np.array([0.40, 0.50, 0.26]) * (
        1 + 0.08 * smooth_noise(rng, shape, 64, across=8)[horizon:, :, None]
    )
    soft = cv2.GaussianBlur(np.concatenate([picture[:, -64:], picture, picture[:, :64]], axis=1), (0, 0), 3.0)
    view = np.round(255 * np.clip(soft[:, 64:-64], 0, 1)).astype(np.uint8)
    seal(view)  # all windows share it: renderers pack it once
    return view


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
