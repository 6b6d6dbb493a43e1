"""Pictures of the finishes of rooms: floors, and walls of the height ``TALL``."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from simharness.world.scene.rooms.tiled_textures import (
    FLOOR_RESOLUTION,
    WALL_RESOLUTION,
    WALLS,
    TiledTexture,
    tiled_texture,
)

TALL = 6.0  # metres
MEADOW = (0.34, 0.41, 0.20)
"""Mean albedo of the meadow, sRGB."""
SKIRTING = 0.1  # metres: height of the skirting board
_FLOOR, _WALL = (3, 85), (6, 95)  # pictures of each, and quality: few colours show blocks


def tiles(rng: np.random.Generator) -> TiledTexture:
    """Draw light and dark tiles of half a metre with slight variation."""
    count, side = 8, FLOOR_RESOLUTION // 2
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    base = np.where(((i + j) % 2 == 1)[..., None], (0.735, 0.725, 0.70), (0.86, 0.84, 0.80))
    tone = base * (1 + rng.uniform(-0.025, 0.025, (count, count, 1)))
    picture = np.repeat(np.repeat(tone, side, axis=0), side, axis=1)
    picture *= 1 + 0.015 * smooth_noise(rng, picture.shape[:2], 24)[..., None]
    inside = np.minimum(*np.meshgrid(edge_distance(count * side, side), edge_distance(count * side, side)))
    picture *= np.where(inside < 1.5, 0.86, 1.0)[..., None]  # grout
    return tiled_texture(picture, FLOOR_RESOLUTION)


def wood(rng: np.random.Generator) -> TiledTexture:
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
    return tiled_texture(picture, FLOOR_RESOLUTION)


def carpet(rng: np.random.Generator) -> TiledTexture:
    """Draw squares of loop carpet with alternating direction of the pile."""
    side = 2 * FLOOR_RESOLUTION
    color = np.array([[0.36, 0.44, 0.52], [0.45, 0.42, 0.44], [0.40, 0.48, 0.42], [0.52, 0.46, 0.40]])[rng.integers(4)]
    half = side // 2
    lines = 1 + 0.05 * np.sin(2 * np.pi * np.arange(side) / 6)
    picture = np.ones((side, side))
    picture *= np.where(_checkerboard(side, half), lines[:, None], lines[None, :])
    picture *= np.where(_checkerboard(side, half), 1.03, 0.97)
    picture *= 1 + 0.10 * rng.uniform(-1, 1, (side, side)) + 0.05 * smooth_noise(rng, (side, side), 48)
    return tiled_texture(picture[..., None] * color, FLOOR_RESOLUTION)


def concrete(rng: np.random.Generator) -> TiledTexture:
    """Draw poured concrete with a joint every two metres."""
    side = 4 * FLOOR_RESOLUTION
    shape = (side, side)
    cloud = smooth_noise(rng, shape, 192) + 0.5 * smooth_noise(rng, shape, 64) + 0.25 * smooth_noise(rng, shape, 16)
    picture = 0.66 * (1 + 0.07 * cloud + 0.035 * rng.uniform(-1, 1, shape))
    edge = np.minimum(*np.meshgrid(edge_distance(side, side // 2), edge_distance(side, side // 2)))
    picture *= np.where(edge < 1.5, 0.74, 1.0)
    return tiled_texture(picture[..., None] * np.array([1.0, 0.985, 0.96]), FLOOR_RESOLUTION)


def plain(rng: np.random.Generator, height: float) -> TiledTexture:
    """Draw painted plaster."""
    shape = wall_shape(2.0, height)
    picture = np.repeat(
        (1 + 0.007 * smooth_noise(rng, shape, 40) + 0.006 * rng.uniform(-1, 1, shape))[..., None], 3, axis=2
    )
    return skirted(picture * (0.95, 0.95, 0.95))


def panels(rng: np.random.Generator, height: float) -> TiledTexture:
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
            inner = field[inset : len(field) - inset, inset : field.shape[1] - inset]
            inner[:] = tint * shade
        field[8:-8, 8:-8] = tint * (
            0.97 + 0.02 * smooth_noise(rng, shape, 20)[: len(field) - 16, : field.shape[1] - 16, None]
        )
    picture[dado - 7 : dado] = 1.08 * tint
    picture[dado : dado + 2] = 0.7 * tint
    return skirted(picture, tint=0.85 * tint)


def brick(rng: np.random.Generator, height: float) -> TiledTexture:
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


def stripes(rng: np.random.Generator, height: float) -> TiledTexture:
    """Draw striped wallpaper."""
    shape = wall_shape(1.2, height)
    pale = np.array([0.93, 0.91, 0.86])
    tint = np.array([[0.70, 0.78, 0.80], [0.84, 0.74, 0.66], [0.74, 0.78, 0.66], [0.78, 0.72, 0.80]])[rng.integers(4)]
    at = np.arange(shape[1]) % (shape[1] // 4) / (shape[1] // 4)
    row = np.where((at < 0.5)[:, None], tint, pale)
    row = np.where((np.abs(at - 0.75) < 0.03)[:, None], tint, row)
    return skirted(row * (1 + 0.01 * smooth_noise(rng, shape, 12)[..., None]))


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


def wall_shape(width: float, height: float) -> tuple[int, int]:
    """Return rows and columns of the picture of a wall with a width and height in metres."""
    return max(round(height * WALL_RESOLUTION), 1), round(width * WALL_RESOLUTION)


def skirted(picture: Floats, tint: Floats | None = None) -> TiledTexture:
    """Add a skirting board along the floor and return the texture."""
    board = min(round(SKIRTING * WALL_RESOLUTION), len(picture) // 2)
    picture[-board:] = (0.56, 0.54, 0.52) if tint is None else tint
    picture[-board : -board + 2] *= 1.15
    return tiled_texture(picture, WALL_RESOLUTION)


def edge_distance(length: int, cell: int) -> NDArray[np.int_]:
    """Return the distance of every pixel to the nearest border between cells."""
    at = np.arange(length) % cell
    return np.minimum(at, cell - 1 - at)


def _checkerboard(side: int, half: int) -> NDArray[np.bool_]:
    """Return the squares of a chessboard, (side, side)."""
    i, j = np.meshgrid(np.arange(side) // half, np.arange(side) // half, indexing="ij")
    return np.asarray((i + j) % 2 == 0)


def smooth_noise(rng: np.random.Generator, shape: tuple[int, int], cell: int, *, across: int | None = None) -> Floats:
    """Return smooth periodic noise of about unit amplitude, with blobs ``cell`` pixels wide and ``across`` high."""
    down = cell if across is None else across
    rows, columns = max(shape[0] // down, 1), max(shape[1] // cell, 1)
    coarse = np.pad(rng.uniform(-1, 1, (rows, columns)), 2, mode="wrap")
    scale = np.array([shape[1] / columns, shape[0] / rows])
    size = (round(scale[0] * (columns + 4)), round(scale[1] * (rows + 4)))
    fine = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    top, left = round(2 * scale[1]), round(2 * scale[0])
    return np.asarray(fine[top : top + shape[0], left : left + shape[1]], float)


def meadow(rng: np.random.Generator) -> TiledTexture:
    """Draw a meadow from afar, 30 m of it: patches of several greens with the mean ``MEADOW``."""
    shape = (512, 512)
    patches = sum(smooth_noise(rng, shape, 128 >> k) / (k + 1.0) for k in range(5)) + 0.4 * rng.uniform(-1, 1, shape)
    shade = 1 + 0.09 * np.asarray(patches)[..., None]
    dry = 0.03 * smooth_noise(rng, shape, 96)[..., None] * np.array([1.0, 0.35, 0.2])
    picture = shade * MEADOW + dry
    picture *= np.array(MEADOW) / picture.mean(axis=(0, 1))
    return tiled_texture(picture, FLOOR_RESOLUTION)


FINISHES: dict[str, Callable[..., TiledTexture]] = {
    draw.__name__: draw
    for draw in (
        *(tiles, wood, carpet, concrete, plain, panels, brick, stripes),
        *(carpet_tiles, linoleum, parquet, sports_floor, stage_boards, paving, asphalt, grass, meadow),
        *(tinted, wallpaper, tiled, curtain),
    )
}
"""Functions that draw floors, and walls of a height in metres, by name."""


_SHARP = {
    "stripes": 101,
    "meadow": 96,
}  # quality of others; above 100 lossless: the edge at the seam is one as any other


def write_finishes(folder: Path) -> None:
    """Write the pictures of all finishes as ``NAME.0.webp`` and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FINISHES.items():
        height = (TALL,) if name in WALLS else ()
        variants, quality = _WALL if height else _FLOOR
        for k in range(variants):
            texture = draw(stream(0, "finishes", name, k), *height).texture
            path = str(folder / f"{name}.{k}.webp")
            sharp = _SHARP.get(name, quality)
            cv2.imwrite(path, texture[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, sharp])
