"""Procedural seamless textures of floors and walls of any room; those of kinds of rooms follow them by name.

A texture shows a patch of given size in metres; its rows run downwards, on a wall from the top to the floor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from simharness.world.scene.rooms import kind_textures
from simharness.world.scene.rooms.finish import (
    FLOOR_RESOLUTION,
    SKIRTING,
    WALL_RESOLUTION,
    Finish,
    checks,
    finish,
    skirted,
    to_edge,
    wall_shape,
)
from simharness.world.scene.rooms.noise import smooth_noise


def tiles(rng: np.random.Generator) -> Finish:
    """Draw light and dark tiles of half a metre with slight variation."""
    count, side = 8, FLOOR_RESOLUTION // 2
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    base = np.where(((i + j) % 2 == 1)[..., None], (0.735, 0.725, 0.70), (0.86, 0.84, 0.80))
    tone = base * (1 + rng.uniform(-0.025, 0.025, (count, count, 1)))
    picture = np.repeat(np.repeat(tone, side, axis=0), side, axis=1)
    picture *= 1 + 0.015 * smooth_noise(rng, picture.shape[:2], 24)[..., None]
    inside = np.minimum(*np.meshgrid(to_edge(count * side, side), to_edge(count * side, side)))
    picture *= np.where(inside < 1.5, 0.86, 1.0)[..., None]  # grout
    return finish(picture, FLOOR_RESOLUTION)


def wood(rng: np.random.Generator) -> Finish:
    """Draw oak boards, 14 cm wide, with staggered ends."""
    boards, width, length = 16, 27, 3 * FLOOR_RESOLUTION
    shape = (boards * width, length)
    picture = np.empty((*shape, 3))
    grain = smooth_noise(rng, (shape[0], shape[1]), 64, across=3) + 0.6 * smooth_noise(
        rng, (shape[0], shape[1]), 32, across=1
    )
    for board in range(boards):
        rows = slice(board * width, (board + 1) * width)
        ends = np.sort(rng.uniform(0, length, 2))
        which = np.searchsorted(ends, np.arange(length)) % 2
        tones = np.array([0.71, 0.53, 0.36]) * rng.uniform(0.84, 1.10, (2, 1)) + rng.uniform(-0.015, 0.015, (2, 3))
        picture[rows] = tones[which]
        picture[rows, ends.astype(int)] *= 0.72
        picture[board * width] *= 0.76
    picture *= 1 + 0.07 * grain[..., None]
    return finish(picture, FLOOR_RESOLUTION)


def carpet(rng: np.random.Generator) -> Finish:
    """Draw squares of loop carpet with alternating direction of the pile."""
    side = 2 * FLOOR_RESOLUTION
    color = np.array([[0.36, 0.44, 0.52], [0.45, 0.42, 0.44], [0.40, 0.48, 0.42], [0.52, 0.46, 0.40]])[rng.integers(4)]
    half = side // 2
    lines = 1 + 0.05 * np.sin(2 * np.pi * np.arange(side) / 6)
    picture = np.ones((side, side))
    picture *= np.where(checks(side, half), lines[:, None], lines[None, :])
    picture *= np.where(checks(side, half), 1.03, 0.97)
    picture *= 1 + 0.10 * rng.uniform(-1, 1, (side, side)) + 0.05 * smooth_noise(rng, (side, side), 48)
    return finish(picture[..., None] * color, FLOOR_RESOLUTION)


def concrete(rng: np.random.Generator) -> Finish:
    """Draw poured concrete with a joint every two metres."""
    side = 4 * FLOOR_RESOLUTION
    shape = (side, side)
    cloud = smooth_noise(rng, shape, 192) + 0.5 * smooth_noise(rng, shape, 64) + 0.25 * smooth_noise(rng, shape, 16)
    picture = 0.66 * (1 + 0.07 * cloud + 0.035 * rng.uniform(-1, 1, shape))
    edge = np.minimum(*np.meshgrid(to_edge(side, side // 2), to_edge(side, side // 2)))
    picture *= np.where(edge < 1.5, 0.74, 1.0)
    return finish(picture[..., None] * np.array([1.0, 0.985, 0.96]), FLOOR_RESOLUTION)


def plain(rng: np.random.Generator, height: float) -> Finish:
    """Draw painted plaster."""
    shape = wall_shape(2.0, height)
    picture = np.repeat(
        (1 + 0.007 * smooth_noise(rng, shape, 40) + 0.006 * rng.uniform(-1, 1, shape))[..., None], 3, axis=2
    )
    return skirted(picture * (0.95, 0.95, 0.95))


def panels(rng: np.random.Generator, height: float) -> Finish:
    """Draw wooden panels with mouldings up to the dado rail, and paint above."""
    tall, wide = shape = wall_shape(2.0, height)
    picture = np.full((*shape, 3), 0.95) * (1 + 0.007 * smooth_noise(rng, shape, 40))[..., None]
    dado = tall - round(min(1.05, 0.45 * height) * WALL_RESOLUTION)
    tint = np.array([[0.52, 0.60, 0.58], [0.62, 0.56, 0.48], [0.46, 0.52, 0.60], [0.66, 0.64, 0.60]])[rng.integers(4)]
    picture[dado:] = tint * (1 + 0.02 * smooth_noise(rng, shape, 20, across=3)[dado:, :, None])
    each = wide // 2
    top, foot = dado + 20, tall - round(SKIRTING * WALL_RESOLUTION) - 12
    for left in (0, each):
        field = picture[top:foot, left + 14 : left + each - 14]
        for inset, shade in ((0, 0.72), (2, 1.14), (4, 0.86), (6, 1.05)):
            cut = field[inset : len(field) - inset, inset : field.shape[1] - inset]
            cut[:] = tint * shade
        field[8:-8, 8:-8] = tint * (
            0.97 + 0.02 * smooth_noise(rng, shape, 20)[: len(field) - 16, : field.shape[1] - 16, None]
        )
    picture[dado - 7 : dado] = 1.08 * tint
    picture[dado : dado + 2] = 0.7 * tint
    return skirted(picture, tint=0.85 * tint)


def brick(rng: np.random.Generator, height: float) -> Finish:
    """Draw bricks in stretcher bond, red or whitewashed."""
    course, length = 12, 40  # pixels: 7.5 and 25 cm
    tall, wide = shape = wall_shape(8 * length / WALL_RESOLUTION, height)
    mortar = np.array([0.78, 0.76, 0.72])
    base = np.array([[0.66, 0.40, 0.32], [0.86, 0.84, 0.81]])[rng.integers(2)]
    picture = mortar * np.ones((*shape, 1))
    for row, top in enumerate(range(tall - course, -course, -course)):
        for k in range(wide // length):
            tone = base * (1 + rng.uniform(-0.13, 0.10)) + rng.uniform(-0.02, 0.02, 3)
            columns = (k * length + (row % 2) * length // 2 + np.arange(2, length)) % wide
            picture[max(top + 2, 0) : max(top + course, 0), columns] = tone
    picture *= 1 + 0.05 * smooth_noise(rng, shape, 6)[..., None] + 0.03 * rng.uniform(-1, 1, (*shape, 1))
    return skirted(picture)


def stripes(rng: np.random.Generator, height: float) -> Finish:
    """Draw striped wallpaper."""
    shape = wall_shape(1.2, height)
    pale = np.array([0.93, 0.91, 0.86])
    tint = np.array([[0.70, 0.78, 0.80], [0.84, 0.74, 0.66], [0.74, 0.78, 0.66], [0.78, 0.72, 0.80]])[rng.integers(4)]
    at = np.arange(shape[1]) % (shape[1] // 4) / (shape[1] // 4)
    row = np.where((at < 0.5)[:, None], tint, pale)
    row = np.where((np.abs(at - 0.75) < 0.03)[:, None], tint, row)
    return skirted(row * (1 + 0.01 * smooth_noise(rng, shape, 12)[..., None]))


FLOORS: Mapping[str, Callable[[np.random.Generator], Finish]] = MappingProxyType(
    {"tiles": tiles, "wood": wood, "carpet": carpet, "concrete": concrete, **kind_textures.FLOORS}
)
"""Drawing functions of floor finishes, by name."""
WALLS: Mapping[str, Callable[[np.random.Generator, float], Finish]] = MappingProxyType(
    {"plain": plain, "panels": panels, "brick": brick, "stripes": stripes, **kind_textures.WALLS}
)
"""Drawing functions of wall finishes, by name; each takes the height of the wall in metres."""
