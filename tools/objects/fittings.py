"""Fittings of rooms: windows, doors, radiators, sockets, what hangs on walls, and bodies of lamps.

Those of a wall have their lower left corner at the origin, x into the room, y along the wall and z up; lamps have the
middle of their glowing front there. The room stretches them to their places, with ``size`` as their own size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from tools.objects.builder import ObjectBuilder, Part

_WHITE, _DARK, _STEEL = np.array([0.90, 0.90, 0.88]), np.array([0.16, 0.16, 0.17]), np.array([0.66, 0.67, 0.69])
_LEAVES = np.array([[0.84, 0.83, 0.80], [0.62, 0.48, 0.34], [0.55, 0.60, 0.64], [0.72, 0.60, 0.44]])
_FRAMES = np.array([[0.90, 0.90, 0.88], [0.90, 0.90, 0.88], [0.36, 0.37, 0.39], [0.60, 0.46, 0.32]])
_REVEAL = 0.16  # metres: depth of the opening of a window, from the inner face of the wall to the glass
_DEEPEST = 0.09  # metres that a fitting may stand out from its wall
_BLACK, _SHADE = np.array([0.14, 0.14, 0.15]), np.array([0.92, 0.90, 0.84])


def window(f: ObjectBuilder, variant: int) -> None:
    """Draw the reveal, the sill, and a casement of two leaves with a fanlight; behind it is the view outside."""
    wide, high, color = 1.3, 1.5, _FRAMES[variant]
    deep, rim, plaster = _REVEAL, 0.055, 0.95 * _WHITE
    face = -0.001  # behind the wall: of two surfaces in one plane, rounding would decide which is visible
    f.block((-deep, -0.01, -0.02), (face, 0.0, high + 0.01), plaster)
    f.block((-deep, wide, -0.02), (face, wide + 0.01, high + 0.01), plaster)
    f.block((-deep, 0.0, high), (face, wide, high + 0.01), plaster)
    f.block((-deep, -0.04, -0.03), (-0.003, wide + 0.04, 0.0), 0.94 * _WHITE)
    x0, x1 = -deep, -deep + 0.06
    for y0, y1 in ((0.0, rim), (wide - rim, wide)):
        f.block((x0, y0, 0.0), (x1, y1, high), color)
    bar = 0.70 * high
    for z0, z1 in ((0.0, rim), (high - rim, high), (bar - 0.03, bar + 0.03)):
        f.block((x0, rim, z0), (x1, wide - rim, z1), color)
    middle = wide / 2
    f.block((x0, middle - 0.04, rim), (x1, middle + 0.04, bar - 0.03), color)
    f.block((x1, middle + 0.01, 0.5), (x1 + 0.025, middle + 0.03, 0.62), _STEEL, "metal")
    f.size = (1.0, wide, high)


def radiator(f: ObjectBuilder, variant: int) -> None:
    """Draw a radiator below a window."""
    del variant
    wide, top = 1.3, 0.66
    f.block((0.035, 0.06, 0.12), (_DEEPEST - 0.008, wide - 0.06, top), 0.97 * _WHITE)
    for y in np.arange(0.08, wide - 0.08, 0.055):
        f.block((_DEEPEST - 0.008, y, 0.13), (_DEEPEST, y + 0.03, top - 0.01), 0.97 * _WHITE)
    f.bar((0.06, wide - 0.06, top - 0.05), (0.06, wide + 0.02, top - 0.05), 0.022, 0.9 * _WHITE)
    f.bar((0.06, wide - 0.02, 0.14), (0.06, wide - 0.02, 0.0), 0.009, _STEEL, "metal")
    f.size = (1.0, wide, top)


def door(f: ObjectBuilder, variant: int) -> None:
    """Draw a closed door: leaf, architrave, handle, and a switch beside it."""
    wide, high, rim, color = 0.95, 2.05, 0.07, _LEAVES[variant]
    casing = np.clip(0.5 * color + 0.45, 0, 0.92)
    for y0, y1 in ((0.0, rim), (wide - rim, wide)):
        f.block((0.0, y0, 0.0), (0.022, y1, high), casing)
    f.block((0.0, rim, high - rim), (0.022, wide - rim, high), casing)
    f.block((0.0, rim, 0.006), (0.012, wide - rim, high - rim), color, "wood")
    for z0, z1 in ((0.25, 0.95), (1.15, high - rim - 0.2)):  # panels
        f.block((0.012, rim + 0.14, z0), (0.015, wide - rim - 0.14, z1), 0.95 * color, "wood")
    y = wide - rim - 0.07
    f.block((0.012, y - 0.02, 0.93), (0.017, y + 0.02, 1.13), _STEEL, "metal")
    f.bar((0.017, y, 1.05), (0.055, y, 1.05), 0.009, _STEEL, "metal")
    f.bar((0.055, y + 0.01, 1.05), (0.055, y - 0.11, 1.05), 0.009, _STEEL, "metal")
    f.block((0.0, wide + 0.12, 1.06), (0.009, wide + 0.20, 1.14), _WHITE)
    f.block((0.009, wide + 0.135, 1.075), (0.012, wide + 0.185, 1.125), 0.97 * _WHITE)
    f.size = (1.0, wide, high)


def socket(f: ObjectBuilder, variant: int) -> None:
    """Draw a socket."""
    del variant
    f.block((0.0, 0.0, 0.0), (0.008, 0.08, 0.08), _WHITE)
    f.block((0.008, 0.028, 0.032), (0.0085, 0.052, 0.048), 0.25 * _WHITE)
    f.size = (1.0, 0.08, 0.08)


def clock(f: ObjectBuilder, variant: int) -> None:
    """Draw a round clock."""
    del variant
    wide, turn = 0.32, 2 * np.pi * np.arange(28) / 28
    f.bar((0.0, wide / 2, wide / 2), (0.018, wide / 2, wide / 2), wide / 2, _DARK)
    rim = np.column_stack([np.cos(turn), np.sin(turn)])
    points, uv = np.column_stack([np.zeros(28), 0.46 * wide * rim]), 0.5 + 0.5 * rim * [1, -1]
    fan = np.column_stack([np.zeros(26, int), np.arange(1, 27), np.arange(2, 28)])
    center = np.array([0.0185, wide / 2, wide / 2])
    f.parts.append(Part("mesh", (), center, Rotation.identity(), np.ones(3), "clock", (points, fan), uv))
    f.size = (1.0, wide, wide)


def notice(f: ObjectBuilder, variant: int) -> None:
    """Draw a sheet of paper with nothing around it."""
    del variant
    wide, high = 0.3, 0.42
    f.block((0.0, 0.0, 0.0), (0.001, wide, high), _WHITE)
    f.front_print("notice0", 0.0015, wide / 2, high / 2, (wide, high))
    f.size = (1.0, wide, high)


def _framed(f: ObjectBuilder, name: str, size: tuple[float, float], rim: float, color: np.ndarray) -> None:
    """Draw a print of a width and height with a frame of its own width."""
    w, h = size
    f.block((0.0, 0.0, 0.0), (0.012, w, h), 0.9 * _WHITE)
    for low, high in (
        ((0.0, 0.0), (w, rim)),
        ((0.0, h - rim), (w, h)),
        ((0.0, rim), (rim, h - rim)),
        ((w - rim, rim), (w, h - rim)),
    ):
        f.block((0.0, *low), (0.02, *high), color)
    f.front_print(name, 0.0125, w / 2, h / 2, (w - 2 * rim, h - 2 * rim))
    f.size = (1.0, w, h)


def picture(f: ObjectBuilder, variant: int) -> None:
    """Draw a framed picture."""
    _framed(f, "poster0", (0.6, 0.7), 0.03, _LEAVES[1] if variant else _DARK)


def whiteboard(f: ObjectBuilder, variant: int) -> None:
    """Draw a whiteboard in aluminium, with a tray and pens."""
    del variant
    wide, high = 1.9, 1.0
    _framed(f, "whiteboard", (wide, high), 0.03, _STEEL)
    f.block((0.0, 0.3 * wide, -0.02), (0.08, 0.7 * wide, -0.005), _STEEL, "metal")
    for k, ink in enumerate(((0.1, 0.2, 0.6), (0.7, 0.1, 0.1), (0.1, 0.1, 0.1))):
        y = (0.4 + 0.1 * k) * wide
        f.bar((0.05, y, 0.003), (0.05, y + 0.12, 0.003), 0.008, ink)


def panels(f: ObjectBuilder, variant: int) -> None:
    """Draw the housing of a square panel of light, up to the ceiling."""
    del variant
    f.block((-0.32, -0.32, 0.0), (0.32, 0.32, 0.03), 0.95 * _SHADE)
    f.size = (1.0, 1.0, 0.03)


def tubes(f: ObjectBuilder, variant: int) -> None:
    """Draw the housing of a tube along x, and its two hangers."""
    del variant
    f.block((-0.72, -0.11, 0.0), (0.72, 0.11, 0.06), 0.95 * _SHADE)
    for x in (-0.42, 0.42):
        f.bar((x, 0.0, 0.06), (x, 0.0, 0.12), 0.006, _BLACK)
    f.size = (1.0, 1.0, 0.12)


def downlights(f: ObjectBuilder, variant: int) -> None:
    """Draw a round lamp at the ceiling."""
    del variant
    f.turned([(0.0, 0.0), (0.15, 0.0), (0.15, 0.02), (0.0, 0.02)], _SHADE, sides=20)
    f.size = (1.0, 1.0, 0.02)


def pendants(f: ObjectBuilder, variant: int) -> None:
    """Draw a shade of cloth that hangs from the ceiling."""
    del variant
    f.turned([(0.33, 0.0), (0.30, 0.12), (0.06, 0.24), (0.0, 0.25)], _SHADE, "fabric", sides=22)
    f.bar((0.0, 0.0, 0.24), (0.0, 0.0, 0.55), 0.006, _BLACK)
    f.size = (1.0, 1.0, 0.55)


def spots(f: ObjectBuilder, variant: int) -> None:
    """Draw a spot on a bar."""
    del variant
    f.turned([(0.15, 0.0), (0.15, 0.20), (0.08, 0.26), (0.0, 0.26)], _BLACK, sides=14)
    f.bar((0.0, 0.0, 0.24), (0.0, 0.0, 0.34), 0.015, _BLACK)
    f.origin = (0.0, 0.0, 0.04)  # the front is inside of the housing
    f.size = (1.0, 1.0, 0.30)


FITTINGS: dict[str, tuple[Callable[[ObjectBuilder, int], None], int]] = {
    "window": (window, 4),
    "radiator": (radiator, 1),
    "door": (door, 4),
    "socket": (socket, 1),
    "clock": (clock, 1),
    "notice": (notice, 1),
    "picture": (picture, 2),
    "whiteboard": (whiteboard, 1),
    "panels": (panels, 1),
    "tubes": (tubes, 1),
    "downlights": (downlights, 1),
    "pendants": (pendants, 1),
    "spots": (spots, 1),
}
"""Functions that draw the fittings, given the number of the variant, and the number of variants, by name."""
