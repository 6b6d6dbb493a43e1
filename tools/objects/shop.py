"""Furniture of a shop."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.shapes import loft
from tools.objects.belongings import (
    DARK,
    STEEL,
    WHITE,
    put_bottle,
    put_cable,
    put_carton,
    put_holdall,
    put_papers,
    some_cloth,
)
from tools.objects.builder import ObjectBuilder
from tools.objects.office import BEECH, OAK, WALNUT

_PACKAGES = 8  # prints of packages


def put_package(f: ObjectBuilder, x: float, y: float, z: float, size: tuple[float, float, float], number: int) -> None:
    """Put a package with its print to the front; ``size`` is depth, width and height, ``x`` its front."""
    deep, wide, tall = size
    f.block((x - deep, y - wide / 2, z), (x, y + wide / 2, z + tall), (0.72, 0.70, 0.66))
    f.front_print(f"package{number % _PACKAGES}", x + 0.001, y, z + tall / 2, (wide, tall))


def goods(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a shop shelf with rows of packages and bottles, price strips, and a header."""
    wide, tall, deep = rng.uniform(1.0, 1.3), rng.uniform(1.75, 2.05), 0.42
    color = np.array([0.84, 0.84, 0.82])
    f.block((-deep / 2, -wide / 2, 0.0), (-deep / 2 + 0.02, wide / 2, tall), color)
    for y in (-wide / 2, wide / 2):
        f.block((-deep / 2 + 0.02, y - 0.012, 0.0), (deep / 2, y + 0.012, tall), 0.9 * color)
    header = np.array([[0.30, 0.42, 0.36], [0.50, 0.22, 0.20], [0.22, 0.30, 0.44], [0.60, 0.46, 0.24]])[rng.integers(4)]
    f.block((-deep / 2 + 0.02, -wide / 2 + 0.012, tall - 0.16), (0.02, wide / 2 - 0.012, tall), header)
    levels = np.linspace(0.12, tall - 0.42, int(rng.integers(4, 6)))
    f.block(
        (-deep / 2 + 0.02, -wide / 2 + 0.012, 0.0), (deep / 2 - 0.03, wide / 2 - 0.012, levels[0] - 0.02), 0.55 * color
    )
    for z, above in pairwise([*levels, tall - 0.14]):
        f.block((-deep / 2 + 0.02, -wide / 2 + 0.012, z - 0.02), (deep / 2, wide / 2 - 0.012, z), color)
        f.block((deep / 2, -wide / 2 + 0.012, z - 0.04), (deep / 2 + 0.008, wide / 2 - 0.012, z), 1.08 * color)
        at = -wide / 2 + 0.03
        while at < wide / 2 - 0.12:
            each, high, number = (
                rng.uniform(0.08, 0.15),
                (above - z - 0.03) * rng.uniform(0.55, 0.9),
                int(rng.integers(_PACKAGES)),
            )
            back = rng.uniform(0.0, 0.08)
            for _ in range(int(rng.integers(1, 5))):
                if at + each > wide / 2 - 0.02:
                    break
                put_package(f, deep / 2 - 0.02 - back, at + each / 2, z, (0.22, each - 0.006, high), number)
                at += each
            at += rng.uniform(0.0, 0.05)


def counter(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a counter with a till, a card reader, leaflets and a bag."""
    wide, wood = rng.uniform(1.5, 2.0), np.array([OAK, BEECH, WALNUT])[rng.integers(3)]
    f.block((-0.30, -wide / 2, 0.08), (0.30, wide / 2, 0.90), wood, "wood")
    f.block((-0.28, -wide / 2 + 0.02, 0.0), (0.27, wide / 2 - 0.02, 0.08), DARK)
    f.block((-0.34, -wide / 2 - 0.03, 0.90), (0.36, wide / 2 + 0.03, 0.94), (0.80, 0.79, 0.76))
    f.box((-0.05, 0.1, 0.99), (0.36, 0.40, 0.10), 1.8 * DARK)
    f.box((-0.10, 0.1, 1.15), (0.03, 0.05, 0.24), DARK)
    f.cushion((-0.06, 0.1, 1.28), (0.04, 0.36, 0.26), DARK, "plain", radius=0.015, tilt=0.25)
    f.box((0.16, -0.25, 0.965), (0.16, 0.09, 0.05), 1.4 * DARK)
    for y in (-0.38 * wide, -0.30 * wide):
        put_package(f, 0.2, y, 0.94, (0.10, 0.12, 0.18), int(rng.integers(_PACKAGES)))
    put_papers(f, rng, 0.12, 0.4 * wide - 0.1, 0.94)
    put_cable(f, rng, (-0.29, 0.1), (-0.32, 0.5 * wide))
    put_holdall(f, rng, 0.50, 0.3 * wide, rng.normal(0, 0.3))


def clothes(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a rail with clothes on hangers, and shoe boxes under it."""
    wide = rng.uniform(1.2, 1.7)
    for y in (-wide / 2, wide / 2):
        f.bar((0, y, 0.03), (0, y, 1.55), 0.018, DARK)
        f.bar((-0.24, y, 0.03), (0.24, y, 0.03), 0.018, DARK)
    f.bar((0, -wide / 2, 1.53), (0, wide / 2, 1.53), 0.015, STEEL, "metal")
    at, color = -wide / 2 + 0.08, some_cloth(rng)
    while at < wide / 2 - 0.08:
        if rng.uniform() < 0.5:
            color = np.clip(some_cloth(rng) + rng.uniform(0.0, 0.3), 0, 1)
        long = rng.uniform(0.62, 0.95)
        f.part(
            _garment(long, color * rng.uniform(0.94, 1.05)), "fabric", center=(0.0, at, 1.47), yaw=rng.normal(0, 0.12)
        )
        f.bar((0, at, 1.46), (0, at, 1.55), 0.004, STEEL, sides=5)
        at += rng.uniform(0.055, 0.1)
    for k in range(int(rng.integers(1, 4))):
        put_carton(f, rng, 0.0, -0.3 * wide + 0.36 * k, 0.0, (0.30, 0.20, 0.12), rng.normal(0, 0.15))


def _garment(long: float, color: Floats) -> Mesh:
    """Return a garment on a hanger, seen from its edge: shoulders at z = 0, hanging down."""
    rows = np.array(
        [(0.0, 0.05, 0.01), (-0.03, 0.14, 0.02), (-0.09, 0.22, 0.028), (-0.4, 0.20, 0.024), (-long, 0.23, 0.03)]
    )
    turn = 2 * np.pi * np.arange(10) / 10
    rings = np.stack([np.column_stack([w * np.cos(turn), d * np.sin(turn), np.full(10, z)]) for z, w, d in rows[::-1]])
    return loft(rings, color)


def display(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a table with folded clothes in piles and a pyramid of packages."""
    wood = np.array([OAK, BEECH, WALNUT])[rng.integers(3)]
    f.block((-0.40, -0.70, 0.72), (0.40, 0.70, 0.77), wood, "wood")
    f.block((-0.35, -0.62, 0.28), (0.35, 0.62, 0.31), 0.95 * wood, "wood")
    for x in (-0.34, 0.34):
        for y in (-0.62, 0.62):
            f.block((x - 0.03, y - 0.03, 0.0), (x + 0.03, y + 0.03, 0.72), 0.9 * wood, "wood")
    for x in (-0.17, 0.19):
        for y in (-0.48, -0.12):
            color = np.clip(some_cloth(rng) + rng.uniform(0.05, 0.35), 0, 1)
            for k in range(int(rng.integers(2, 6))):
                f.cushion((x, y, 0.79 + 0.038 * k), (0.30, 0.28, 0.038), color * rng.uniform(0.94, 1.04), radius=0.016)
    number = int(rng.integers(_PACKAGES))
    for row in range(3):
        for k in range(3 - row):
            put_package(f, 0.14, 0.25 + 0.13 * k + 0.065 * row, 0.77 + 0.16 * row, (0.12, 0.125, 0.158), number)
    put_carton(f, rng, 0.0, 0.2, 0.31, (0.40, 0.36, 0.24), 0.1)


def fridge(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw an open cooler with bottles on four shelves."""
    color = np.array([[0.86, 0.87, 0.88], [0.20, 0.22, 0.24]])[rng.integers(2)]
    f.block((-0.34, -0.40, 0.0), (-0.28, 0.40, 1.95), color)
    for y in (-0.40, 0.36):
        f.block((-0.28, y, 0.0), (0.30, y + 0.04, 1.95), color)
    f.block((-0.28, -0.36, 0.0), (0.30, 0.36, 0.30), color)
    f.block((-0.28, -0.36, 1.72), (0.30, 0.36, 1.95), color)
    f.front_print(f"package{rng.integers(_PACKAGES)}", 0.301, 0.0, 1.835, (0.70, 0.20))
    for z in (0.30, 0.66, 1.02, 1.38):
        if z > 0.3:
            f.block((-0.28, -0.36, z - 0.015), (0.24, 0.36, z), 0.9 * STEEL)
        for y in np.arange(-0.31, 0.34, 0.088):
            put_bottle(f, rng, 0.18 - 0.02 * rng.uniform(), y, z, 0.27)


def stock(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw cartons of delivered goods, one open, with a trolley's handle behind them."""
    put_carton(f, rng, 0.0, -0.25, 0.0, (0.42, 0.46, 0.36), rng.normal(0, 0.1))
    put_carton(f, rng, 0.02, 0.25, 0.0, (0.40, 0.40, 0.30), rng.normal(0, 0.1))
    put_carton(f, rng, 0.0, -0.2, 0.362, (0.36, 0.38, 0.28), rng.normal(0, 0.2))
    if rng.uniform() < 0.6:
        put_carton(f, rng, 0.0, -0.18, 0.644, (0.30, 0.28, 0.2), rng.normal(0, 0.2))
    basket = np.array([0.24, 0.34, 0.44])
    for k in range(int(rng.integers(2, 6))):
        z, y = 0.06 * k, 0.72
        f.block((-0.15, y - 0.22, z), (0.15, y + 0.22, z + 0.01), basket)
        for side in (-1, 1):
            f.block((side * 0.15 - 0.006, y - 0.22, z), (side * 0.15 + 0.006, y + 0.22, z + 0.22), basket)
            f.block((-0.15, y + side * 0.22 - 0.006, z), (0.15, y + side * 0.22 + 0.006, z + 0.22), basket)
    f.block((-0.02, 0.5, 0.22), (-0.005, 0.94, 0.24), WHITE)
