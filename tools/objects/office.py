"""Furniture of an office."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from tools.objects.belongings import (
    DARK,
    STEEL,
    WHITE,
    put_backpack,
    put_books,
    put_cable,
    put_carton,
    put_mug,
    put_papers,
    put_stack,
    some_cloth,
)
from tools.objects.builder import ObjectBuilder

OAK, BEECH, WALNUT = np.array([0.66, 0.50, 0.34]), np.array([0.80, 0.67, 0.50]), np.array([0.42, 0.30, 0.22])
PAINTED = np.array([0.86, 0.86, 0.84])


def some_wood(rng: np.random.Generator) -> Floats:
    """Draw a colour of furniture: a wood, or white."""
    return np.asarray(np.array([OAK, BEECH, WALNUT, PAINTED])[rng.integers(4)] * rng.uniform(0.92, 1.06))


def workstation(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a desk at the wall with screens, keyboard and papers, a drawer unit, a chair, a bag and cables."""
    wide, top = rng.uniform(1.4, 1.7), 0.73
    wood = some_wood(rng)
    f.block((-0.40, -wide / 2, top - 0.025), (0.40, wide / 2, top), wood, "wood")
    for side in (-1, 1):
        y = side * (wide / 2 - 0.08)
        f.block((-0.35, y - 0.02, 0.0), (0.35, y + 0.02, 0.025), STEEL, "metal")
        f.block((-0.03, y - 0.03, 0.025), (0.03, y + 0.03, top - 0.025), STEEL, "metal")
        f.block((-0.35, y - 0.02, top - 0.05), (0.35, y + 0.02, top - 0.025), STEEL, "metal")
    f.block((-0.38, -wide / 2 + 0.1, 0.35), (-0.365, wide / 2 - 0.1, top - 0.03), 0.95 * wood, "wood")
    screens = int(rng.integers(1, 3))
    for k in range(screens):
        y = (k - (screens - 1) / 2) * 0.58
        put_screen(f, rng, -0.22, y, top, turn=-0.22 * (y > 0) + 0.22 * (y < 0))
    f.box((0.12, 0.0, top + 0.011), (0.14, 0.44, 0.022), 1.4 * DARK)
    for row in range(4):
        f.box((0.075 + 0.03 * row, 0.0, top + 0.024), (0.022, 0.42, 0.006), 2.2 * DARK)
    f.cushion((0.13, 0.30, top + 0.015), (0.10, 0.06, 0.03), 1.5 * DARK, "plain", radius=0.014)
    put_mug(f, rng, rng.uniform(-0.05, 0.2), -0.42, top)
    put_papers(f, rng, 0.1, wide / 2 - 0.22, top)
    put_stack(f, rng, -0.2, -wide / 2 + 0.2, top)
    drawers(f, (-0.28, wide / 2 - 0.42 if rng.uniform() < 0.5 else -wide / 2 + 0.42), wood)
    swivel_chair(f, rng, 0.72, rng.uniform(-0.2, 0.2), np.pi + rng.normal(0, 0.5))
    put_backpack(f, rng, 0.45, (wide / 2 - 0.1) * rng.choice([-1, 1]), rng.uniform(-0.5, 0.5))
    bin_at = -0.18, rng.choice([-0.25, 0.25])
    f.turned([(0, 0), (0.11, 0), (0.14, 0.30), (0.13, 0.30), (0.105, 0.02), (0, 0.02)], 1.6 * DARK, at=(*bin_at, 0.0))
    put_cable(f, rng, (-0.36, -0.1), (-0.2, 0.3))


def put_screen(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, z: float, *, turn: float) -> None:
    """Put a computer's screen on a desk."""
    monitor = ObjectBuilder()
    monitor.box((0.0, 0.0, 0.006), (0.20, 0.24, 0.012), 1.6 * DARK)
    monitor.box((-0.03, 0.0, 0.13), (0.02, 0.05, 0.25), 1.6 * DARK)
    monitor.box((0.0, 0.0, 0.32), (0.035, 0.56, 0.335), DARK)
    monitor.front_print(f"screen{rng.integers(3)}", 0.0185, 0.0, 0.325, (0.535, 0.30))
    f.group(monitor, (x, y, z), turn)


def drawers(f: ObjectBuilder, place: tuple[float, float], color: Floats) -> None:
    """Put a unit of three drawers on the floor."""
    x, y = place
    f.block((x, y - 0.21, 0.05), (x + 0.55, y + 0.21, 0.60), color, "wood")
    f.block((x + 0.03, y - 0.19, 0.0), (x + 0.52, y + 0.19, 0.05), DARK)
    for low, high in pairwise((0.06, 0.23, 0.41, 0.59)):
        f.block((x + 0.55, y - 0.205, low + 0.005), (x + 0.565, y + 0.205, high - 0.005), 0.96 * color, "wood")
        f.block((x + 0.565, y - 0.06, high - 0.04), (x + 0.58, y + 0.06, high - 0.025), STEEL, "metal")


def swivel_chair(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, yaw: float) -> None:
    """Put an office chair: five feet on castors, a seat, a back and arms."""
    color, chair = some_cloth(rng), ObjectBuilder()
    for k in range(5):
        c, s = np.cos(2 * np.pi * k / 5), np.sin(2 * np.pi * k / 5)
        chair.bar((0.03 * c, 0.03 * s, 0.11), (0.29 * c, 0.29 * s, 0.075), 0.018, 1.5 * DARK, sides=6)
        chair.bar(
            (0.29 * c - 0.02 * s, 0.29 * s + 0.02 * c, 0.03),
            (0.29 * c + 0.02 * s, 0.29 * s - 0.02 * c, 0.03),
            0.03,
            DARK,
            sides=8,
        )
    chair.bar((0, 0, 0.09), (0, 0, 0.42), 0.028, STEEL, "metal", sides=10)
    chair.cushion((0.0, 0.0, 0.46), (0.48, 0.49, 0.09), color, radius=0.04)
    chair.bar((-0.2, 0, 0.42), (-0.29, 0, 0.62), 0.022, 1.5 * DARK)
    chair.cushion((-0.29, 0.0, 0.80), (0.07, 0.44, 0.54), color, radius=0.033, tilt=-0.13)
    for side in (-0.29, 0.29):
        chair.bar((-0.02, 0.8 * side, 0.44), (-0.02, side, 0.52), 0.014, 1.5 * DARK, sides=6)
        chair.bar((-0.02, side, 0.52), (-0.02, side, 0.66), 0.014, 1.5 * DARK, sides=6)
        chair.cushion((0.0, side, 0.67), (0.26, 0.07, 0.03), 1.5 * DARK, "plain", radius=0.014)
    f.group(chair, (x, y, 0.0), yaw)


def cabinet(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a high cabinet with two doors, with cartons or folders on top."""
    wide, tall, deep = rng.uniform(0.8, 1.0), rng.uniform(1.75, 2.0), 0.42
    color = np.array([PAINTED, PAINTED, 0.8 * PAINTED, BEECH])[rng.integers(4)]
    f.block((-deep / 2, -wide / 2, 0.06), (deep / 2 - 0.02, wide / 2, tall), color, "wood")
    f.block((-deep / 2 + 0.02, -wide / 2 + 0.02, 0.0), (deep / 2 - 0.05, wide / 2 - 0.02, 0.06), DARK)
    for side in (-1, 1):
        near, far = sorted((side * 0.002, side * (wide / 2 - 0.004)))
        f.block((deep / 2 - 0.02, near, 0.065), (deep / 2, far, tall - 0.004), 0.97 * color, "wood")
        f.block((deep / 2, side * 0.05 - 0.008, 0.95), (deep / 2 + 0.025, side * 0.05 + 0.008, 1.12), STEEL, "metal")
    put_carton(f, rng, 0.0, -0.2, tall, (0.30, 0.34, 0.22), rng.normal(0, 0.1))
    if rng.uniform() < 0.6:
        put_books(f, rng, (-0.12, 0.05, tall), (0.24, 0.33, 0.30))


def bookcase(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw an open bookcase with rows of books, folders and things between them."""
    wide, tall, deep, board = rng.uniform(0.85, 1.2), rng.uniform(1.7, 2.05), 0.32, 0.022
    wood, levels = some_wood(rng), int(rng.integers(5, 7))
    for side in (-1, 1):
        y = side * (wide - board) / 2
        f.block((-deep / 2, y - board / 2, 0.0), (deep / 2, y + board / 2, tall), wood, "wood")
    f.block((-deep / 2, -wide / 2 + board, 0.0), (-deep / 2 + 0.008, wide / 2 - board, tall), 0.8 * wood, "wood")
    heights = np.linspace(0.07, tall - board, levels)
    for z in heights:
        f.block((-deep / 2 + 0.008, -wide / 2 + board, z), (deep / 2, wide / 2 - board, z + board), 0.95 * wood, "wood")
    inner = wide - 2 * board
    for z, above in pairwise(heights):
        room, filled = above - z - board, inner * rng.uniform(0.35, 0.9)
        sense, tall_row = rng.choice([-1, 1]), rng.uniform(0.7, 0.92)
        start = -inner / 2 if sense < 0 else inner / 2 - filled
        put_books(f, rng, (-deep / 2 + 0.02, start, z + board), (deep * 0.75, filled, room * tall_row))
        if inner - filled > 0.22 and rng.uniform() < 0.7:
            middle = -sense * (inner / 2 - (inner - filled) / 2)
            put_stack(f, rng, 0.0, middle, z + board, count=2)


def printer(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw an office copier on its paper drawers, with papers on top and a carton of paper beside it."""
    grey = np.array([0.78, 0.79, 0.80])
    f.block((-0.28, -0.30, 0.03), (0.28, 0.30, 0.62), grey)
    for low in (0.08, 0.26, 0.44):
        f.block((0.28, -0.285, low), (0.295, 0.285, low + 0.16), 0.92 * grey)
        f.block((0.295, -0.08, low + 0.11), (0.305, 0.08, low + 0.13), 2 * DARK)
    f.block((-0.28, -0.30, 0.66), (0.20, 0.30, 0.98), 1.05 * grey)
    f.block((-0.26, -0.28, 0.62), (0.18, 0.28, 0.66), 1.5 * DARK)
    f.block((-0.28, -0.30, 0.98), (0.22, 0.30, 1.06), 0.55 * grey)
    f.box((0.24, 0.16, 0.99), (0.12, 0.22, 0.03), DARK)
    put_papers(f, rng, -0.05, 0.0, 1.06)
    put_carton(f, rng, 0.0, 0.55, 0.0, (0.32, 0.24, 0.26), rng.normal(0, 0.1))
    put_carton(f, rng, 0.01, 0.55, 0.262, (0.31, 0.23, 0.24), rng.normal(0, 0.2))


def water_cooler(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a water cooler with its bottle and a stack of cups."""
    f.cushion((0, 0, 0.48), (0.31, 0.31, 0.95), WHITE, "plain", radius=0.03)
    f.block((0.15, -0.10, 0.62), (0.165, 0.10, 0.82), 0.5 * STEEL)
    for side, color in ((-0.05, (0.25, 0.40, 0.70)), (0.05, (0.72, 0.24, 0.20))):
        f.block((0.165, side - 0.012, 0.74), (0.20, side + 0.012, 0.77), color)
    bottle = [
        (0, 0),
        (0.05, 0),
        (0.06, 0.05),
        (0.13, 0.10),
        (0.135, 0.2),
        (0.125, 0.22),
        (0.135, 0.24),
        (0.135, 0.40),
        (0.10, 0.43),
        (0, 0.43),
    ]
    f.turned(bottle, (0.62, 0.76, 0.86), at=(0, 0, 0.95), sides=18)
    f.bar((0.0, 0.175, 0.70), (0.0, 0.175, 0.95), 0.035, WHITE, sides=12)
