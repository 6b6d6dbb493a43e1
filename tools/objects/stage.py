"""Equipment of a stage."""

from __future__ import annotations

import numpy as np

from simharness.world.scene.objects.shapes import loft
from tools.objects.belongings import DARK, STEEL, WHITE, put_bottle, put_cable, put_holdall, put_papers, some_cloth
from tools.objects.builder import ObjectBuilder

_WOODS = np.array([[0.16, 0.11, 0.08], [0.34, 0.20, 0.12], [0.08, 0.08, 0.09]])


def loudspeaker(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a tower of loudspeakers, with cables."""
    f.block((-0.28, -0.28, 0.0), (0.28, 0.28, 0.58), 1.1 * DARK, "fabric")
    _cone(f, 0.281, 0.0, 0.29, 0.22)
    f.block((-0.24, -0.21, 0.585), (0.22, 0.21, 1.30), 1.2 * DARK, "fabric")
    _cone(f, 0.221, 0.0, 0.84, 0.16)
    f.block((0.22, -0.12, 1.08), (0.224, 0.12, 1.22), 0.5 * DARK)
    put_cable(f, rng, (-0.25, 0.3), (0.35, 0.8))


def _cone(f: ObjectBuilder, x: float, y: float, z: float, radius: float) -> None:
    f.bar((x, y, z), (x + 0.006, y, z), radius, 2.4 * DARK, sides=24)
    f.bar((x + 0.006, y, z), (x + 0.008, y, z), 0.85 * radius, 1.2 * DARK, sides=24)
    f.bar((x + 0.008, y, z), (x + 0.014, y, z), 0.3 * radius, 2.0 * DARK, sides=16)


def amplifier(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a guitar amplifier with a guitar in its stand, and the cable between them."""
    cloth = np.array([[0.42, 0.38, 0.30], [0.20, 0.20, 0.21], [0.34, 0.30, 0.24]])[rng.integers(3)]
    f.cushion((0.0, 0.0, 0.29), (0.30, 0.66, 0.56), 1.2 * DARK, "fabric", radius=0.02)
    f.block((0.15, -0.29, 0.05), (0.156, 0.29, 0.42), cloth, "fabric")
    f.block((0.15, -0.29, 0.44), (0.158, 0.29, 0.54), 0.7 * STEEL, "metal")
    for k in range(7):
        f.bar((0.158, -0.24 + 0.08 * k, 0.49), (0.172, -0.24 + 0.08 * k, 0.49), 0.014, WHITE, sides=8)
    _guitar(f, rng, 0.1, 0.75)
    put_cable(f, rng, (0.17, 0.2), (0.2, 0.7))
    put_bottle(f, rng, 0.0, -0.2, 0.57)


def _guitar(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float) -> None:
    """Put a guitar in a stand, leaning back."""
    guitar = ObjectBuilder()
    colors = [[0.62, 0.36, 0.14], [0.45, 0.10, 0.09], [0.14, 0.20, 0.30], [0.10, 0.10, 0.10]]
    color = np.array(colors)[rng.integers(4)]
    for side in (-1, 1):
        guitar.bar((0.10, side * 0.12, 0.0), (-0.12, 0.03 * side, 0.55), 0.012, DARK, sides=6)
    guitar.bar((-0.25, 0.0, 0.0), (-0.12, 0.0, 0.55), 0.012, DARK, sides=6)
    turn = 2 * np.pi * np.arange(24) / 24
    waist = 0.155 + 0.03 * np.cos(2 * turn) + 0.018 * np.sin(turn) * -1
    outline = np.column_stack([waist * np.cos(turn), 0.36 + 1.35 * waist * np.sin(turn)])
    x_at = 0.04 - 0.22 * (outline[:, 1] - 0.2)
    front = np.column_stack([x_at + 0.03, outline])
    back = np.column_stack([x_at - 0.03, outline])
    tips = [np.tile(part.mean(axis=0), (24, 1)) for part in (back, front)]
    shades = np.array([0.7 * color, 0.8 * color, color])
    guitar.part(loft(np.stack([tips[0], back, front, tips[1]]), shades, edges=(1, 2)))
    guitar.bar((0.035, 0.0, 0.42), (-0.10, 0.0, 1.02), 0.018, (0.30, 0.20, 0.13), "wood", sides=6)
    guitar.box((-0.115, 0.0, 1.08), (0.03, 0.07, 0.16), 0.5 * color)
    f.group(guitar, (x, y, 0.0), rng.normal(0, 0.3))


def piano(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw an upright piano with sheet music and a stool."""
    wood = _WOODS[rng.integers(len(_WOODS))]
    f.block((-0.32, -0.74, 0.0), (0.0, 0.74, 1.18), wood, "wood")
    f.block((-0.34, -0.76, 1.18), (0.03, 0.76, 1.21), wood, "wood")
    f.block((0.0, -0.74, 0.60), (0.30, 0.74, 0.70), wood, "wood")
    for y in (-0.70, 0.70):
        f.block((0.0, y - 0.04, 0.70), (0.28, y + 0.04, 0.84), wood, "wood")
        f.block((0.20, y - 0.04, 0.0), (0.28, y + 0.04, 0.60), wood, "wood")
    f.block((0.10, -0.62, 0.70), (0.26, 0.62, 0.722), WHITE)
    for k in range(52):
        if k % 7 not in (2, 6):
            y = -0.62 + (k + 1) * 1.24 / 52
            f.block((0.10, y - 0.006, 0.722), (0.19, y + 0.006, 0.734), DARK)
    f.print("notice0", [(0.06, -0.22, 0.86), (0.06, 0.0, 0.86), (0.01, 0.0, 1.14), (0.01, -0.22, 1.14)])
    f.print("notice1", [(0.06, 0.0, 0.86), (0.06, 0.22, 0.86), (0.01, 0.22, 1.14), (0.01, 0.0, 1.14)])
    f.cushion((0.72, 0.1, 0.49), (0.36, 0.56, 0.08), some_cloth(rng), radius=0.03)
    for x in (0.60, 0.84):
        for y in (-0.12, 0.32):
            f.block((x - 0.02, y - 0.02, 0.0), (x + 0.02, y + 0.02, 0.46), wood, "wood")


def drums(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a drum kit on a carpet: bass drum, toms, snare, cymbals, stool."""
    color = np.array([[0.50, 0.08, 0.09], [0.12, 0.18, 0.34], [0.16, 0.16, 0.17], [0.62, 0.44, 0.24]])[rng.integers(4)]
    rug = np.array([0.34, 0.16, 0.15]) * rng.uniform(0.8, 1.1)
    f.box((-0.05, 0.0, 0.006), (1.75, 2.0, 0.012), rug, "fabric")
    f.bar((0.05, 0.0, 0.30), (0.50, 0.0, 0.30), 0.28, color, sides=28)
    f.bar((0.50, 0.0, 0.30), (0.515, 0.0, 0.30), 0.285, WHITE, sides=28)
    for x, y, z, radius, deep in (
        (0.18, -0.2, 0.72, 0.15, 0.2),
        (0.18, 0.2, 0.72, 0.165, 0.22),
        (-0.35, 0.6, 0.35, 0.2, 0.38),
        (-0.35, -0.45, 0.55, 0.18, 0.14),
    ):
        f.bar((x, y, z), (x, y, z + deep), radius, color, sides=20)
        f.bar((x, y, z + deep), (x, y, z + deep + 0.01), 1.02 * radius, WHITE, sides=20)
        f.bar((x, y, 0.01), (x, y, z), 0.014, STEEL, "metal", sides=6)
        for k in range(3):
            c, s = np.cos(2.1 * k + 0.5), np.sin(2.1 * k + 0.5)
            f.bar((x, y, 0.25), (x + 0.2 * c, y + 0.2 * s, 0.02), 0.01, STEEL, "metal", sides=5)
    brass = np.array([0.72, 0.56, 0.24])
    for x, y, z, radius in ((0.15, -0.75, 1.15, 0.24), (0.05, 0.8, 1.2, 0.26), (-0.3, -0.8, 0.92, 0.18)):
        f.turned(
            [(0, -0.005), (radius, -0.025), (radius, -0.02), (0.05, 0.005), (0.03, 0.02), (0, 0.022)],
            brass,
            "metal",
            at=(x, y, z),
            sides=22,
        )
        f.bar((x, y, 0.2), (x, y, z + 0.05), 0.011, STEEL, "metal", sides=6)
        for k in range(3):
            c, s = np.cos(2.1 * k), np.sin(2.1 * k)
            f.bar((x, y, 0.35), (x + 0.26 * c, y + 0.26 * s, 0.02), 0.01, STEEL, "metal", sides=5)
    f.turned([(0, 0.46), (0.17, 0.46), (0.18, 0.52), (0.15, 0.55), (0, 0.56)], DARK, "fabric", at=(-0.68, 0, 0))
    f.bar((-0.68, 0, 0.02), (-0.68, 0, 0.46), 0.02, STEEL, "metal")
    for k in range(3):
        c, s = np.cos(2.1 * k), np.sin(2.1 * k)
        f.bar((-0.68, 0, 0.25), (-0.68 + 0.24 * c, 0.24 * s, 0.02), 0.012, STEEL, "metal", sides=5)


def microphone(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a microphone on a boom stand, with a monitor before it and its cable."""
    f.turned([(0, 0), (0.13, 0), (0.13, 0.02), (0.02, 0.03), (0, 0.03)], DARK, at=(-0.2, 0, 0), sides=18)
    f.bar((-0.2, 0, 0.02), (-0.2, 0, 1.15), 0.011, DARK)
    f.bar((-0.45, 0, 1.02), (0.2, 0, 1.42), 0.009, DARK)
    f.bar((0.18, 0, 1.41), (0.30, 0, 1.45), 0.018, 2 * DARK)
    f.turned(
        [(0, 0), (0.02, 0.0), (0.028, 0.03), (0.018, 0.055), (0, 0.06)], STEEL, "metal", at=(0.31, 0, 1.43), sides=10
    )
    f.cushion((-0.15, 0.75, 0.19), (0.42, 0.60, 0.36), 1.2 * DARK, "fabric", radius=0.06, tilt=-0.5)
    put_cable(f, rng, (-0.2, 0.1), (0.1, 0.6))
    put_papers(f, rng, 0.1, -0.35, 0.0)


def cases(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw flight cases with aluminium edges, stacked, with a bag beside them."""
    z = 0.0
    for k, (deep, wide, tall) in enumerate(rng.uniform([0.5, 0.8, 0.4], [0.6, 1.1, 0.6], (2, 3))):
        shrink = 1.0 - 0.2 * k
        dx, dy, low = deep * shrink / 2, wide * shrink / 2, z + (0.10 if k == 0 else 0.0)
        f.block((-dx, -dy, low), (dx, dy, low + tall), np.array([0.13, 0.14, 0.17]), "fabric")
        for y in (-dy, dy):
            for x in (-dx, dx):
                f.box((x, y, low + tall / 2), (0.03, 0.03, tall + 0.01), STEEL, "metal")
            for up in (low, low + 0.65 * tall, low + tall):
                f.box((0.0, y, up), (2 * dx, 0.028, 0.03), STEEL, "metal")
        for x in (-dx, dx):
            for up in (low, low + 0.65 * tall, low + tall):
                f.box((x, 0.0, up), (0.028, 2 * dy, 0.03), STEEL, "metal")
        for y in (-0.4 * dy, 0.4 * dy):
            f.box((dx + 0.006, y, low + 0.62 * tall), (0.012, 0.10, 0.10), 1.1 * STEEL, "metal")
        if k == 0:
            for x in (-dx + 0.08, dx - 0.08):
                for y in (-dy + 0.1, dy - 0.1):
                    f.bar((x, y - 0.02, 0.05), (x, y + 0.02, 0.05), 0.05, DARK, sides=10)
        z = low + tall
    put_holdall(f, rng, 0.1, 0.85, rng.normal(0, 0.4))


def floodlight(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a tripod with a bar of spotlights, which point into the room."""
    for k in range(3):
        c, s = np.cos(2.1 * k), np.sin(2.1 * k)
        f.bar((0.45 * c, 0.45 * s, 0.02), (0, 0, 0.9), 0.016, DARK, sides=6)
    f.bar((0, 0, 0.6), (0, 0, 2.1), 0.02, DARK)
    f.bar((0, -0.55, 2.1), (0, 0.55, 2.1), 0.02, DARK)
    for y in (-0.42, 0.0, 0.42):
        f.bar((-0.12, y, 2.03), (0.14, y, 1.93), 0.09, 1.5 * DARK, sides=14)
        f.bar((0.14, y, 1.93), (0.145, y, 1.928), 0.08, (0.95, 0.93, 0.85), sides=14)
    put_cable(f, rng, (0.05, 0.0), (-0.3, 0.6))
