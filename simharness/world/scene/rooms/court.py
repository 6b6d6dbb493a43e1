"""Lines of courts on the floor of a gym, for pictures alone.

Sizes are those of FIBA (Official Basketball Rules, 2022) and BWF (Laws of Badminton), as far as the floor has room.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.scenario.sections.room_section import RoomSection
from simharness.types.random_streams import stream
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import quad_mesh
from simharness.world.scene.objects.solids import Solid

_EDGE = 0.35  # metres between lines and walls, at least
_OUT = 0.6  # metres from the baseline to the wall behind it
_WIDTH, _HALF, _KEY, _DEEP, _CIRCLE, _ARC, _BASKET = 15.0, 14.0, 4.9, 5.8, 1.8, 6.75, 1.575  # metres, of basketball
_LINE, _THIN = 0.05, 0.04  # metres: widths of lines of basketball and badminton
_LENGTH, _SERVICE, _BACK, _DOUBLES, _SINGLES = 13.40, 1.98, 0.76, 6.10, 5.18  # metres, of badminton
_HIGH = (0.0012, 0.0024)  # metres above the floor: of two lines that cross, one is above the other
_COLORS = np.array([[0.16, 0.20, 0.42], [0.62, 0.14, 0.12], [0.12, 0.12, 0.13], [0.10, 0.34, 0.24]])
_PALE = np.array([[0.93, 0.93, 0.91], [0.90, 0.80, 0.25]])


def make_court(room: RoomSection, seed: int) -> tuple[Solid, ...]:
    """Return the lines on the floor of a gym with a sports floor; nothing for other rooms.

    Args:
        room: room with a drawn kind and floor.
        seed: seed of the scenario.
    """
    if room.kind != "gym" or room.floor != "sports_floor":
        return ()
    rng = stream(seed, "room", "court")
    color, pale = _COLORS[rng.integers(len(_COLORS))], _PALE[rng.integers(len(_PALE))]
    long, wide = max(room.size[:2]), min(room.size[:2])
    limits = np.array([long, wide]) / 2 - _EDGE
    strips = [(path, _LINE, _HIGH[1], color) for path in _basketball(long, wide)]
    strips += [(path, _THIN, _HIGH[0], pale) for path in _badminton()]
    vertices, colors = [], []
    for path, width, height, shade in strips:
        for a, b in pairwise(_subdivided(path)):
            if (np.abs([a, b]) <= limits).all():
                vertices.append(_strip(a, b, width, height))
                colors.append(shade)
    points = np.concatenate(vertices)
    if room.size[0] < room.size[1]:
        points = points[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    mesh = quad_mesh(points, np.arange(len(points)).reshape(-1, 4), np.array(colors))
    return (Solid("room", "court lines", mesh, (), Box.around(mesh.vertices)),)


def _basketball(long: float, wide: float) -> list[Floats]:
    """Return the lines of half a court: its baseline is at -x, and its middle line and circle where they fit."""
    first = -long / 2 + _OUT
    side, key, far = min(_WIDTH / 2, wide / 2 - _EDGE), _KEY / 2, first + _DEEP
    turn = np.linspace(-np.pi / 2, np.pi / 2, 33)
    bow = np.column_stack([np.cos(turn), np.sin(turn)])
    around = np.concatenate([bow, -bow[1:]])
    return [
        np.array([[first, -side], [first, side]]),
        np.array([[first, side], [long / 2, side]]),
        np.array([[first, -side], [long / 2, -side]]),
        np.array([[first, -key], [far, -key], [far, key], [first, key]]),
        [far, 0.0] + _CIRCLE * bow,
        [first + _BASKET, 0.0] + _ARC * bow,
        [first + _HALF, 0.0] + _CIRCLE * around,
        np.array([[first + _HALF, -side], [first + _HALF, side]]),
    ]


def _badminton() -> list[Floats]:
    """Return the lines of a court around the origin."""
    x, doubles, singles = _LENGTH / 2, _DOUBLES / 2, _SINGLES / 2
    lines = [np.array([[-x, y], [x, y]]) for y in (-doubles, -singles, singles, doubles)]
    for sign in (-1.0, 1.0):
        for at in (x, x - _BACK, _SERVICE):
            lines.append(np.array([[sign * at, -doubles], [sign * at, doubles]]))
        lines.append(np.array([[sign * _SERVICE, 0.0], [sign * x, 0.0]]))
    return lines


def _subdivided(path: ArrayLike, step: float = 0.1) -> Floats:
    """Return a path (n, 2) with points at most ``step`` metres apart."""
    path = np.asarray(path, float)
    pieces = [path[:1]]
    for a, b in pairwise(path):
        count = max(int(np.ceil(np.linalg.norm(b - a) / step)), 1)
        pieces.append(a + (np.arange(count) + 1)[:, None] / count * (b - a))
    return np.concatenate(pieces)


def _strip(a: Floats, b: Floats, width: float, height: float) -> Floats:
    """Return the corners (4, 3) of a piece of a line, counter-clockwise from above; it overlaps its neighbours."""
    ahead = (b - a) / np.linalg.norm(b - a)
    left, over = width / 2 * np.array([-ahead[1], ahead[0]]), 0.2 * width * ahead
    return np.column_stack([[a - over - left, b + over - left, b + over + left, a - over + left], np.full(4, height)])
