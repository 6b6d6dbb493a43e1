"""Pillars, partitions and carts."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.world.scene.objects.assembly import Assembly
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import ObjectModel
from simharness.world.scene.objects.storage import BOX_COLORS, taped

_STONE = np.array([[0.80, 0.79, 0.76], [0.70, 0.69, 0.67], [0.86, 0.84, 0.79], [0.62, 0.63, 0.66]])
_FABRIC = np.array([[0.36, 0.52, 0.55], [0.55, 0.57, 0.60], [0.72, 0.55, 0.32], [0.44, 0.40, 0.52], [0.48, 0.56, 0.42]])
_FRAME = np.array([0.82, 0.83, 0.84])
_STEEL = np.array([0.66, 0.68, 0.71])
_RUBBER = np.array([0.16, 0.16, 0.17])
_WHEEL = 0.06  # metres: radius


def draw_pillar(rng: np.random.Generator, height: float) -> ObjectModel:
    """Draw a round or square pillar from the floor to ``height`` metres, with a base and a capital."""
    is_round, width = rng.uniform() < 0.5, rng.uniform(0.30, 0.45)
    stone = _STONE[rng.integers(len(_STONE))]
    base = min(0.12, height / 4)
    ends = [(0.0, base, 1.22), (base, height - base, 1.0), (height - base, height, 1.18)]
    assembly = Assembly()
    for low, high, wider in ends:
        color = stone if wider == 1.0 else 0.88 * stone
        if is_round:
            assembly.bar((0, 0, low), (0, 0, high), wider * width / 2, color, sides=28)
        else:
            assembly.box((0, 0, (low + high) / 2), (wider * width, wider * width, high - low), color)
    return assembly.model()


def draw_partition(rng: np.random.Generator) -> ObjectModel:
    """Draw a free-standing partition 1.5 to 1.9 m tall: one panel, or two or three in a zigzag."""
    panels = int(rng.integers(1, 4))
    width, height = rng.uniform(0.75, 1.0), rng.uniform(1.5, 1.9)
    fold, sense = rng.uniform(0.35, 0.7), rng.choice([-1.0, 1.0])
    fabric = _FABRIC[rng.integers(len(_FABRIC))]
    if panels == 1:
        width, fold = 1.5 * width, 0.0
    yaws = [sense * fold * (-1.0) ** k for k in range(panels)]
    along = [np.array([-np.sin(yaw), np.cos(yaw)]) for yaw in yaws]
    ends = np.cumsum([np.zeros(2), *(width * way for way in along)], axis=0)
    ends -= (ends.min(axis=0) + ends.max(axis=0)) / 2
    assembly = Assembly()
    for yaw, start, end in zip(yaws, ends, ends[1:], strict=False):
        _panel(assembly, (start + end) / 2, yaw, (width, height), fabric)
    return assembly.model()


def _panel(assembly: Assembly, middle: Floats, yaw: float, size: tuple[float, float], fabric: Floats) -> None:
    """Add one panel perpendicular to its x axis: cloth in a frame on two feet."""
    (width, height), post, under = size, 0.03, 0.09
    parts = [
        (Box((0.0, 0.0, (height + under) / 2), (0.014, width / 2 - post, (height - under) / 2 - post)), fabric),
        (Box((0.0, 0.0, height - post / 2), (0.018, width / 2 - post, post / 2)), _FRAME),
        (Box((0.0, 0.0, under + post / 2), (0.018, width / 2 - post, post / 2)), _FRAME),
    ]
    for side in (-1.0, 1.0):
        y = side * (width - post) / 2
        parts.append((Box((0.0, y, (height + 0.03) / 2), (0.018, post / 2, (height - 0.03) / 2)), _FRAME))
        parts.append((Box((0.0, y, 0.015), (0.17, post / 2, 0.015)), 0.7 * _FRAME))
    for box, color in parts:
        assembly.boxes([box.moved(middle, yaw)], [color])


def draw_cart(rng: np.random.Generator) -> ObjectModel:
    """Draw a service cart that moves along its x axis: two trays between four posts on wheels, with cartons."""
    length, width, height = rng.uniform(0.75, 0.95), rng.uniform(0.45, 0.55), rng.uniform(0.82, 0.95)
    sizes, places = rng.uniform([0.22, 0.2, 0.15], [0.34, 0.32, 0.3], (3, 3)), rng.uniform(-1, 1, (3, 2))
    colors, turns = BOX_COLORS[rng.integers(len(BOX_COLORS), size=3)], rng.uniform(-0.25, 0.25, 3)
    assembly, x, y = Assembly(), length / 2 - 0.02, width / 2 - 0.02
    trays = (0.17, height - 0.12)
    for z in trays:
        assembly.box((0, 0, z), (length, width, 0.02), _STEEL)
        for side in (-1.0, 1.0):
            assembly.box((side * (length / 2 - 0.008), 0, z + 0.035), (0.016, width, 0.05), 0.92 * _STEEL)
            assembly.box((0, side * (width / 2 - 0.008), z + 0.035), (length - 0.032, 0.016, 0.05), 0.92 * _STEEL)
    for side in (-1.0, 1.0):
        for end in (-1.0, 1.0):
            assembly.bar((end * x, side * y, 2 * _WHEEL), (end * x, side * y, height), 0.014, 0.8 * _STEEL)
            wheel = (end * x, side * y - 0.018, _WHEEL), (end * x, side * y + 0.018, _WHEEL)
            assembly.bar(*wheel, _WHEEL, _RUBBER, sides=16)
    for end in (-1.0, 1.0):
        assembly.bar((end * x, -y, height), (end * x, y, height), 0.016, 0.35 * _STEEL)
    for k, (size, place) in enumerate(zip(sizes, places, strict=True)):
        z = trays[0 if k == 0 else 1] + 0.01
        slot = (0.0 if k == 0 else (-1.0) ** k * length / 4) + 0.05 * place[0]
        boxes, painted = taped(size, colors[k], base=z, yaw=turns[k])
        assembly.boxes([box.moved((slot, 0.04 * place[1]), 0.0) for box in boxes], painted)
    return assembly.model()
