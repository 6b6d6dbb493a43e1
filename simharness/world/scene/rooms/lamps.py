"""Windows and lamps of a room, as area lights, and the ceiling that the lamps hang from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from simharness.scenario.sections.room_section import RoomSection
from simharness.types.light_sources import AreaLight, Sun, Vector
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import box_mesh, quad_mesh
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.rooms.fixtures import fixture

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mvpose.camera import Rig

_CEILING = (0.93, 0.93, 0.92)  # sRGB of white paint
_CELL = 1.0  # metres: cell size of the ceiling
_BELOW_CEILING = 0.06  # metres: a camera that is nearer to the ceiling, or above it, films a room without one
_PANEL = (0.3, 0.3)  # metres: half the sides of a lamp
_PITCH = 3.4  # metres between lamps
_MOST_LAMPS = 4  # along a side of the room
_HANGS = 0.03  # metres from the ceiling to the front of a lamp
_WINDOW = (1.5, 1.3)  # metres
_SILL, _LINTEL = 0.95, 0.3
_FRAME = 0.07  # metres: width of a window frame
_OUT = 0.012  # metres that the glass of a window on a wall without a hole stands out


@dataclass(frozen=True)
class Mood:
    """Strengths of the lights of a room, relative to each other.

    Attributes:
        window: radiance of the sky that windows show; zeros for none.
        lamp: radiance of the lamps; zeros for lamps that are off.
        sun: the sun, if it shines in.
        brightness: see :class:`~simharness.types.light_sources.LightSources`.
        every: every how many lamps one is on.
    """

    window: Vector
    lamp: Vector
    sun: Sun | None = None
    brightness: float = 1.0
    every: int = 1


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
"""Moods of the lightings of :data:`~simharness.world.scene.rooms.lighting.LIGHTS`, by their names."""


def has_ceiling(room: RoomSection, rig: Rig) -> bool:
    """Return whether a room has a ceiling: it has walls, and all cameras hang below their upper edge."""
    return room.walls and bool(rig.centers[:, 2].max(initial=0.0) < room.size[2] - _BELOW_CEILING)


def make_ceiling(room: RoomSection) -> Solid:
    """Return the ceiling of a room, for pictures alone: no ray and no person reaches it."""
    x, y, z = room.size[0] / 2, room.size[1] / 2, room.size[2]
    columns, rows = (np.linspace(-half, half, max(1, round(2 * half / _CELL)) + 1) for half in (x, y))
    grid = np.stack([*np.meshgrid(columns, rows, indexing="ij"), np.full((len(columns), len(rows)), z)], axis=-1)
    i, j = np.meshgrid(np.arange(len(columns) - 1), np.arange(len(rows) - 1), indexing="ij")
    corner = (i * len(rows) + j).ravel()
    quads = np.stack([corner, corner + 1, corner + len(rows) + 1, corner + len(rows)], axis=-1)
    mesh = quad_mesh(grid.reshape(-1, 3), quads, np.broadcast_to(_CEILING, (len(quads), 3)))
    return Solid("room", "ceiling", mesh, (), Box((0.0, 0.0, z), (x, y, 0.0)))


def ceiling_lamps(room: RoomSection, mood: Mood) -> tuple[AreaLight, ...]:
    """Return square panels in a grid below the ceiling."""
    counts = [min(max(1, round(side / _PITCH)), _MOST_LAMPS) for side in room.size[:2]]
    places = [((np.arange(n) + 0.5) / n - 0.5) * side for n, side in zip(counts, room.size[:2], strict=True)]
    z = room.size[2] - _HANGS
    lamps = [
        AreaLight((float(x), float(y), z), (0.0, _PANEL[1], 0.0), (_PANEL[0], 0.0, 0.0), mood.lamp)
        for x in places[0]
        for y in places[1]
    ]
    return tuple(lamps[mood.every // 2 :: mood.every]) if any(mood.lamp) else ()


def wall_windows(room: RoomSection, mood: Mood, towards: Sequence[float]) -> tuple[AreaLight, ...]:
    """Return windows in a row in the wall that lies most in a direction (x, y); none where they do not fit."""
    x, y, z = room.size
    axis = 0 if abs(towards[0]) * y > abs(towards[1]) * x else 1
    sign = 1.0 if towards[axis] >= 0 else -1.0
    length, top = room.size[1 - axis], min(z - _LINTEL, _SILL + _WINDOW[1])
    count = min(int((length - 0.8) // (_WINDOW[0] + 0.5)), 4)
    if count < 1 or top - _SILL < 0.5 or not any(mood.window):
        return ()
    inward = np.zeros(3)
    inward[axis] = -sign
    along = np.cross([0.0, 0.0, 1.0], inward)
    middle = -inward * (room.size[axis] / 2 - _OUT)
    places = ((np.arange(count) + 0.5) / count - 0.5) * (length - 0.8)
    return tuple(
        AreaLight(
            tuple((middle + place * along + [0, 0, (_SILL + top) / 2]).tolist()),
            tuple((along * _WINDOW[0] / 2).tolist()),
            (0.0, 0.0, (top - _SILL) / 2),
            mood.window,
            kind="window",
        )
        for place in places
    )


def shown_lights(areas: Sequence[AreaLight]) -> tuple[Solid, ...]:
    """Return what pictures show of lamps and windows: glowing rectangles, and the frames of windows."""
    solids = [fixture(area, f"{area.kind}{k}") for k, area in enumerate(areas)]
    bars = [bar for area in areas if area.kind == "window" for bar in _frame(area)]
    if bars:
        mesh = box_mesh(bars, np.full((len(bars), 3), 0.9))
        solids.append(Solid("room", "window frames", mesh, (), Box.around(mesh.vertices)))
    return tuple(solids)


def _frame(window: AreaLight) -> list[Box]:
    """Return the frame of a window, with a bar in its middle."""
    center, right, up, out = (np.array(v) for v in (window.center, window.right, window.up, window.normal))
    wide, high, yaw = float(np.linalg.norm(right)), float(np.linalg.norm(up)), float(np.arctan2(right[1], right[0]))
    half = _FRAME / 2
    pieces = [(-wide, 0.0, half, high), (wide, 0.0, half, high), (0.0, 0.0, half, high)]
    pieces += [(0.0, -high, wide, half), (0.0, high, wide + half, half)]
    bars = []
    for across, rise, a, b in pieces:
        x, y, z = (center + across * right / wide + rise * up / high + 0.01 * out).tolist()
        bars.append(Box((x, y, z), (a, 0.022, b), yaw))
    return bars
