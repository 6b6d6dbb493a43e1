"""Pictures of the finishes of furnished rooms: floors, and walls of the height ``TALL``."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from simharness.types.random_streams import stream
from simharness.world.scene.rooms.textures import (
    FLOOR_RESOLUTION,
    SKIRTING,
    WALL_RESOLUTION,
    TiledTexture,
    edge_distance,
    skirted,
    smooth_noise,
    tiled_texture,
    wall_shape,
)

TALL = 6.0  # metres
_FLOOR, _WALL = (3, 85), (6, 95)  # pictures of each, and quality: few colours show blocks


def carpet_tiles(rng: np.random.Generator) -> TiledTexture:
    """Draw carpet tiles of half a metre, grey with flecks, pile turned from tile to tile."""
    count, side = 6, FLOOR_RESOLUTION // 2
    shape = (count * side, count * side)
    color = np.array([[0.40, 0.42, 0.45], [0.36, 0.40, 0.44], [0.46, 0.44, 0.42], [0.34, 0.39, 0.38]])[rng.integers(4)]
    rows, columns = (smooth_noise(rng, shape, 24, across=2), smooth_noise(rng, shape, 2, across=24))
    i, j = np.meshgrid(np.arange(shape[0]) // side, np.arange(shape[1]) // side, indexing="ij")
    shade = 1 + 0.09 * np.where((i + j) % 2 == 0, rows, columns) + 0.07 * rng.uniform(-1, 1, shape)
    shade *= (1 + rng.uniform(-0.025, 0.025, (count, count))).repeat(side, axis=0).repeat(side, axis=1)
    return tiled_texture(shade[..., None] * color, FLOOR_RESOLUTION)


def linoleum(rng: np.random.Generator) -> TiledTexture:
    """Draw marbled linoleum in sheets of two metres."""
    side = 2 * FLOOR_RESOLUTION
    shape = (side, side)
    color = np.array([[0.62, 0.66, 0.66], [0.66, 0.64, 0.58], [0.56, 0.62, 0.66], [0.66, 0.60, 0.52]])[rng.integers(4)]
    marble = 0.6 * smooth_noise(rng, shape, 16, across=6) + 0.6 * smooth_noise(rng, shape, 5, across=3)
    picture = (1 + 0.03 * marble + 0.02 * rng.uniform(-1, 1, shape))[..., None] * color
    picture *= np.where(edge_distance(side, side) < 0.5, 0.93, 1.0)[None, :, None]
    return tiled_texture(picture, FLOOR_RESOLUTION)


def parquet(rng: np.random.Generator) -> TiledTexture:
    """Draw herringbone parquet of oak, 7 by 28 cm."""
    wide, long = 14, 56
    side = long * 8
    picture = np.zeros((side, side, 3))
    y, x = np.mgrid[:side, :side]
    # A herringbone of horizontal and vertical blocks, each shifted by its width from row to row.
    step = (x // wide - y // wide) % (2 * long // wide)
    flat = step < long // wide
    across = np.where(flat, y, x) // wide
    along = np.where(flat, (x - y // wide * wide) // (2 * long), (y - x // wide * wide) // (2 * long))
    number = (across * 7 + along * 131 + flat * 59) % 997
    tone = np.array([0.66, 0.48, 0.31]) * rng.uniform(0.84, 1.12, (997, 1)) + rng.uniform(-0.012, 0.012, (997, 3))
    picture = tone[number]
    grain = np.where(flat, smooth_noise(rng, (side, side), 48, across=2), smooth_noise(rng, (side, side), 2, across=48))
    edge = np.where(flat, y % wide, x % wide) == 0
    start = np.where(flat, (x - y // wide * wide) % (2 * long), (y - x // wide * wide - long) % (2 * long)) == 0
    picture = picture * (1 + 0.06 * grain)[..., None] * np.where(edge | start, 0.78, 1.0)[..., None]
    return tiled_texture(picture, FLOOR_RESOLUTION)


def sports_floor(rng: np.random.Generator) -> TiledTexture:
    """Draw the lacquered strips of a gym's floor; the lines of its courts are painted on it by the room."""
    width, length = 14, 2 * FLOOR_RESOLUTION
    rows = 24
    shape = (rows * width, length)
    grain = smooth_noise(rng, shape, 64, across=2)
    picture = np.empty((*shape, 3))
    for row in range(rows):
        ends = np.sort(rng.uniform(0, length, 3))
        which = np.searchsorted(ends, np.arange(length)) % 3
        tones = np.array([0.80, 0.63, 0.42]) * rng.uniform(0.93, 1.05, (3, 1))
        picture[row * width : (row + 1) * width] = tones[which]
        picture[row * width : (row + 1) * width, ends.astype(int)] *= 0.85
        picture[row * width] *= 0.9
    return tiled_texture(picture * (1 + 0.03 * grain)[..., None], FLOOR_RESOLUTION)


def stage_boards(rng: np.random.Generator) -> TiledTexture:
    """Draw black stage boards with scratches and grey traces of use."""
    width, length = 24, 3 * FLOOR_RESOLUTION
    shape = (16 * width, length)
    picture = 0.17 * np.ones(shape) * (1 + 0.25 * smooth_noise(rng, shape, 96, across=6))
    picture *= np.where(np.arange(shape[0]) % width < 1.5, 0.5, 1.0)[:, None]
    worn = np.maximum(smooth_noise(rng, shape, 144) + 0.5 * smooth_noise(rng, shape, 24), 0)
    picture += 0.045 * worn
    for x, y, turn, reach in zip(
        *rng.uniform(0.15, 0.85, (2, 60)), rng.uniform(0, np.pi, 60), rng.uniform(8, 50, 60), strict=True
    ):
        a = np.array([x * shape[1], y * shape[0]])
        b = a + reach * np.array([np.cos(turn), np.sin(turn)])
        cv2.line(picture, a.astype(int).tolist(), b.astype(int).tolist(), 0.26, 1, cv2.LINE_AA)
    return tiled_texture(picture[..., None] * np.array([1.0, 0.97, 0.94]), FLOOR_RESOLUTION)


def paving(rng: np.random.Generator) -> TiledTexture:
    """Draw concrete paving stones of 40 by 20 cm in running bond, with sand in the joints."""
    long, wide = 76, 38
    shape = (16 * wide, 8 * long)
    y, x = np.mgrid[: shape[0], : shape[1]]
    row = y // wide
    shifted = (x + (row % 2) * long // 2) % shape[1]
    stone = (row * 31 + shifted // long * 7) % 512
    tone = rng.uniform(0.88, 1.08, 512)[stone] * 0.60
    tone = tone * (1 + 0.06 * smooth_noise(rng, shape, 12) + 0.07 * rng.uniform(-1, 1, shape))
    joint = np.minimum(np.minimum(y % wide, wide - 1 - y % wide), np.minimum(shifted % long, long - 1 - shifted % long))
    color = np.where((joint < 1.5)[..., None], [0.42, 0.39, 0.33], tone[..., None] * [1.0, 0.98, 0.94])
    stain = 1 + 0.08 * smooth_noise(rng, shape, 152)
    return tiled_texture(color * stain[..., None], FLOOR_RESOLUTION)


def asphalt(rng: np.random.Generator) -> TiledTexture:
    """Draw asphalt: grains of light stone in dark binder, patches of wear."""
    side = 4 * FLOOR_RESOLUTION
    shape = (side, side)
    grains = rng.uniform(size=shape)
    shade = 0.36 + 0.10 * np.maximum(grains - 0.8, 0) * 5 - 0.06 * (grains < 0.15)
    shade *= 1 + 0.08 * smooth_noise(rng, shape, 192) + 0.05 * smooth_noise(rng, shape, 32)
    return tiled_texture(shade[..., None] * np.array([1.0, 0.99, 0.98]), FLOOR_RESOLUTION)


def grass(rng: np.random.Generator) -> TiledTexture:
    """Draw a lawn: blades of many greens, with yellower and thinner places."""
    side = 4 * FLOOR_RESOLUTION
    shape = (side, side)
    blades = smooth_noise(rng, shape, 2, across=7) + smooth_noise(rng, shape, 5, across=2)
    dry = np.clip(0.5 + 0.35 * smooth_noise(rng, shape, 128) + 0.2 * smooth_noise(rng, shape, 32), 0, 1)[..., None]
    color = (1 - dry) * np.array([0.24, 0.36, 0.14]) + dry * np.array([0.38, 0.42, 0.20])
    return tiled_texture(color * (1 + 0.20 * blades)[..., None], FLOOR_RESOLUTION)


def tinted(rng: np.random.Generator, height: float) -> TiledTexture:
    """Draw plaster painted in a light colour."""
    shape = wall_shape(2.0, height)
    color = np.array(colorsys.hsv_to_rgb(rng.uniform(0.05, 0.65), rng.uniform(0.05, 0.16), rng.uniform(0.82, 0.92)))
    shade = 1 + 0.008 * smooth_noise(rng, shape, 40) + 0.008 * rng.uniform(-1, 1, shape)
    return skirted(shade[..., None] * color, tint=np.array([0.88, 0.87, 0.85]))


def wallpaper(rng: np.random.Generator, height: float) -> TiledTexture:
    """Draw wallpaper with a small repeated leaf, tone in tone."""
    tall, wide = shape = wall_shape(1.28, height)
    hue, ground = rng.uniform(), rng.uniform(0.78, 0.9)
    base = np.array(colorsys.hsv_to_rgb(hue, 0.10, ground))
    picture = np.tile(base, (tall, wide, 1))
    ink = np.array(colorsys.hsv_to_rgb(hue, 0.20, ground - 0.10)).tolist()
    cell = wide // 8
    for row in range(-1, tall // cell + 2):
        for column in range(-1, 9):
            at = np.array([(column + 0.5 * (row % 2)) * cell, row * cell])
            for turn in (-40, 0, 40):
                way = np.array([np.sin(np.radians(turn)), -np.cos(np.radians(turn))])
                middle = at + 0.24 * cell * way
                cv2.ellipse(picture, ((middle[0], middle[1]), (0.13 * cell, 0.38 * cell), turn), ink, -1, cv2.LINE_AA)
    picture *= (1 + 0.012 * smooth_noise(rng, shape, 20) + 0.012 * rng.uniform(-1, 1, shape))[..., None]
    return skirted(picture, tint=np.array([0.90, 0.89, 0.86]))


def tiled(rng: np.random.Generator, height: float) -> TiledTexture:
    """Draw glazed tiles of 20 cm up to 1.6 m, and paint above."""
    tall, wide = shape = wall_shape(1.6, height)
    side = WALL_RESOLUTION // 5
    picture = np.full((*shape, 3), 0.93) * (1 + 0.006 * smooth_noise(rng, shape, 40))[..., None]
    glaze = np.array([[0.88, 0.90, 0.90], [0.76, 0.85, 0.85], [0.90, 0.88, 0.82], [0.78, 0.83, 0.88]])[rng.integers(4)]
    top = max(tall - min(8, int(0.6 * tall) // side) * side, 0)
    y, x = np.mgrid[: tall - top, :wide]
    tone = rng.uniform(0.97, 1.02, (64, 64))[y // side % 64, x // side % 64]
    joint = np.minimum(y % side, x % side) < 1.5
    picture[top:] = np.where(joint[..., None], 0.72, tone[..., None] * glaze)
    picture[max(top - 3, 0) : top] = 0.8 * glaze
    return skirted(picture, tint=0.75 * glaze)


def curtain(rng: np.random.Generator, height: float) -> TiledTexture:
    """Draw a heavy curtain in folds."""
    tall, wide = wall_shape(2.4, height)
    color = np.array([[0.34, 0.06, 0.07], [0.08, 0.08, 0.09], [0.07, 0.11, 0.20], [0.24, 0.05, 0.10]])[rng.integers(4)]
    x = np.arange(wide) / wide
    sway = 0.25 * smooth_noise(rng, (tall, wide), wide // 6, across=max(tall // 2, 1))
    phase = 2 * np.pi * 11 * x + 1.6 * np.sin(2 * np.pi * 3 * x + 1) + sway
    fold = 0.62 + 0.30 * np.sin(phase) + 0.08 * np.sin(2 * phase + 0.7)
    velvet = 1 + 0.06 * rng.uniform(-1, 1, (tall, wide))
    picture = (fold * velvet)[..., None] * color * 1.5 + 0.03 * np.maximum(np.sin(phase), 0)[..., None]
    hem = round(SKIRTING * WALL_RESOLUTION)
    picture[-hem:] *= 0.8
    return tiled_texture(picture, WALL_RESOLUTION)


FINISHES: dict[str, Callable[..., TiledTexture]] = {
    draw.__name__: draw
    for draw in (
        *(carpet_tiles, linoleum, parquet, sports_floor, stage_boards, paving, asphalt, grass),
        *(tinted, wallpaper, tiled, curtain),
    )
}
"""Functions that draw floors, and walls of a height in metres, by name."""


def write_finishes(folder: Path) -> None:
    """Write the pictures of all finishes as ``NAME.0.webp`` and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FINISHES.items():
        height = (TALL,) if name in ("tinted", "wallpaper", "tiled", "curtain") else ()
        variants, quality = _WALL if height else _FLOOR
        for k in range(variants):
            texture = draw(stream(0, "finishes", name, k), *height).texture
            path = str(folder / f"{name}.{k}.webp")
            cv2.imwrite(path, texture[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, quality])
