"""Furniture of a square outdoors."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tools.objects.belongings import DARK, STEEL, put_backpack, put_bottle, put_papers
from tools.objects.builder import ObjectBuilder
from tools.objects.foliage import crown, leaf_color, put_tree, sprays

_TIMBER, _STONE = np.array([0.52, 0.38, 0.26]), np.array([0.66, 0.65, 0.62])


def park_bench(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a park bench of timber slats on iron legs, with a bag and a bottle left on it."""
    long, wood = 1.7, _TIMBER * rng.uniform(0.85, 1.15)
    for y in (-0.65, 0.65):
        f.block((-0.22, y - 0.02, 0.0), (-0.17, y + 0.02, 0.44), 1.3 * DARK)
        f.block((0.16, y - 0.02, 0.0), (0.21, y + 0.02, 0.44), 1.3 * DARK)
        f.block((-0.22, y - 0.02, 0.40), (0.22, y + 0.02, 0.44), 1.3 * DARK)
        f.bar((-0.20, y, 0.42), (-0.34, y, 0.88), 0.022, 1.3 * DARK, sides=6)
        f.bar((-0.26, y, 0.62), (0.20, y, 0.64), 0.018, 1.3 * DARK, sides=6)
    for x in (-0.16, -0.05, 0.06, 0.17):
        f.block((x - 0.045, -long / 2, 0.44), (x + 0.045, long / 2, 0.47), wood, "wood")
    for k in range(3):
        z = 0.56 + 0.13 * k
        f.box((-0.215 - 0.04 * k, 0.0, z), (0.03, long, 0.09), wood, "wood")
    put_bottle(f, rng, 0.05, rng.uniform(-0.6, 0.6), 0.47)
    put_papers(f, rng, 0.0, rng.uniform(-0.4, 0.4), 0.47)
    put_backpack(f, rng, 0.36, rng.choice([-0.6, 0.6]), rng.normal(0, 0.5))


def planter(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a stone planter with a clipped shrub."""
    side, color = rng.uniform(0.6, 0.9), leaf_color(rng)
    f.block((-side / 2, -side / 2, 0.0), (side / 2, side / 2, 0.45), _STONE * rng.uniform(0.8, 1.05), "fabric")
    f.block((-side / 2 - 0.02, -side / 2 - 0.02, 0.45), (side / 2 + 0.02, side / 2 + 0.02, 0.50), 0.95 * _STONE)
    half = (0.52 * side, 0.52 * side, rng.uniform(0.35, 0.5))
    f.part(crown(rng, half, color), "leaves", center=(0, 0, 0.75))
    f.part(sprays(rng, half, color, 260, 0.04), "leaves", center=(0, 0, 0.75))


def hedge(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a clipped hedge."""
    long, tall, color = rng.uniform(1.6, 2.6), rng.uniform(0.8, 1.2), leaf_color(rng)
    half, center = (0.34, long / 2, tall / 2), (0, 0, tall / 2 - 0.02)
    f.part(crown(rng, half, color, box=5.0), "leaves", center=center)
    f.part(sprays(rng, half, color, 520, 0.035, box=5.0), "leaves", center=center)


def small_tree(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a young tree with a stake."""
    put_tree(f, rng, rng.uniform(2.9, 3.6), leaves=110, rows=8, sides=12)
    f.bar((0.16, 0.1, 0.0), (0.12, 0.08, 1.2), 0.025, _TIMBER, "wood", sides=6)


def far_tree(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a tree of 6 m with few details, as it stands far behind a scene."""
    put_tree(f, rng, 6.0, leaves=45, rows=6, sides=9)


def far_shrub(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a shrub with few details, as it stands far behind a scene."""
    half, color = (rng.uniform(0.5, 1.3), rng.uniform(0.5, 1.3), rng.uniform(0.4, 0.9)), leaf_color(rng)
    center = (0.0, 0.0, 0.75 * half[2])
    f.part(crown(rng, half, color, rows=6, sides=10), "leaves", center=center)
    f.part(sprays(rng, half, color, 60, 0.16), "leaves", center=center)


def litter_bin(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a litter bin on a post, and paper beside it."""
    color = np.array([[0.22, 0.34, 0.26], [0.35, 0.36, 0.38], [0.46, 0.30, 0.18]])[rng.integers(3)]
    f.turned([(0, 0.1), (0.19, 0.1), (0.21, 0.80), (0.19, 0.80), (0.17, 0.15), (0, 0.15)], color, "metal", sides=18)
    f.turned([(0, 0), (0.14, 0), (0.05, 0.1), (0, 0.1)], 0.6 * color)
    f.turned([(0.215, 0.70), (0.218, 0.71), (0.218, 0.78), (0.215, 0.79)], 0.7 * color, sides=18)
    put_papers(f, rng, 0.3, rng.uniform(-0.3, 0.3), 0.0)


def bicycle(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a bicycle that leans on a steel hoop."""
    color = np.array(
        [[0.50, 0.14, 0.12], [0.14, 0.22, 0.36], [0.12, 0.13, 0.14], [0.60, 0.60, 0.58], [0.20, 0.34, 0.28]]
    )[rng.integers(5)]
    bike = ObjectBuilder()
    for x in (-0.52, 0.52):
        turn = 2 * np.pi * np.arange(21) / 20
        rim = np.column_stack([x + 0.33 * np.cos(turn), np.zeros(21), 0.34 + 0.33 * np.sin(turn)])
        for a, b in pairwise(rim):
            bike.bar(a, b, 0.018, DARK, sides=5)
        for k in range(0, 20, 2):
            bike.bar((x, 0.0, 0.34), rim[k], 0.003, STEEL, sides=4)
    hub, fork, seat, head = (-0.05, 0.0, 0.30), (0.52, 0.0, 0.34), (-0.20, 0.0, 0.82), (0.36, 0.0, 0.80)
    for a, b in (
        (hub, seat),
        (hub, head),
        (seat, head),
        (hub, (-0.52, 0, 0.34)),
        (seat, (-0.52, 0, 0.34)),
        (head, fork),
    ):
        bike.bar(a, b, 0.018, color, sides=7)
    bike.bar(seat, (-0.24, 0.0, 0.95), 0.014, STEEL, "metal", sides=6)
    bike.cushion((-0.24, 0.0, 0.97), (0.26, 0.14, 0.06), DARK, "plain", radius=0.028)
    bike.bar(head, (0.32, 0.0, 1.0), 0.014, STEEL, "metal", sides=6)
    bike.bar((0.32, -0.28, 1.02), (0.32, 0.28, 1.02), 0.013, STEEL, "metal", sides=6)
    bike.bar((-0.05, -0.1, 0.20), (-0.05, 0.1, 0.40), 0.012, STEEL, "metal", sides=5)
    f.group(bike, (0.10, 0.0, 0.0), np.pi / 2)
    for a, b in (
        ((-0.06, -0.4, 0.0), (-0.06, -0.4, 0.85)),
        ((-0.06, -0.4, 0.85), (-0.06, 0.4, 0.85)),
        ((-0.06, 0.4, 0.85), (-0.06, 0.4, 0.0)),
    ):
        f.bar(a, b, 0.024, STEEL, "metal")


def lamp_post(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a street lamp on a slender post."""
    color = np.array([0.22, 0.24, 0.25])
    profile = [(0, 0), (0.09, 0), (0.09, 0.25), (0.05, 0.32), (0.04, 2.6), (0, 2.6)]
    f.turned(profile, color, sides=14)
    f.turned([(0, 2.6), (0.07, 2.62), (0.11, 2.85), (0, 2.86)], (0.93, 0.91, 0.84), sides=14)
    f.turned([(0, 2.86), (0.15, 2.86), (0.04, 2.97), (0, 2.98)], color, sides=14)
