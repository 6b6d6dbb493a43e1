"""Chairs and tables: clutter of random size, and props of given size."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.assembly import Assembly
from simharness.world.scene.objects.shapes import hexahedron, lathe, shifted
from simharness.world.scene.objects.solids import ObjectModel
from simharness.world.scene.objects.storage import BOOK_COLORS, WOOD

_TOP = 0.03  # metres: thickness of a table's top
_SEAT = 0.045
_BACK = 0.40  # metres: height of the back of a chair over its seat
_LEAN = 0.07  # metres: distance by which the back leans backwards at its top
_METAL = np.array([0.30, 0.31, 0.33])
_FABRIC = np.array([[0.20, 0.38, 0.44], [0.62, 0.27, 0.22], [0.80, 0.60, 0.24], [0.35, 0.37, 0.40], [0.36, 0.46, 0.33]])
_PORCELAIN = np.array([0.93, 0.92, 0.90])


def draw_table(rng: np.random.Generator) -> ObjectModel:
    """Draw a table of usual height, rectangular or round, with a few objects on it."""
    depth, width, height = rng.uniform(0.70, 0.85), rng.uniform(1.1, 1.5), rng.uniform(0.71, 0.76)
    is_round = rng.uniform() < 0.35
    wood = WOOD[rng.integers(len(WOOD))]
    diameter = rng.uniform(0.85, 1.05)
    if is_round:
        assembly = _round_table(diameter, height, wood)
        reach = np.array([0.55, 0.55]) * diameter / 2
    else:
        assembly = _table((depth, width, height), wood)
        reach = 0.7 * np.array([depth, width]) / 2
    return _with_tabletop_objects(rng, assembly, height, reach).model()


def table(size: tuple[float, float, float], *, tint: int = 0) -> ObjectModel:
    """Return a plain table of depth x, width y and height z, metres."""
    return _table(size, WOOD[tint % len(WOOD)]).model()


def _table(size: tuple[float, float, float], wood: Floats) -> Assembly:
    depth, width, height = size
    leg = 0.055
    assembly = Assembly().box((0, 0, height - _TOP / 2), (depth, width, _TOP), wood)
    x, y = depth / 2 - leg, width / 2 - leg
    under = height - _TOP
    for side in (-1.0, 1.0):
        assembly.box((side * x, 0, under - 0.035), (0.02, 2 * y, 0.07), 0.88 * wood)
        assembly.box((0, side * y, under - 0.035), (2 * x, 0.02, 0.07), 0.88 * wood)
        for other in (-1.0, 1.0):
            assembly.box((side * x, other * y, under / 2), (leg, leg, under), 0.92 * wood)
    return assembly


def _round_table(diameter: float, height: float, wood: Floats) -> Assembly:
    return (
        Assembly()
        .bar((0, 0, height - _TOP), (0, 0, height), diameter / 2, wood, sides=32)
        .bar((0, 0, 0.03), (0, 0, height - _TOP), 0.045, _METAL, sides=14)
        .bar((0, 0, 0), (0, 0, 0.03), 0.26, _METAL, sides=24)
    )


def _with_tabletop_objects(rng: np.random.Generator, assembly: Assembly, height: float, reach: Floats) -> Assembly:
    """Add books, a mug and a laptop, each by chance and in a separate corner."""
    chance, offset, turn = rng.uniform(size=3), rng.uniform(-0.3, 0.3, (3, 2)), rng.uniform(-0.5, 0.5, 3)
    thick, tint = rng.uniform(0.018, 0.04, 3), rng.integers(len(BOOK_COLORS), size=4)
    corners = np.array([[-0.5, -0.75], [0.4, 0.8], [0.0, 0.05]]) + 0.3 * offset
    places = corners * reach
    if chance[0] < 0.8:
        z = height
        for k in range(3):
            x, y = places[0] + 0.01 * offset[k]
            size = (0.21 - 0.015 * k, 0.155 - 0.01 * k, thick[k])
            assembly.box((x, y, z + thick[k] / 2), size, BOOK_COLORS[tint[k]], yaw=turn[k])
            z += thick[k]
    if chance[1] < 0.7:
        profile = [(0.0, 0.0), (0.036, 0.0), (0.041, 0.095), (0.036, 0.095), (0.034, 0.02), (0.0, 0.02)]
        assembly.mesh(shifted(lathe(profile, _PORCELAIN, sides=12), (*places[1], height)))
    if chance[2] < 0.6:
        x, y = places[2]
        assembly.box((x, y, height + 0.009), (0.23, 0.33, 0.018), 2.2 * _METAL, yaw=turn[2])
        c, s = np.cos(turn[2]), np.sin(turn[2])
        assembly.box((x - 0.12 * c, y - 0.12 * s, height + 0.12), (0.012, 0.33, 0.22), 0.6 * _METAL, yaw=turn[2])
    return assembly


def draw_chair(rng: np.random.Generator) -> ObjectModel:
    """Draw a chair with an upholstered or a wooden seat."""
    size = (rng.uniform(0.42, 0.48), rng.uniform(0.42, 0.48), rng.uniform(0.43, 0.47))
    return chair(size, tint=int(rng.integers(len(_FABRIC) + len(WOOD))))


def chair(size: tuple[float, float, float], *, tint: int = 0) -> ObjectModel:
    """Return a chair of depth x and width y with its seat at z, metres; it faces +x, its back at -x leans backwards."""
    depth, width, height = size
    colors = np.concatenate([_FABRIC, WOOD])
    color = colors[tint % len(colors)]
    frame = _METAL if tint % len(colors) < len(_FABRIC) else 0.88 * color
    x, y, leg = depth / 2 - 0.025, width / 2 - 0.025, 0.016
    assembly = Assembly().box((0, 0, height - _SEAT / 2), (depth, width, _SEAT), color)
    foot = height + _BACK
    for side in (-1.0, 1.0):
        assembly.bar((x, side * y, 0), (x, side * y, height - _SEAT), leg, frame)
        assembly.bar((-x, side * y, 0), (-x, side * y, height - _SEAT), leg, frame)
        assembly.bar((-x - 0.01, side * y, height - _SEAT), (-x - _LEAN, side * y, foot), leg, frame)
    slats = [(0.16, 0.40)] if tint % len(colors) < len(_FABRIC) else [(0.14, 0.21), (0.25, 0.31), (0.35, 0.40)]
    for low, high in slats:
        assembly.mesh(_slat(-x - 0.01, width - 0.05, height, (low, high), color))
    return assembly.model()


def _slat(x: float, width: float, seat: float, span: tuple[float, float], color: Floats) -> Mesh:
    """Return a board across the leaning back of a chair, between two heights over the seat."""
    corners = np.array(
        [
            [x + side * 0.013 - (_LEAN - 0.01) * (up + _SEAT) / (_BACK + _SEAT), y, seat + up]
            for side in (-1.0, 1.0)
            for y in (-width / 2, width / 2)
            for up in span
        ]
    )
    return hexahedron(corners, color)
