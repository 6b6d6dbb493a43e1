"""Furniture of a hospital ward."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tools.objects.belongings import (
    DARK,
    STEEL,
    WHITE,
    put_bottle,
    put_holdall,
    put_mug,
    put_shoes,
    put_stack,
    some_cloth,
)
from tools.objects.builder import ObjectBuilder

_LIGHT = np.array([0.86, 0.88, 0.88])
_WOOD = np.array([0.78, 0.64, 0.46])
_BLANKETS = np.array([[0.62, 0.74, 0.80], [0.70, 0.78, 0.68], [0.82, 0.76, 0.62], [0.86, 0.87, 0.87]])


def bed(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a bed with its head at the wall: frame on castors, rails, mattress, pillow, blanket, and slippers."""
    color, back = _BLANKETS[rng.integers(len(_BLANKETS))], rng.uniform(0.15, 0.6)
    f.block((-1.0, -0.42, 0.34), (1.02, 0.42, 0.42), STEEL, "metal")
    f.block((-0.7, -0.25, 0.20), (0.7, 0.25, 0.34), 0.8 * STEEL)
    for x in (-0.85, 0.85):
        for y in (-0.36, 0.36):
            f.bar((x, y, 0.12), (x, y, 0.36), 0.025, STEEL, "metal")
            f.bar((x, y - 0.02, 0.07), (x, y + 0.02, 0.07), 0.07, DARK, sides=12)
    for x, tall in ((-1.04, 1.0), (1.05, 0.85)):
        f.cushion((x, 0.0, tall / 2 + 0.2), (0.05, 0.92, tall - 0.4), _WOOD, "wood", radius=0.02)
    f.cushion((0.24, 0.0, 0.49), (1.50, 0.86, 0.15), WHITE, radius=0.05)
    c, s = np.cos(back), np.sin(back)
    f.cushion((-0.5 - 0.24 * c, 0.0, 0.50 + 0.27 * s), (0.60, 0.86, 0.15), WHITE, radius=0.05, tilt=back)
    f.cushion((-0.58 - 0.26 * c, 0.0, 0.62 + 0.33 * s), (0.40, 0.64, 0.14), 1.02 * WHITE, radius=0.065, tilt=back)
    f.cushion((0.42, 0.0, 0.575), (1.10, 0.92, 0.06), color, radius=0.03)
    f.cushion((-0.14, 0.0, 0.60), (0.22, 0.92, 0.05), WHITE, radius=0.024)
    for y in (-0.46, 0.46):
        f.cushion((0.42, y, 0.47), (1.06, 0.025, 0.24), color, radius=0.012)
        for z in (0.64, 0.80):
            f.bar((-0.75, y * 1.04, z), (0.05, y * 1.04, z), 0.014, STEEL, "metal", sides=6)
        for x in (-0.75, -0.35, 0.05):
            f.bar((x, y * 1.04, 0.40), (x, y * 1.04, 0.80), 0.012, STEEL, "metal", sides=6)
    f.box((1.085, 0.1, 0.78), (0.012, 0.24, 0.32), (0.55, 0.60, 0.64))
    f.front_print(f"notice{rng.integers(3)}", 1.0915, 0.1, 0.77, (0.21, 0.28))
    put_shoes(f, rng, rng.uniform(-0.2, 0.5), 0.66 * rng.choice([-1, 1]), rng.normal(0, 0.4))


def bedside(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a bedside cabinet on castors with a bottle, a cup and books, and a drip stand beside it."""
    f.block((-0.22, -0.23, 0.10), (0.22, 0.23, 0.82), _LIGHT)
    for low, high in ((0.12, 0.54), (0.57, 0.79)):
        f.block((0.22, -0.22, low), (0.235, 0.22, high), _WOOD, "wood")
        f.block((0.235, -0.06, high - 0.06), (0.25, 0.06, high - 0.045), STEEL, "metal")
    f.block((-0.24, -0.25, 0.82), (0.25, 0.25, 0.845), _WOOD, "wood")
    for x in (-0.18, 0.18):
        for y in (-0.19, 0.19):
            f.bar((x, y - 0.015, 0.04), (x, y + 0.015, 0.04), 0.04, DARK, sides=8)
            f.bar((x, y, 0.06), (x, y, 0.10), 0.012, STEEL, sides=6)
    put_bottle(f, rng, -0.1, 0.1, 0.845, 0.28)
    put_mug(f, rng, 0.1, 0.05, 0.845)
    put_stack(f, rng, 0.05, -0.12, 0.845, count=2)
    drip_stand(f, rng, 0.1, 0.55 * rng.choice([-1, 1]))


def drip_stand(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float) -> None:
    """Put a drip stand with a bag, a pump and a tube."""
    stand = ObjectBuilder()
    for k in range(5):
        c, s = np.cos(2 * np.pi * k / 5), np.sin(2 * np.pi * k / 5)
        stand.bar((0, 0, 0.12), (0.28 * c, 0.28 * s, 0.07), 0.014, STEEL, "metal", sides=6)
        stand.bar(
            (0.28 * c - 0.012 * s, 0.28 * s + 0.012 * c, 0.035),
            (0.28 * c + 0.012 * s, 0.28 * s - 0.012 * c, 0.035),
            0.035,
            DARK,
            sides=8,
        )
    stand.bar((0, 0, 0.1), (0, 0, 1.9), 0.013, STEEL, "metal", sides=8)
    stand.bar((0, -0.14, 1.9), (0, 0.14, 1.9), 0.008, STEEL, "metal", sides=6)
    stand.cushion((0.0, 0.13, 1.72), (0.035, 0.12, 0.24), (0.86, 0.89, 0.90), "plain", radius=0.016)
    stand.bar((0.0, 0.13, 1.60), (0.03, 0.04, 1.25), 0.004, (0.85, 0.88, 0.9), sides=5)
    stand.cushion((0.05, 0.0, 1.20), (0.10, 0.13, 0.20), (0.80, 0.82, 0.80), "plain", radius=0.02)
    f.group(stand, (x, y, 0.0), rng.uniform(0, 6))


def monitor(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a patient monitor on a trolley with drawers and a basket."""
    f.block((-0.22, -0.24, 0.12), (0.22, 0.24, 0.80), _LIGHT)
    tint = np.array([[0.36, 0.55, 0.62], [0.66, 0.30, 0.26], [0.42, 0.56, 0.42]])[rng.integers(3)]
    for k in range(4):
        f.block((0.22, -0.225, 0.14 + 0.165 * k), (0.235, 0.225, 0.29 + 0.165 * k), tint)
        f.block((0.235, -0.08, 0.255 + 0.165 * k), (0.25, 0.08, 0.27 + 0.165 * k), STEEL, "metal")
    f.block((-0.24, -0.26, 0.80), (0.24, 0.26, 0.825), WHITE)
    for x in (-0.17, 0.17):
        for y in (-0.19, 0.19):
            f.bar((x, y - 0.02, 0.06), (x, y + 0.02, 0.06), 0.06, DARK, sides=10)
    f.bar((-0.12, 0, 0.82), (-0.12, 0, 1.22), 0.022, STEEL, "metal")
    f.cushion((-0.08, 0.0, 1.28), (0.14, 0.36, 0.30), 0.9 * _LIGHT, "plain", radius=0.02)
    f.box((-0.0085, 0.0, 1.29), (0.003, 0.31, 0.23), (0.03, 0.05, 0.06))
    ys = np.linspace(-0.145, 0.145, 30)
    for z, color in ((1.35, (0.2, 0.9, 0.4)), (1.29, (0.9, 0.85, 0.3)), (1.23, (0.3, 0.8, 0.95))):
        wave = z + 0.02 * np.exp(-(((ys + 0.15) % 0.1 - 0.05) ** 2) / 0.0001)
        for k in range(len(ys) - 1):
            f.box(
                (-0.006, ys[k], (wave[k] + wave[k + 1]) / 2), (0.002, 0.011, 0.003 + abs(wave[k + 1] - wave[k])), color
            )
    put_stack(f, rng, 0.12, 0.1, 0.825, count=1)


def screen_on_wheels(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a folding screen of three cloth panels on wheels, folded open along the wall."""
    color = _BLANKETS[rng.integers(len(_BLANKETS))]
    folds = np.array([[0.0, -0.9], [0.10, -0.3], [-0.05, 0.3], [0.06, 0.9]])
    for a, b in pairwise(folds):
        for z in (0.15, 1.70):
            f.bar((*a, z), (*b, z), 0.013, STEEL, "metal", sides=6)
        n = 10
        points = a + np.linspace(0, 1, n)[:, None] * (b - a)
        for k in range(n - 1):
            middle = (points[k] + points[k + 1]) / 2 + [0.012 * (-1) ** k, 0]
            way = points[k + 1] - points[k]
            f.box(
                (*middle, 0.92),
                (0.008, float(np.linalg.norm(way)) * 1.02, 1.48),
                color * (0.94 + 0.05 * (k % 2)),
                "fabric",
                yaw=np.arctan2(-way[0], way[1]),
            )
    for point in folds:
        f.bar((*point, 0.05), (*point, 1.72), 0.013, STEEL, "metal", sides=6)
        f.bar((point[0], point[1] - 0.015, 0.035), (point[0], point[1] + 0.015, 0.035), 0.035, DARK, sides=8)
        f.bar((point[0] - 0.14, point[1], 0.07), (point[0] + 0.14, point[1], 0.07), 0.012, STEEL, "metal", sides=6)


def visitors(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw two chairs for visitors with a bag beside them."""
    color = some_cloth(rng)
    for y in (-0.32, 0.32):
        f.cushion((0.0, y, 0.45), (0.48, 0.50, 0.07), color, radius=0.03)
        f.cushion((-0.24, y, 0.74), (0.06, 0.48, 0.40), color, radius=0.028, tilt=-0.15)
        for side in (-0.24, 0.24):
            f.bar((0.20, y + side, 0.0), (0.20, y + side, 0.64), 0.014, STEEL, "metal", sides=6)
            f.bar((-0.26, y + side, 0.0), (-0.22, y + side, 0.64), 0.014, STEEL, "metal", sides=6)
            f.bar((0.22, y + side, 0.64), (-0.24, y + side, 0.64), 0.018, _WOOD, "wood", sides=6)
            f.bar((-0.22, y + side, 0.60), (-0.27, y + side, 0.92), 0.014, STEEL, "metal", sides=6)
            f.bar((0.2, y + side, 0.42), (-0.22, y + side, 0.42), 0.012, STEEL, "metal", sides=6)
    put_holdall(f, rng, 0.05, 0.95 * rng.choice([-1, 1]), rng.normal(0, 0.4))


def wardrobe(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw lockers of wood with numbers, and a pile of linen on top."""
    f.block((-0.27, -0.45, 0.06), (0.25, 0.45, 1.85), _LIGHT)
    f.block((-0.25, -0.43, 0.0), (0.22, 0.43, 0.06), DARK)
    for y0, y1 in ((-0.445, -0.004), (0.004, 0.445)):
        f.block((0.25, y0, 0.07), (0.268, y1, 1.84), _WOOD, "wood")
        f.block((0.268, y1 - 0.07, 0.95), (0.285, y1 - 0.05, 1.10), STEEL, "metal")
        f.block((0.268, (y0 + y1) / 2 - 0.04, 1.60), (0.270, (y0 + y1) / 2 + 0.04, 1.66), WHITE)
    for k in range(3):
        f.cushion((0.0, 0.1, 1.88 + 0.06 * k), (0.36, 0.46, 0.06), WHITE * rng.uniform(0.94, 1.0), radius=0.025)
