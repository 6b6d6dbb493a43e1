"""Clutter of rooms, and objects that activities use: pillars, racks, partitions, carts, tables, chairs and others."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from simharness.world.scene.objects.laboratory import BOOK_COLORS, BOX_COLORS, WOOD
from tools.objects.builder import ObjectBuilder

_POST, _SHEET, _TAPE = 0.03, 0.015, 0.06  # metres
_RACK_COLORS = np.array([[0.72, 0.73, 0.75], [0.25, 0.26, 0.28], [0.88, 0.88, 0.86]])
_STONE = np.array([[0.80, 0.79, 0.76], [0.70, 0.69, 0.67], [0.86, 0.84, 0.79], [0.62, 0.63, 0.66]])
_PANELS = np.array([[0.36, 0.52, 0.55], [0.55, 0.57, 0.60], [0.72, 0.55, 0.32], [0.44, 0.40, 0.52], [0.48, 0.56, 0.42]])
_FRAME = np.array([0.82, 0.83, 0.84])
_STEEL = np.array([0.66, 0.68, 0.71])
_RUBBER = np.array([0.16, 0.16, 0.17])
_WHEEL = 0.06  # metres: radius
_TOP = 0.03  # metres: thickness of a table's top
_SEAT = 0.045
_BACK = 0.40  # metres: height of the back of a chair over its seat
_LEAN = 0.07  # metres: distance by which the back leans backwards at its top
_METAL = np.array([0.30, 0.31, 0.33])
_FABRIC = np.array([[0.20, 0.38, 0.44], [0.62, 0.27, 0.22], [0.80, 0.60, 0.24], [0.35, 0.37, 0.40], [0.36, 0.46, 0.33]])
_PORCELAIN = np.array([0.93, 0.92, 0.90])
_GLASS = np.array([[0.24, 0.46, 0.36], [0.30, 0.42, 0.62], [0.62, 0.30, 0.26]])
_LABEL, _CAP = np.array([0.93, 0.92, 0.86]), np.array([0.85, 0.85, 0.84])
_BOARD, _FOLDS = 0.03, 14  # metres: thickness of the walls of a booth; folds of a curtain
_CORRIDOR = np.array([0.09, 0.09, 0.10])


def rack(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw an empty rack of thin posts and boards, 1.0 to 1.3 m high: an obstacle that occludes little."""
    width, height, depth = 0.7, 1.15, 0.34
    metal, inside = _RACK_COLORS[rng.integers(len(_RACK_COLORS))], np.array([depth, width]) - _POST
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            f.box((x * inside[0], y * inside[1], height / 2), (_POST, _POST, height), metal)
    for z in np.linspace(0.12, height - 0.06, int(rng.integers(3, 5))):
        f.box((0, 0, z), (depth, width, _SHEET), 0.9 * metal)


def pillar(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a round or square pillar 3 m tall, with a base and a capital."""
    is_round, width, height, base = rng.uniform() < 0.5, rng.uniform(0.30, 0.45), 3.0, 0.12
    stone = _STONE[rng.integers(len(_STONE))]
    for low, high, wider in ((0.0, base, 1.22), (base, height - base, 1.0), (height - base, height, 1.18)):
        color = stone if wider == 1.0 else 0.88 * stone
        if is_round:
            f.bar((0, 0, low), (0, 0, high), wider * width / 2, color)
        else:
            f.box((0, 0, (low + high) / 2), (wider * width, wider * width, high - low), color)


def partition(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a free-standing partition 1.5 to 1.9 m tall: one panel, or two or three in a zigzag."""
    panels = int(rng.integers(1, 4))
    width, height = rng.uniform(0.75, 1.0), rng.uniform(1.5, 1.9)
    fold, sense = rng.uniform(0.35, 0.7), rng.choice([-1.0, 1.0])
    fabric = _PANELS[rng.integers(len(_PANELS))]
    if panels == 1:
        width, fold = 1.5 * width, 0.0
    yaws = [sense * fold * (-1.0) ** k for k in range(panels)]
    along = [np.array([-np.sin(yaw), np.cos(yaw)]) for yaw in yaws]
    ends = np.cumsum([np.zeros(2), *(width * way for way in along)], axis=0)
    for yaw, start, end in zip(yaws, ends, ends[1:], strict=False):
        f.group(_panel((width, height), fabric), (*(start + end) / 2, 0.0), yaw)


def _panel(size: tuple[float, float], fabric: Floats) -> ObjectBuilder:
    """Return one panel perpendicular to its x axis: cloth in a frame on two feet."""
    (width, height), post, under, f = size, 0.03, 0.09, ObjectBuilder()
    inner = width - 2 * post
    f.box((0, 0, (height + under) / 2), (0.028, inner, height - under - 2 * post), fabric)
    f.box((0, 0, height - post / 2), (0.036, inner, post), _FRAME)
    f.box((0, 0, under + post / 2), (0.036, inner, post), _FRAME)
    for side in (-0.5, 0.5):
        y = side * (width - post)
        f.box((0, y, (height + 0.03) / 2), (0.036, post, height - 0.03), _FRAME)
        f.box((0, y, 0.015), (0.34, post, 0.03), 0.7 * _FRAME)
    return f


def cart(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a service cart that moves along its x axis: two trays between four posts on wheels, with cartons."""
    length, width, height = rng.uniform(0.75, 0.95), rng.uniform(0.45, 0.55), rng.uniform(0.82, 0.95)
    sizes, places = rng.uniform([0.22, 0.2, 0.15], [0.34, 0.32, 0.3], (3, 3)), rng.uniform(-1, 1, (3, 2))
    colors, turns = BOX_COLORS[rng.integers(len(BOX_COLORS), size=3)], rng.uniform(-0.25, 0.25, 3)
    x, y = length / 2 - 0.02, width / 2 - 0.02
    trays = (0.17, height - 0.12)
    for z in trays:
        f.box((0, 0, z), (length, width, 0.02), _STEEL)
        for side in (-1.0, 1.0):
            f.box((side * (length / 2 - 0.008), 0, z + 0.035), (0.016, width, 0.05), 0.92 * _STEEL)
            f.box((0, side * (width / 2 - 0.008), z + 0.035), (length - 0.032, 0.016, 0.05), 0.92 * _STEEL)
    for side in (-1.0, 1.0):
        for end in (-1.0, 1.0):
            f.bar((end * x, side * y, 2 * _WHEEL), (end * x, side * y, height), 0.014, 0.8 * _STEEL)
            f.bar((end * x, side * y - 0.018, _WHEEL), (end * x, side * y + 0.018, _WHEEL), _WHEEL, _RUBBER)
    for end in (-1.0, 1.0):
        f.bar((end * x, -y, height), (end * x, y, height), 0.016, 0.35 * _STEEL)
    for k, (size, place) in enumerate(zip(sizes, places, strict=True)):
        slot = (0.0 if k == 0 else (-1.0) ** k * length / 4) + 0.05 * place[0]
        where = (slot, 0.04 * place[1], trays[0 if k == 0 else 1] + 0.01)
        f.group(_taped(size, colors[k]), where, turns[k])


def _taped(size: Floats, color: Floats) -> ObjectBuilder:
    """Return a box as three slices side by side, the middle one with a paler top as packing tape."""
    f, pale = ObjectBuilder(), 0.45 * color + 0.55 * np.array([0.93, 0.89, 0.80])
    for low, high in pairwise((-size[1] / 2, -_TAPE / 2, _TAPE / 2, size[1] / 2)):
        f.box((0, (low + high) / 2, size[2] / 2), (size[0], high - low, size[2]), color)
    return f.box((0, 0, size[2]), (size[0], _TAPE, 0.002), pale)


def table(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a table of usual height, rectangular or round, with a few objects on it."""
    depth, width, height = rng.uniform(0.70, 0.85), rng.uniform(1.1, 1.5), 0.735
    is_round = rng.uniform() < 0.35
    wood = WOOD[rng.integers(len(WOOD))]
    diameter = rng.uniform(0.85, 1.05)
    if is_round:
        f.bar((0, 0, height - _TOP), (0, 0, height), diameter / 2, wood)
        f.bar((0, 0, 0.03), (0, 0, height - _TOP), 0.045, _METAL)
        f.bar((0, 0, 0), (0, 0, 0.03), 0.26, _METAL)
        reach = np.array([0.55, 0.55]) * diameter / 2
    else:
        _table(f, (depth, width, height), wood)
        reach = 0.7 * np.array([depth, width]) / 2
    _put_tabletop_objects(f, rng, height, reach)


def _table(f: ObjectBuilder, size: tuple[float, float, float], wood: Floats) -> None:
    """Add a plain table of depth x, width y and height z, metres."""
    (depth, width, height), leg = size, 0.055
    f.box((0, 0, height - _TOP / 2), (depth, width, _TOP), wood)
    x, y = depth / 2 - leg, width / 2 - leg
    under = height - _TOP
    for side in (-1.0, 1.0):
        f.box((side * x, 0, under - 0.035), (0.02, 2 * y, 0.07), 0.88 * wood)
        f.box((0, side * y, under - 0.035), (2 * x, 0.02, 0.07), 0.88 * wood)
        for other in (-1.0, 1.0):
            f.box((side * x, other * y, under / 2), (leg, leg, under), 0.92 * wood)


def _put_tabletop_objects(f: ObjectBuilder, rng: np.random.Generator, height: float, reach: Floats) -> None:
    """Put books, a mug and a laptop on a table, each by chance and in a separate corner."""
    chance, offset, turn = rng.uniform(size=3), rng.uniform(-0.3, 0.3, (3, 2)), rng.uniform(-0.5, 0.5, 3)
    thick, tint = rng.uniform(0.018, 0.04, 3), rng.integers(len(BOOK_COLORS), size=4)
    corners = np.array([[-0.5, -0.75], [0.4, 0.8], [0.0, 0.05]]) + 0.3 * offset
    places = corners * reach
    if chance[0] < 0.8:
        z = height
        for k in range(3):
            x, y = places[0] + 0.01 * offset[k]
            size = (0.21 - 0.015 * k, 0.155 - 0.01 * k, thick[k])
            f.box((x, y, z + thick[k] / 2), size, BOOK_COLORS[tint[k]], yaw=turn[k])
            z += thick[k]
    if chance[1] < 0.7:
        profile = [(0.0, 0.0), (0.036, 0.0), (0.041, 0.095), (0.036, 0.095), (0.034, 0.02), (0.0, 0.02)]
        f.turned(profile, _PORCELAIN, at=(*places[1], height), sides=12)
    if chance[2] < 0.6:
        x, y = places[2]
        f.box((x, y, height + 0.009), (0.23, 0.33, 0.018), 2.2 * _METAL, yaw=turn[2])
        c, s = np.cos(turn[2]), np.sin(turn[2])
        f.box((x - 0.12 * c, y - 0.12 * s, height + 0.12), (0.012, 0.33, 0.22), 0.6 * _METAL, yaw=turn[2])


def plain_table(f: ObjectBuilder, k: int) -> None:
    """Draw a table with nothing on it."""
    _table(f, (0.8, 1.4, 0.74), WOOD[k])


def chair(f: ObjectBuilder, k: int) -> None:
    """Draw a chair with an upholstered or a wooden seat; it faces +x, and its back at -x leans backwards."""
    depth, width, height = f.size = (0.45, 0.45, 0.45)  # of the seat
    f.origin = (0.0, 0.0, 0.0)  # the middle of the seat
    colors = np.concatenate([_FABRIC, WOOD])
    color, padded = colors[k], k < len(_FABRIC)
    frame = _METAL if padded else 0.88 * color
    x, y, leg = depth / 2 - 0.025, width / 2 - 0.025, 0.016
    f.box((0, 0, height - _SEAT / 2), (depth, width, _SEAT), color)
    for side in (-1.0, 1.0):
        f.bar((x, side * y, 0), (x, side * y, height - _SEAT), leg, frame)
        f.bar((-x, side * y, 0), (-x, side * y, height - _SEAT), leg, frame)
        f.bar((-x - 0.01, side * y, height - _SEAT), (-x - _LEAN, side * y, height + _BACK), leg, frame)
    lean = np.arctan2(_LEAN - 0.01, _BACK + _SEAT)
    for low, high in [(0.16, 0.40)] if padded else [(0.14, 0.21), (0.25, 0.31), (0.35, 0.40)]:
        middle = (low + high) / 2
        back = -x - 0.01 - (_LEAN - 0.01) * (middle + _SEAT) / (_BACK + _SEAT)
        f.box((back, 0, height + middle), (0.026, width - 0.05, (high - low) / np.cos(lean)), color, tilt=-lean)


def step(f: ObjectBuilder, k: int) -> None:
    """Draw an exercise step: a dark tread on a coloured block."""
    depth, width, height, tread = 0.4, 0.6, 0.18, 0.02
    color = ([0.25, 0.42, 0.58], [0.62, 0.36, 0.28], [0.42, 0.44, 0.47])[k]
    f.box((0, 0, (height - tread) / 2), (0.94 * depth, 0.96 * width, height - tread), color)
    f.box((0, 0, height - tread / 2), (depth, width, tread), (0.22, 0.23, 0.25))


def bottle(f: ObjectBuilder, k: int) -> None:
    """Draw a bottle with a label and a cap."""
    shape = [(0, 0), (0.92, 0), (1, 0.03), (1, 0.22), (1, 0.52), (1, 0.62), (0.40, 0.80), (0.36, 0.90), (0.44, 0.90)]
    profile = np.array([*shape, (0.44, 1.0), (0, 1.0)]) * [0.04, 0.26]
    glass = _GLASS[k]
    f.size = (0.08, 0.08, 0.26)
    f.turned(profile, [glass, glass, glass, _LABEL, glass, glass, glass, _CAP, _CAP, _CAP])


def booth(f: ObjectBuilder, k: int) -> None:
    """Draw a closed booth: walls on both sides, a roof, and curtains in folds at both ends of its x axis."""
    depth, width, height = 1.4, 1.1, 2.0
    side = np.array([[0.78, 0.76, 0.72], [0.66, 0.70, 0.74], [0.74, 0.70, 0.62]])[k]
    curtain = np.array([[0.46, 0.16, 0.18], [0.16, 0.26, 0.42], [0.20, 0.36, 0.26]])[k]
    inner = width - 2 * _BOARD
    for end in (-1, 1):
        f.box((0, end * (width / 2 - _BOARD / 2), height / 2), (depth, _BOARD, height), side)
    f.box((0, 0, height - _BOARD / 2), (depth, inner, _BOARD), 0.8 * side)
    fold = inner / _FOLDS
    for end in (-1, 1):
        for n in range(_FOLDS):
            y = (n + 0.5) * fold - inner / 2
            shade = curtain * (1.0 if n % 2 else 0.75)
            back = 0.012 * (n % 2)
            f.box((end * (depth / 2 - 0.03 - back), y, (height - _BOARD) / 2), (0.02, fold, height - _BOARD), shade)


def door(f: ObjectBuilder, k: int) -> None:
    """Draw an open doorway to a dark corridor: an unlit panel in a frame, thin enough to lie on a wall."""
    depth, width, height, rim = 0.06, 1.1, 2.15, 0.07
    frame = ([0.86, 0.84, 0.80], [0.62, 0.50, 0.38], [0.50, 0.52, 0.55])[k]
    f.box((0, 0, (height - rim) / 2), (depth / 2, width - 2 * rim, height - rim), _CORRIDOR)
    for y in (-1, 1):
        f.box((0, y * (width - rim) / 2, height / 2), (depth, rim, height), frame)
    f.box((0, 0, height - rim / 2), (depth, width - 2 * rim, rim), frame)
