"""Seamless textures of floors and walls: procedural ones of smooth periodic noise, and pictures that ship.

A texture shows a patch of given size in metres; its rows run downwards, on a wall from the top to the floor.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.checks import seal

FLOOR_RESOLUTION = 192  # pixels per metre
WALL_RESOLUTION = 160
SKIRTING = 0.1  # metres: height of the skirting board
FINISHES = Path(__file__).parents[3] / "assets" / "finishes"
"""Folder of the pictures of finishes that simharness ships, some of each."""


@dataclass(frozen=True)
class TiledTexture:
    """Finish of a floor or wall: a texture (h, w, 3) uint8, sRGB, of a patch with width and height ``size``, metres."""

    texture: NDArray[np.uint8]
    size: tuple[float, float]


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


def wall_shape(width: float, height: float) -> tuple[int, int]:
    """Return rows and columns of the picture of a wall with a width and height in metres."""
    return max(round(height * WALL_RESOLUTION), 1), round(width * WALL_RESOLUTION)


def skirted(picture: Floats, tint: Floats | None = None) -> TiledTexture:
    """Add a skirting board along the floor and return the texture."""
    board = min(round(SKIRTING * WALL_RESOLUTION), len(picture) // 2)
    picture[-board:] = (0.56, 0.54, 0.52) if tint is None else tint
    picture[-board : -board + 2] *= 1.15
    return tiled_texture(picture, WALL_RESOLUTION)


def tiled_texture(picture: Floats, resolution: int) -> TiledTexture:
    """Return the texture of a picture (h, w, 3) with values from 0 to 1."""
    texture = np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)
    seal(texture)  # the walls of a room share it
    return TiledTexture(texture, (texture.shape[1] / resolution, texture.shape[0] / resolution))


def edge_distance(length: int, cell: int) -> NDArray[np.int_]:
    """Return the distance of every pixel to the nearest border between cells."""
    at = np.arange(length) % cell
    return np.minimum(at, cell - 1 - at)


def _checkerboard(side: int, half: int) -> NDArray[np.bool_]:
    """Return the squares of a chessboard, (side, side)."""
    i, j = np.meshgrid(np.arange(side) // half, np.arange(side) // half, indexing="ij")
    return np.asarray((i + j) % 2 == 0)


Floor = Callable[[np.random.Generator], TiledTexture]
Paper = Callable[[np.random.Generator, float], TiledTexture]


def painted(name: str, rng: np.random.Generator, height: float | None = None) -> TiledTexture:
    """Return a finish of furnished rooms, one of its shipped pictures.

    The picture of a wall is cut off at ``height`` metres above the floor, or mirrored above its upper edge.
    """
    files = sorted(FINISHES.glob(f"{name}.*.webp"))
    picture = np.asarray(cv2.imread(str(files[rng.integers(len(files))])), float)[..., ::-1] / 255
    if height is None:
        return tiled_texture(picture, FLOOR_RESOLUTION)
    rows = wall_shape(1.0, height)[0]
    picture = np.pad(picture, ((max(rows - len(picture), 0), 0), (0, 0), (0, 0)), mode="symmetric")
    return tiled_texture(picture[-rows:], WALL_RESOLUTION)


_FLOORS = ("carpet_tiles", "linoleum", "parquet", "sports_floor", "stage_boards", "paving", "asphalt", "grass")
_WALLS = ("tinted", "wallpaper", "tiled", "curtain")
FLOORS: Mapping[str, Floor] = MappingProxyType(
    {"tiles": tiles, "wood": wood, "carpet": carpet, "concrete": concrete}
    | {name: partial(painted, name) for name in _FLOORS}
)
"""Drawing functions of floors, by name; those of any room come first."""
WALLS: Mapping[str, Paper] = MappingProxyType(
    {"plain": plain, "panels": panels, "brick": brick, "stripes": stripes}
    | {name: partial(painted, name) for name in _WALLS}
)
"""Drawing functions of walls, by name; each takes the height of the wall in metres."""


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
