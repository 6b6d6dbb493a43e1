"""Things that people leave: bags, cups, papers, bottles, shoes, cables."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from tools.objects.builder import ObjectBuilder

# Muted colours of everyday things; saturated ones are rare.
CLOTH = np.array(
    [
        *([0.16, 0.18, 0.22], [0.24, 0.28, 0.36], [0.36, 0.38, 0.36], [0.46, 0.40, 0.33], [0.55, 0.24, 0.20]),
        *([0.62, 0.58, 0.50], [0.22, 0.34, 0.33], [0.30, 0.24, 0.22]),
    ]
)
DARK, STEEL, WHITE = np.array([0.13, 0.13, 0.14]), np.array([0.62, 0.64, 0.67]), np.array([0.90, 0.90, 0.88])


def some_cloth(rng: np.random.Generator) -> Floats:
    """Draw a colour of cloth."""
    return np.asarray(CLOTH[rng.integers(len(CLOTH))] * rng.uniform(0.85, 1.2))


def put_mug(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, z: float) -> None:
    """Put a mug on a surface."""
    color = np.clip(some_cloth(rng) + 0.35, 0, 1)
    profile = [(0.0, 0.0), (0.037, 0.0), (0.041, 0.095), (0.037, 0.095), (0.035, 0.02), (0.0, 0.02)]
    f.turned(profile, color, at=(x, y, z), sides=10)
    f.bar((x + 0.04, y, z + 0.03), (x + 0.065, y, z + 0.05), 0.006, color, sides=5)
    f.bar((x + 0.065, y, z + 0.05), (x + 0.04, y, z + 0.075), 0.006, color, sides=5)


def put_papers(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, z: float) -> None:
    """Put a few sheets of paper on a surface, each a little turned."""
    for k, turn in enumerate(rng.normal(0, 0.25, 3)):
        c, s, up = np.cos(turn), np.sin(turn), z + 0.002 * (k + 1)
        corners = np.array([[-0.15, 0.105], [-0.15, -0.105], [0.15, -0.105], [0.15, 0.105]]) @ [[c, s], [-s, c]]
        f.block((x - 0.02, y - 0.02, z), (x + 0.02, y + 0.02, up - 0.0005), WHITE)
        f.print(f"notice{k}", np.column_stack([corners + [x, y], np.full(4, up)])[[1, 2, 3, 0]])


def put_bottle(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, z: float, height: float = 0.25) -> None:
    """Put a bottle on a surface."""
    color = np.array([[0.30, 0.44, 0.36], [0.55, 0.62, 0.68], [0.25, 0.34, 0.46], [0.60, 0.60, 0.58]])[rng.integers(4)]
    profile = np.array([(0, 0), (1, 0), (1, 0.6), (0.4, 0.8), (0.4, 0.97), (0.45, 0.97), (0.45, 1), (0, 1)])
    f.turned(profile * [0.035, height], color, at=(x, y, z), sides=9)


def put_backpack(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, yaw: float) -> None:
    """Put a backpack on the floor, leaning a little."""
    color = some_cloth(rng)
    bag = ObjectBuilder()
    bag.cushion((0, 0, 0.23), (0.20, 0.31, 0.46), color, radius=0.09, tilt=-0.12)
    bag.cushion((0.11, 0, 0.15), (0.10, 0.24, 0.22), 0.85 * color, radius=0.045, tilt=-0.12)
    bag.bar((-0.05, -0.03, 0.45), (-0.07, -0.03, 0.50), 0.008, 0.6 * color, sides=5)
    bag.bar((-0.05, 0.03, 0.45), (-0.07, 0.03, 0.50), 0.008, 0.6 * color, sides=5)
    bag.bar((-0.07, -0.035, 0.50), (-0.07, 0.035, 0.50), 0.008, 0.6 * color, sides=5)
    f.group(bag, (x, y, 0.0), yaw)


def put_holdall(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, yaw: float) -> None:
    """Put a sports bag with two handles on the floor."""
    color = some_cloth(rng)
    bag = ObjectBuilder()
    bag.cushion((0, 0, 0.13), (0.26, 0.52, 0.26), color, radius=0.11)
    for side in (-0.07, 0.07):
        bag.bar((side, -0.12, 0.22), (side * 0.4, -0.06, 0.33), 0.012, 0.55 * color, "fabric", sides=5)
        bag.bar((side, 0.12, 0.22), (side * 0.4, 0.06, 0.33), 0.012, 0.55 * color, "fabric", sides=5)
        bag.bar((side * 0.4, -0.06, 0.33), (side * 0.4, 0.06, 0.33), 0.012, 0.55 * color, "fabric", sides=5)
    f.group(bag, (x, y, 0.0), yaw)


def put_shoes(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, yaw: float) -> None:
    """Put a pair of shoes on the floor, not quite parallel."""
    color = some_cloth(rng)
    for side, turn in zip((-0.065, 0.065), rng.normal(0, 0.2, 2), strict=True):
        shoe = ObjectBuilder()
        shoe.cushion((0, 0, 0.012), (0.29, 0.10, 0.022), WHITE, "plain", radius=0.01)
        shoe.cushion((0.05, 0, 0.04), (0.18, 0.09, 0.055), color, radius=0.027)
        shoe.cushion((-0.07, 0, 0.055), (0.13, 0.085, 0.085), 0.9 * color, radius=0.03)
        c, s = np.cos(yaw), np.sin(yaw)
        f.group(shoe, (x - s * side, y + c * side, 0.0), yaw + turn)


def put_cable(f: ObjectBuilder, rng: np.random.Generator, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Put a cable on the floor, in waves."""
    a, b = np.array(start), np.array(end)
    t = np.linspace(0, 1, 9)
    side = np.array([a[1] - b[1], b[0] - a[0]])
    swing = 0.12 * np.sin(t * rng.uniform(5, 9) + rng.uniform(0, 6)) * np.sin(np.pi * t)
    path = np.column_stack([a + t[:, None] * (b - a) + swing[:, None] * side, np.full(9, 0.006)])
    for one, two in pairwise(path):
        f.bar(one, two, 0.006, DARK, sides=5)


def put_books(
    f: ObjectBuilder, rng: np.random.Generator, low: tuple[float, float, float], size: tuple[float, float, float]
) -> None:
    """Put a row of books or folders: its lower left back corner, and its size; spines face +x."""
    (x, y, z), (deep, wide, tall) = low, size
    f.block((x, y, z), (x + deep, y + wide, z + tall), (0.80, 0.78, 0.72))
    f.front_print(f"spines{rng.integers(3)}", x + deep + 0.001, y + wide / 2, z + tall / 2, (wide, tall))


def put_stack(f: ObjectBuilder, rng: np.random.Generator, x: float, y: float, z: float, count: int = 3) -> None:
    """Put a stack of books on a surface."""
    for k in range(count):
        thick, color = rng.uniform(0.018, 0.04), np.clip(some_cloth(rng) + 0.1, 0, 1)
        f.box((x, y, z + thick / 2), (0.21 - 0.01 * k, 0.15 - 0.01 * k, thick), color, yaw=rng.normal(0, 0.15))
        z += thick


def put_carton(
    f: ObjectBuilder,
    rng: np.random.Generator,
    x: float,
    y: float,
    z: float,
    size: tuple[float, float, float],
    yaw: float,
) -> None:
    """Put a carton with a strip of tape on a surface."""
    color = np.array([0.70, 0.55, 0.38]) * rng.uniform(0.88, 1.1)
    dx, _, dz = size
    carton = ObjectBuilder()
    carton.box((0, 0, dz / 2), size, color, "fabric")
    carton.box((0, 0, dz / 2 + 0.001), (dx + 0.002, 0.05, dz), np.clip(color + 0.14, 0, 1))
    f.group(carton, (x, y, z), yaw)
