"""Equipment of a gym."""

from __future__ import annotations

import numpy as np

from tools.objects.belongings import DARK, STEEL, put_bottle, put_holdall, put_shoes, some_cloth
from tools.objects.builder import ObjectBuilder

_BEECH, _VINYL = np.array([0.80, 0.65, 0.45]), np.array([[0.16, 0.28, 0.48], [0.50, 0.18, 0.16], [0.20, 0.36, 0.30]])
_BALLS = np.array([[0.72, 0.36, 0.16], [0.86, 0.86, 0.83], [0.20, 0.32, 0.52], [0.78, 0.66, 0.24], [0.56, 0.18, 0.20]])


def wall_bars(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw one or two fields of wall bars."""
    fields, tall = int(rng.integers(1, 3)), 2.45
    for k in range(fields + 1):
        y = (k - fields / 2) * 0.9
        f.block((-0.07, y - 0.02, 0.0), (0.07, y + 0.02, tall), _BEECH, "wood")
    for k in range(fields):
        middle = (k - (fields - 1) / 2) * 0.9
        for n, z in enumerate(np.linspace(0.25, tall - 0.1, 15)):
            x = 0.06 if n == 14 else 0.03
            f.bar((x, middle - 0.43, z), (x, middle + 0.43, z), 0.018, 0.95 * _BEECH, "wood", sides=7)


def vaulting_box(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a vaulting box: four wooden steps with a padded top."""
    for k in range(4):
        low, high, inset = 0.24 * k, 0.24 * (k + 1) - 0.006, 0.035 * k
        f.block(
            (-0.40 + inset, -0.75 + inset, low),
            (0.40 - inset, 0.75 - inset, high),
            _BEECH * (0.95 + 0.02 * (k % 2)),
            "wood",
        )
        for side in (-1, 1):
            x = side * (0.40 - inset)
            f.box((x, 0.0, low + 0.14), (0.006, 0.16, 0.045), DARK)
    f.cushion((0.0, 0.0, 1.03), (0.54, 1.28, 0.15), np.array([0.55, 0.40, 0.26]), "plain", radius=0.06)


def bench(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a long bench with a bag, a towel, bottles and shoes."""
    long = rng.uniform(2.0, 3.0)
    f.block((-0.14, -long / 2, 0.27), (0.14, long / 2, 0.30), _BEECH, "wood")
    f.block((-0.02, -long / 2 + 0.3, 0.10), (0.02, long / 2 - 0.3, 0.14), 0.95 * _BEECH, "wood")
    for side in (-1, 0, 1):
        y = side * (long / 2 - 0.25)
        f.block((-0.03, y - 0.03, 0.03), (0.03, y + 0.03, 0.27), 0.93 * _BEECH, "wood")
        f.block((-0.17, y - 0.04, 0.0), (0.17, y + 0.04, 0.04), 0.93 * _BEECH, "wood")
    tint, y = np.clip(some_cloth(rng) + 0.3, 0, 1), rng.uniform(-0.3, 0.3) * long
    f.cushion((0.02, y, 0.315), (0.30, 0.40, 0.03), tint, radius=0.014)
    f.cushion((0.165, y, 0.20), (0.03, 0.38, 0.20), tint, radius=0.014)
    put_bottle(f, rng, 0.0, y + 0.4, 0.30)
    put_holdall(f, rng, 0.38, rng.uniform(-0.35, 0.35) * long, rng.normal(0, 0.3))
    put_shoes(f, rng, 0.40, rng.choice([-1, 1]) * 0.45 * long, np.pi + rng.normal(0, 0.3))


def mats(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a stack of gymnastics mats, slightly out of line."""
    color = _VINYL[rng.integers(len(_VINYL))]
    for k in range(int(rng.integers(3, 8))):
        x, y = rng.normal(0, 0.015, 2)
        f.cushion((x, y, 0.04 + 0.082 * k), (1.0, 1.9, 0.08), color * rng.uniform(0.92, 1.05), "plain", radius=0.02)
    f.cushion((0.1, 1.25, 0.16), (0.6, 0.5, 0.32), 0.8 * color, "plain", radius=0.04, yaw=0.2)


def balls(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a trolley of balls, with one on the floor."""
    for z in (0.30, 0.62, 0.94):
        for x in (-0.2, 0.2):
            f.bar((x, -0.55, z), (x, 0.55, z), 0.012, STEEL, "metal", sides=6)
        for y in (-0.55, 0.55):
            f.bar((-0.2, y, z), (0.2, y, z), 0.012, STEEL, "metal", sides=6)
    for x in (-0.2, 0.2):
        for y in (-0.55, 0.55):
            f.bar((x, y, 0.06), (x, y, 1.1), 0.016, STEEL, "metal", sides=6)
            f.bar((x - 0.012, y, 0.05), (x + 0.012, y, 0.05), 0.05, DARK, sides=10)
    for z in (0.30, 0.62, 0.94):
        for y in np.arange(-0.42, 0.43, 0.27):
            _ball(f, rng, rng.normal(0, 0.02), y, z + 0.09)
    _ball(f, rng, 0.45, rng.uniform(-0.4, 0.4), 0.12)


def _ball(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, z: float) -> None:
    turn = np.linspace(-np.pi / 2, np.pi / 2, 9)
    f.turned(
        0.12 * np.column_stack([np.cos(turn), np.sin(turn)]).round(6), _BALLS[rng.integers(5)], at=(x, y, z), sides=14
    )


def dumbbells(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a rack with two rows of dumbbells and a kettlebell before it."""
    for y in (-0.7, 0.7):
        f.block((-0.25, y - 0.03, 0.0), (0.25, y + 0.03, 0.05), DARK)
        f.block((-0.10, y - 0.03, 0.05), (0.0, y + 0.03, 0.85), DARK)
    for z, x in ((0.35, 0.08), (0.75, -0.02)):
        f.block((x - 0.18, -0.7, z - 0.02), (x + 0.16, 0.7, z), 1.6 * DARK, "metal")
        for k, y in enumerate(np.arange(-0.58, 0.6, 0.19)):
            radius = 0.045 + 0.004 * k
            f.bar((x - 0.06, y, z + radius), (x + 0.06, y, z + radius), 0.015, STEEL, "metal", sides=6)
            for side in (-1, 1):
                f.bar((x + side * 0.06, y, z + radius), (x + side * 0.14, y, z + radius), radius, 1.2 * DARK, sides=10)
    bell = [(0, 0), (0.06, 0), (0.10, 0.07), (0.09, 0.14), (0.04, 0.19), (0, 0.2)]
    f.turned(bell, _VINYL[rng.integers(3)], at=(0.42, rng.uniform(-0.4, 0.4), 0.0))


def treadmill(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a treadmill with its console at the wall and a towel over its rail."""
    f.block((-0.80, -0.40, 0.06), (0.85, 0.40, 0.18), 1.5 * DARK)
    f.block((-0.70, -0.28, 0.18), (0.84, 0.28, 0.186), DARK, "fabric")
    f.cushion((-0.70, 0.0, 0.22), (0.36, 0.80, 0.12), 2.2 * DARK, "plain", radius=0.05)
    for y in (-0.36, 0.36):
        f.bar((-0.68, y, 0.15), (-0.55, y, 1.25), 0.03, STEEL, "metal")
        f.bar((-0.55, y, 1.05), (0.05, y, 0.98), 0.02, DARK)
        f.bar((0.80, y, 0.03), (0.80, 0.9 * y, 0.03), 0.03, DARK)
    f.cushion((-0.55, 0.0, 1.28), (0.10, 0.80, 0.30), 1.6 * DARK, "plain", radius=0.04, tilt=-0.5)
    f.cushion((-0.25, 0.36, 0.93), (0.30, 0.06, 0.34), np.clip(some_cloth(rng) + 0.35, 0, 1), radius=0.025)


def punching_bag(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a free-standing punching bag on a heavy foot."""
    f.turned([(0, 0), (0.32, 0), (0.34, 0.06), (0.26, 0.32), (0.10, 0.38), (0, 0.38)], 1.2 * DARK, sides=22)
    f.bar((0, 0, 0.36), (0, 0, 0.55), 0.06, STEEL, "metal", sides=12)
    profile = [(0, 0.52), (0.15, 0.52), (0.18, 0.58), (0.18, 1.68), (0.14, 1.74), (0, 1.75)]
    f.turned(profile, np.array([[0.42, 0.12, 0.11], [0.13, 0.13, 0.15]])[rng.integers(2)], sides=20)
    for z in (0.72, 1.55):
        f.turned([(0.1815, z), (0.183, z + 0.005), (0.183, z + 0.05), (0.1815, z + 0.055)], (0.8, 0.8, 0.78), sides=20)
