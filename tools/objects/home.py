"""Furniture of a living room."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from tools.objects.belongings import (
    DARK,
    STEEL,
    WHITE,
    put_books,
    put_cable,
    put_mug,
    put_papers,
    put_shoes,
    put_stack,
    some_cloth,
)
from tools.objects.builder import ObjectBuilder
from tools.objects.office import some_wood

_SOFAS = np.array([[0.42, 0.43, 0.45], [0.50, 0.44, 0.37], [0.24, 0.31, 0.38], [0.34, 0.40, 0.34], [0.46, 0.28, 0.22]])
_LAMPSHADE = np.array([0.93, 0.89, 0.80])


def sofa(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a sofa for two or three with pillows and a blanket."""
    seats = int(rng.integers(2, 4))
    wide, color = 0.66 * seats, _SOFAS[rng.integers(len(_SOFAS))] * rng.uniform(0.9, 1.1)
    _seat(f, wide, color, seats)
    for _ in range(int(rng.integers(1, 4))):
        tint, y = np.clip(some_cloth(rng) + 0.18, 0, 1), rng.uniform(-0.4, 0.4) * wide
        f.cushion((-0.06, y, 0.64), (0.15, 0.42, 0.40), tint, radius=0.07, tilt=-0.35, yaw=rng.normal(0, 0.15))
    tint, side = np.clip(some_cloth(rng) + 0.12, 0, 1), rng.choice([-1, 1])
    f.cushion((0.12, side * (wide / 2 + 0.11), 0.62), (0.50, 0.27, 0.035), tint, radius=0.016)
    f.cushion((0.12, side * (wide / 2 + 0.24), 0.42), (0.46, 0.03, 0.40), 0.95 * tint, radius=0.014)


def armchair(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw an armchair with a floor lamp and a small table with a cup beside it."""
    _seat(f, 0.62, _SOFAS[rng.integers(len(_SOFAS))] * rng.uniform(0.85, 1.15), 1)
    side = rng.choice([-1, 1])
    y = side * 0.72
    f.turned([(0, 0), (0.15, 0), (0.15, 0.02), (0.012, 0.03), (0.012, 1.5), (0, 1.5)], DARK, at=(-0.22, y, 0), sides=16)
    f.turned([(0, 1.46), (0.20, 1.42), (0.14, 1.70), (0, 1.70)], _LAMPSHADE, "fabric", at=(-0.22, y, 0), sides=18)
    wood = some_wood(rng)
    f.turned([(0, 0), (0.13, 0), (0.13, 0.015), (0.02, 0.02), (0.02, 0.45), (0, 0.45)], DARK, at=(0.2, y, 0))
    f.turned([(0, 0.45), (0.21, 0.45), (0.21, 0.475), (0, 0.475)], wood, "wood", at=(0.2, y, 0), sides=22)
    put_mug(f, rng, 0.25, y + 0.05, 0.475)
    put_stack(f, rng, 0.12, y - 0.04, 0.475, count=2)


def _seat(f: ObjectBuilder, wide: float, color: Floats, seats: int) -> None:
    """Add the base, back, arms and seat cushions of a sofa or an armchair."""
    f.cushion((0.0, 0.0, 0.21), (0.86, wide + 0.36, 0.26), 0.92 * color, radius=0.04)
    f.cushion((-0.34, 0.0, 0.50), (0.20, wide + 0.36, 0.66), 0.95 * color, radius=0.08, tilt=-0.08)
    for side in (-1, 1):
        f.cushion((0.0, side * (wide / 2 + 0.10), 0.36), (0.84, 0.20, 0.48), color, radius=0.07)
        for x in (-0.36, 0.36):
            f.bar((x, side * (wide / 2 + 0.08), 0.0), (x, side * (wide / 2 + 0.08), 0.09), 0.02, (0.25, 0.18, 0.12))
    each = wide / seats
    for k in range(seats):
        y = (k - (seats - 1) / 2) * each
        f.cushion((0.07, y, 0.40), (0.66, each - 0.01, 0.17), color, radius=0.055)
        f.cushion((-0.22, y, 0.66), (0.17, each - 0.02, 0.40), 1.03 * color, radius=0.065, tilt=-0.2)


def television(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a low board with a television, a loudspeaker, a router, books and cables."""
    wide, wood = rng.uniform(1.5, 1.9), some_wood(rng)
    f.block((-0.20, -wide / 2, 0.10), (0.20, wide / 2, 0.46), wood, "wood")
    for k in range(3):
        low, high = -wide / 2 + k * wide / 3 + 0.006, -wide / 2 + (k + 1) * wide / 3 - 0.006
        f.block((0.20, low, 0.11), (0.217, high, 0.45), 0.96 * wood, "wood")
        f.bar((0.217, high - 0.05, 0.28), (0.235, high - 0.05, 0.28), 0.012, STEEL, "metal")
    for side in (-1, 1):
        for x in (-0.15, 0.15):
            f.bar((x, side * (wide / 2 - 0.1), 0.0), (x, side * (wide / 2 - 0.1), 0.10), 0.018, 0.6 * wood)
    f.box((-0.03, 0.0, 0.468), (0.22, 0.36, 0.016), DARK)
    f.box((-0.06, 0.0, 0.52), (0.03, 0.10, 0.10), DARK)
    f.box((-0.05, 0.0, 0.86), (0.045, 1.16, 0.66), DARK)
    f.box((-0.0265, 0.0, 0.865), (0.003, 1.13, 0.63), (0.05, 0.06, 0.08))
    f.cushion((0.0, -wide / 2 + 0.12, 0.56), (0.15, 0.14, 0.20), 1.4 * DARK, radius=0.03)
    put_stack(f, rng, 0.02, wide / 2 - 0.16, 0.46, count=4)
    put_cable(f, rng, (-0.17, -0.2), (-0.12, wide / 2 - 0.1))


def bookshelf(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a wide shelf of boxes, some with books, some with baskets, some with single things."""
    wood, cell, columns, rows = some_wood(rng), 0.36, int(rng.integers(2, 5)), int(rng.integers(3, 6))
    wide, tall = columns * cell + 0.04, rows * cell + 0.04
    f.block((-0.19, -wide / 2, 0.0), (-0.175, wide / 2, tall), 0.85 * wood, "plain")
    for k in range(columns + 1):
        y = -wide / 2 + 0.02 + k * cell
        f.block((-0.175, y - 0.02, 0.0), (0.19, y + 0.02, tall), wood, "wood")
    for k in range(rows + 1):
        for n in range(columns):
            y = -wide / 2 + 0.04 + n * cell
            f.block((-0.175, y, k * cell), (0.19, y + cell - 0.04, k * cell + 0.04), 0.97 * wood, "wood")
    for row in range(rows):
        for column in range(columns):
            y, z, what = -wide / 2 + 0.04 + column * cell, row * cell + 0.04, rng.uniform()
            if what < 0.45:
                put_books(f, rng, (-0.15, y + 0.005, z), (0.24, (cell - 0.05) * rng.uniform(0.6, 1.0), 0.27))
            elif what < 0.65:
                f.cushion((0.0, y + cell / 2 - 0.02, z + 0.12), (0.30, 0.29, 0.23), (0.62, 0.52, 0.38), radius=0.03)
            elif what < 0.8:
                vase = np.array([(0, 0), (0.05, 0), (0.08, 0.08), (0.03, 0.19), (0.04, 0.22), (0, 0.22)])
                f.turned(vase, np.clip(some_cloth(rng) + 0.2, 0, 1), at=(0.02, y + cell / 2 - 0.02, z))


def dining_table(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a table with chairs on its free sides, with cups, papers and a bowl."""
    wood, wide, deep = some_wood(rng), rng.uniform(1.2, 1.6), 0.8
    f.block((-deep / 2, -wide / 2, 0.715), (deep / 2, wide / 2, 0.75), wood, "wood")
    for x in (-deep / 2 + 0.06, deep / 2 - 0.06):
        for y in (-wide / 2 + 0.06, wide / 2 - 0.06):
            f.block((x - 0.03, y - 0.03, 0.0), (x + 0.03, y + 0.03, 0.715), 0.95 * wood, "wood")
    bowl = [(0, 0), (0.06, 0), (0.14, 0.07), (0.135, 0.07), (0.05, 0.015), (0, 0.015)]
    f.turned(bowl, WHITE, at=(-0.05, 0.1, 0.75), sides=18)
    for k, color in enumerate(((0.72, 0.25, 0.14), (0.80, 0.58, 0.15), (0.42, 0.55, 0.18))):
        y = 0.1 + 0.05 * np.cos(2.1 * k)
        f.turned(
            np.array([(0, -1), (0.7, -0.7), (1, 0), (0.7, 0.7), (0, 1)]) * 0.036,
            color,
            at=(-0.05 + 0.05 * np.sin(2.1 * k), y, 0.80),
            sides=10,
        )
    put_mug(f, rng, 0.18, -0.3, 0.75)
    put_papers(f, rng, 0.12, wide / 2 - 0.3, 0.75)
    for k in range(2):
        wooden_chair(
            f, rng, deep / 2 + 0.12, (k - 0.5) * wide * 0.5 + rng.normal(0, 0.04), np.pi + rng.normal(0, 0.15), wood
        )


def wooden_chair(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, yaw: float, wood: Floats) -> None:
    """Put a wooden chair with a slatted back, and sometimes a jacket over it."""
    chair = ObjectBuilder()
    chair.cushion((0, 0, 0.45), (0.43, 0.43, 0.03), wood, "wood", radius=0.014)
    for side in (-0.18, 0.18):
        chair.bar((0.18, side, 0.0), (0.17, side, 0.44), 0.017, 0.93 * wood, "wood", sides=7)
        chair.bar((-0.18, side, 0.0), (-0.17, side, 0.45), 0.017, 0.93 * wood, "wood", sides=7)
        chair.bar((-0.17, side, 0.45), (-0.25, side, 0.88), 0.016, 0.93 * wood, "wood", sides=7)
    for z in (0.60, 0.72, 0.84):
        x_at = -0.17 - 0.08 * (z - 0.45) / 0.43
        chair.box((x_at, 0.0, z), (0.018, 0.36, 0.06), wood, "wood")
    if rng.uniform() < 0.35:
        chair.cushion((-0.235, 0.0, 0.70), (0.11, 0.46, 0.46), some_cloth(rng), radius=0.05, tilt=-0.18)
    f.group(chair, (x, y, 0.0), yaw)


def sideboard(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a chest of drawers with a lamp and a picture on it, and shoes before it."""
    wood, wide = some_wood(rng), rng.uniform(0.9, 1.3)
    f.block((-0.22, -wide / 2, 0.08), (0.21, wide / 2, 0.82), wood, "wood")
    f.block((-0.23, -wide / 2 - 0.01, 0.82), (0.235, wide / 2 + 0.01, 0.845), 0.95 * wood, "wood")
    for low in (0.10, 0.34, 0.58):
        for side in (-1, 1):
            a, b = sorted((side * 0.004, side * (wide / 2 - 0.012)))
            f.block((0.21, a, low), (0.226, b, low + 0.225), 0.98 * wood, "wood")
            f.bar((0.226, (a + b) / 2, low + 0.12), (0.25, (a + b) / 2, low + 0.12), 0.014, STEEL, "metal")
    for side in (-1, 1):
        for x in (-0.17, 0.16):
            f.bar((x, side * (wide / 2 - 0.06), 0.0), (x, side * (wide / 2 - 0.06), 0.08), 0.02, 0.8 * wood)
    side = rng.choice([-1, 1])
    foot = [(0, 0), (0.07, 0), (0.09, 0.08), (0.03, 0.2), (0.012, 0.22), (0.012, 0.3), (0, 0.3)]
    f.turned(foot, np.clip(some_cloth(rng) + 0.2, 0, 1), at=(-0.02, side * 0.3 * wide, 0.845))
    f.turned(
        [(0, 0.28), (0.15, 0.26), (0.10, 0.45), (0, 0.45)], _LAMPSHADE, "fabric", at=(-0.02, side * 0.3 * wide, 0.845)
    )
    f.box((-0.10, -side * 0.2 * wide, 1.0), (0.02, 0.34, 0.28), DARK)
    f.front_print(f"landscape{rng.integers(2)}", -0.0895, -side * 0.2 * wide, 1.0, (0.30, 0.24))
    for k in range(2):
        put_shoes(f, rng, 0.42, (k - 0.5) * 0.5 + rng.normal(0, 0.05), np.pi + rng.normal(0, 0.3))
