"""Panoramas outdoors: sky and clouds, and hills, woods, houses and trees on the horizon."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.types.lighting import Vector
from simharness.types.random_streams import stream
from simharness.types.srgb import from_linear, to_linear
from simharness.world.scene.rooms.landscape import LOWEST, WHITE
from tools.objects.finishes import MEADOW, smooth_noise
from tools.objects.weather import WEATHERS, Weather

_WIDTH = 4096  # pixels around the horizon: 0.09 degrees each
_SMOOTH = 4  # pixels of the sky along each side of one in which its radiance without clouds is computed
_COARSER = 2  # pixels of the picture along each side of one of the sky
_EYE = 2.0  # metres above the ground
_SIGHT = 1500.0  # metres after which haze leaves a share of 1 / e of a colour: it makes distances felt
_NEAREST = 75.0  # metres
_SUN = np.cos(np.radians(0.7))  # cosine of the radius of the sun with its glare
_WALLS = np.array([[0.80, 0.74, 0.64], [0.74, 0.72, 0.68], [0.66, 0.44, 0.36], [0.86, 0.83, 0.76], [0.72, 0.66, 0.58]])
_ROOFS = np.array([[0.52, 0.30, 0.24], [0.36, 0.34, 0.34], [0.46, 0.28, 0.22], [0.30, 0.30, 0.32]])
_LEAVES = np.array([[0.28, 0.38, 0.18], [0.24, 0.34, 0.18], [0.34, 0.41, 0.20], [0.22, 0.32, 0.22], [0.38, 0.40, 0.22]])
_CEILING = 0.10  # added to the sine of the elevation: clouds near the horizon do not shrink to nothing
_CLOUD_PIXELS = 512  # side of the picture of the clouds, which repeats
_PICTURES, _QUALITY = 3, 85  # of each weather


def write_panoramas(folder: Path) -> None:
    """Write the pictures of all weathers as ``NAME.0.webp`` and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, weather in WEATHERS.items():
        for k in range(_PICTURES):
            path = str(folder / f"{name}.{k}.webp")
            cv2.imwrite(path, draw_panorama(k, weather)[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])


def draw_panorama(seed: int, weather: Weather, ground: Vector = MEADOW) -> NDArray[np.uint8]:
    """Draw the picture of a panorama: see :func:`simharness.world.scene.rooms.landscape.panorama`."""
    rows = round(_WIDTH / (2 * np.pi) * (np.pi / 2 - LOWEST))
    above = _WIDTH // 4 + _COARSER  # rows above the horizon, with a few below
    sky, horizon = _sky(stream(seed, "room", "clouds"), weather, (above // _COARSER, _WIDTH // _COARSER))
    rng = stream(seed, "room", "landscape")
    fine: NDArray[np.float32] = np.asarray(cv2.resize(sky, (_WIDTH, above)), np.float32)
    fine = fine + rng.uniform(0.0, 1.0, (_WIDTH, above)).astype(np.float32).T[..., None]  # no steps in smooth colours
    picture = np.zeros((rows, _WIDTH, 3), np.uint8)
    picture[:above] = np.clip(fine, 0, 255)
    view = _View(picture, weather, horizon)
    _hills(view, rng)
    _ground(view, rng, ground)
    _woods(view, rng)
    things = [(float(far), "tree") for far in _NEAREST + 260 * rng.uniform(size=120) ** 1.5]
    things += [(float(far), "house") for far in rng.uniform(110, 300, 22)]
    for far, kind in sorted(things, reverse=True):
        (_tree if kind == "tree" else _house)(view, rng, far)
    strip = view.picture[view.row(np.radians(24.0)) : view.row(np.radians(-6.0))]
    strip[:] = cv2.GaussianBlur(strip, (0, 0), 0.6)
    return view.picture


def directions(shape: tuple[int, int], lowest: float) -> NDArray[np.float64]:
    """Return the unit vectors to the centres of the pixels of a panorama of a shape (h, w), (h, w, 3)."""
    rows, columns = shape
    azimuth = ((np.arange(columns) + 0.5) / columns - 0.5) * 2 * np.pi
    elevation = np.pi / 2 - (np.arange(rows) + 0.5) / rows * (np.pi / 2 - lowest)
    across = np.cos(elevation)[:, None]
    up = np.broadcast_to(np.sin(elevation)[:, None], shape)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), up], axis=-1)


def _sky(rng: np.random.Generator, weather: Weather, shape: tuple[int, int]) -> tuple[NDArray[np.float32], Floats]:
    """Return the sky, sRGB from 0 to 255, and the mean radiance above the horizon by column, (w, 3)."""
    lowest = np.pi / 2 - shape[0] / shape[1] * 2 * np.pi
    ways = directions(shape, lowest)
    few = directions((shape[0] // _SMOOTH, shape[1] // _SMOOTH), lowest)
    radiance = cv2.resize(weather.radiance(few), shape[::-1], interpolation=cv2.INTER_CUBIC)
    level = weather.level
    if weather.elevation is None:
        patches = smooth_noise(rng, shape, shape[1] // 8, across=shape[0] // 6)
        patches = patches + 0.5 * smooth_noise(rng, shape, shape[1] // 24, across=shape[0] // 18)
        radiance = radiance * (1 + 0.08 * patches)[..., None]
    else:
        density, bright = clouds(rng, ways, weather.towards, float(rng.uniform(*weather.cover)))
        white = (0.95 * bright)[..., None] * (0.6 * level + 0.4 * level.mean())
        radiance += (density**0.8 * 0.92)[..., None] * (white - radiance)
        near = ways @ np.array(weather.towards)
        glare = np.clip((near - _SUN) / (1 - _SUN), 0, 1) * 4.0 + 1.2 * np.exp((near - 1) / 0.004)
        radiance += glare[..., None] * np.array(weather.beam)
    first = round((np.pi / 2 - np.radians(4.0)) / (np.pi / 2 - lowest) * shape[0])
    band = radiance[first : first + max(shape[0] // 60, 1)].mean(axis=0)
    return _shown(radiance).astype(np.float32), np.repeat(band, _COARSER, axis=0)


def _shown(radiance: ArrayLike) -> Floats:
    """Return sRGB, 0 to 255, of radiance."""
    return np.asarray(from_linear(np.clip(np.asarray(radiance) / WHITE, 0, 1)), float)


@dataclass(frozen=True)
class _View:
    """Panorama that is being drawn."""

    picture: NDArray[np.uint8]
    """See :class:`~simharness.types.lighting.Panorama`."""
    weather: Weather
    """Weather."""
    horizon: Floats
    """Radiance of the sky above the horizon, by column, (w, 3)."""

    @property
    def scale(self) -> float:
        """Pixels per radian."""
        return _WIDTH / (2 * np.pi)

    def row(self, elevation: float) -> int:
        """Return the row at an elevation in radians."""
        return round((np.pi / 2 - elevation) * self.scale)

    def color(self, albedo: ArrayLike, light: float, far: float, column: float) -> list[int]:
        """Return the colour of a surface: sRGB albedo, light relative to that on the ground, distance in metres."""
        clear = np.exp(-far / _SIGHT)
        radiance = light * self.weather.level * to_linear(255 * np.asarray(albedo, float))
        mixed = clear * radiance + (1 - clear) * self.horizon[int(column) % _WIDTH]
        return [int(value) for value in np.round(_shown(mixed))]

    def front(self, column: float) -> tuple[float, float]:
        """Return how much of what stands in a column the sun lights, 0 to 1, and on which side: -1 left, 1 right."""
        azimuth = (column / _WIDTH - 0.5) * 2 * np.pi
        beside = self.weather.bearing - azimuth
        if self.weather.elevation is None:
            return 0.5, 0.0
        return float(0.5 - 0.5 * np.cos(beside)), float(np.sin(beside))

    def fill(self, points: ArrayLike, color: Sequence[int]) -> None:
        """Fill a polygon, (n, 2) columns and rows; it may cross the edge of the picture."""
        points = np.asarray(points, float)
        for shift in self._shifts(points[:, 0]):
            cv2.fillPoly(self.picture, [np.round(points + [shift, 0]).astype(np.int32)], color)

    def blobs(self, places: Floats, radii: Floats, colors: Floats) -> None:
        """Draw discs: centres (n, 2), radii (n,), colours (n, 3)."""
        for shift in self._shifts(places[:, 0]):
            for (x, y), radius, color in zip(
                np.round(places + [shift, 0]).astype(int).tolist(), radii, colors.tolist(), strict=True
            ):
                cv2.circle(self.picture, (x, y), int(radius), color, -1)

    def _shifts(self, columns: Floats) -> list[int]:
        spare = 60
        low, high = columns.min() - spare, columns.max() + spare
        return [shift for shift in (-_WIDTH, 0, _WIDTH) if high + shift >= 0 and low + shift < _WIDTH]


def _skyline(view: _View, rng: np.random.Generator, heights: tuple[float, float], cells: Sequence[int]) -> Floats:
    """Return rows of a skyline between two elevations in degrees, by column, (w,)."""
    heap = sum(smooth_noise(rng, (1, _WIDTH), cell)[0] / (k + 1.0) for k, cell in enumerate(cells))
    share = np.clip(0.5 + 0.4 * np.asarray(heap), 0, 1)
    elevation = np.radians(heights[0] + share * (heights[1] - heights[0]))
    return (np.pi / 2 - elevation) * view.scale


def _below(view: _View, rows: Floats, albedo: ArrayLike, light: float, far: float) -> None:
    """Fill everything below a skyline."""
    down = np.arange(len(view.picture))[:, None]
    columns = range(0, _WIDTH, 32)
    colors = np.repeat([view.color(albedo, light, far, column) for column in columns], 32, axis=0)
    colors = cv2.blur(np.concatenate([colors] * 3)[None].astype(np.float32), (129, 1))[0, _WIDTH : 2 * _WIDTH]
    np.copyto(view.picture, np.round(colors).astype(np.uint8)[None], where=(down > rows)[..., None])


def _hills(view: _View, rng: np.random.Generator) -> None:
    for far, heights, cells in ((2200.0, (1.2, 4.2), (512, 180)), (1200.0, (0.7, 2.6), (256, 90, 8))):
        _below(view, _skyline(view, rng, heights, cells), (0.30, 0.38, 0.26), 0.7, far)


def _woods(view: _View, rng: np.random.Generator) -> None:
    """Draw the edge of a wood, a row of crowns."""
    for far, heights, count in ((520.0, (0.5, 1.4), 1500), (380.0, (0.4, 1.7), 900)):
        rows = _skyline(view, rng, heights, (256, 64))
        ground = view.row(-np.arctan(_EYE / far))
        columns = rng.uniform(0, _WIDTH, count)
        gaps = smooth_noise(rng, (1, _WIDTH), 512)[0] > (-0.9 if far > 400 else 0.1)
        columns = columns[gaps[columns.astype(int)]]
        shade = rng.uniform(0.45, 0.95, len(columns))
        tops = rows[columns.astype(int)]
        radii = np.maximum((ground - tops) * rng.uniform(0.3, 0.5, len(columns)), 2)
        places = np.column_stack([columns, ground - (ground - tops) * rng.uniform(0.25, 0.75, len(columns))])
        colors = [
            view.color(_LEAVES[k % len(_LEAVES)], s * (0.5 + 0.5 * view.front(c)[0]), far, c)
            for k, (s, c) in enumerate(zip(shade, columns, strict=True))
        ]
        order = np.argsort(places[:, 1])
        view.blobs(places[order], radii[order], np.array(colors)[order])


def _ground(view: _View, rng: np.random.Generator, albedo: Vector) -> None:
    """Draw level ground up to the horizon, with stripes of fields in the distance."""
    first, near = view.row(0.0), view.row(np.radians(-3.0))
    for row in range(first, near):
        far = _EYE / np.tan(max((row - first + 0.5) / view.scale, 1e-3))
        colors = [view.color(albedo, 1.0, min(far, 3000.0), column) for column in range(0, _WIDTH, 128)]
        wrapped = np.array([colors[-1], *colors, colors[0]], np.float32)[None]
        view.picture[row] = cv2.resize(wrapped, (_WIDTH + 256, 1))[0, 128:-128]
    view.picture[near:] = view.picture[near - 1]
    land = view.picture[first:]
    patches = smooth_noise(rng, land.shape[:2], 256, across=8) + 0.6 * smooth_noise(rng, land.shape[:2], 48, across=3)
    land[:] = np.clip(land * (1 + 0.04 * patches)[..., None], 0, 255).astype(np.uint8)


def _tree(view: _View, rng: np.random.Generator, far: float) -> None:
    """Draw a tree: a trunk, and a crown of clumps that are bright on the side of the sun and above."""
    column, tall = float(rng.uniform(0, _WIDTH)), rng.uniform(7, 15)
    foot, pixel = view.row(-np.arctan(_EYE / far)), view.scale / far
    slender = rng.uniform() < 0.2
    half = tall * (rng.uniform(0.14, 0.2) if slender else rng.uniform(0.28, 0.42)) * pixel
    tall *= pixel
    clear = (0.08 if slender else 0.22) * tall
    trunk = max(0.02 * tall, 1.0)
    view.fill(
        [(column - trunk, foot), (column + trunk, foot), (column + trunk, foot - 0.5 * tall),
         (column - trunk, foot - 0.5 * tall)],
        view.color((0.30, 0.25, 0.20), 0.35, far, column),
    )  # fmt: skip
    count = 240
    turn, reach = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.uniform(0, 1, count))
    x, y = reach * np.cos(turn), reach * np.sin(turn)
    lumps = rng.uniform(-0.5, 0.5, (7, 2))
    x, y = 0.62 * x + lumps[np.arange(count) % 7, 0], 0.62 * y + lumps[np.arange(count) % 7, 1]
    middle, rise = foot - clear - 0.5 * (tall - clear), 0.5 * (tall - clear)
    front, side = view.front(column)
    facing = np.clip(0.25 + 0.55 * front + 0.35 * y + 0.35 * side * x + rng.normal(0, 0.2, count), 0.06, 1.15)
    albedo = _LEAVES[rng.integers(len(_LEAVES))]
    base, lit = (np.array(view.color(albedo, light, far, column)) for light in (0.12, 0.90))
    colors = base + facing[:, None] * (lit - base)
    order = np.argsort(facing + rng.normal(0, 0.25, count))
    places = np.column_stack([column + half * x, middle - rise * y])
    radii = np.maximum(rng.uniform(0.05, 0.13, count) * min(half, rise), 1.0)
    view.blobs(places[order], radii[order], np.clip(colors, 0, 255)[order])


def _house(view: _View, rng: np.random.Generator, far: float) -> None:
    """Draw a house: a front with windows, and a roof."""
    column, floors = float(rng.uniform(0, _WIDTH)), int(rng.integers(1, 4))
    wide, tall = rng.uniform(9, 20), 2.9 * floors + 0.6
    foot, pixel = view.row(-np.arctan(_EYE / far)), view.scale / far
    front, side = view.front(column)
    light = 0.30 + 0.5 * front
    wall, roof = _WALLS[rng.integers(len(_WALLS))], _ROOFS[rng.integers(len(_ROOFS))]
    left, right, top = column - 0.5 * wide * pixel, column + 0.5 * wide * pixel, foot - tall * pixel
    ridge, inset = top - rng.uniform(2.5, 4.5) * pixel, rng.uniform(0.0, 0.3) * wide * pixel
    over = 0.5 * pixel
    view.fill([(left, foot), (right, foot), (right, top), (left, top)], view.color(wall, light, far, column))
    view.fill(
        [(left - over, top), (right + over, top), (right - inset, ridge), (left + inset, ridge)],
        view.color(roof, 0.35 + 0.5 * front, far, column),
    )
    glass = view.color((0.34, 0.38, 0.44), 0.6 + 0.1 * side, far, column)
    number = int(wide // 2.8)
    for floor in range(floors):
        y = foot - (2.9 * floor + 1.0) * pixel
        for k in range(number):
            x = left + (k + 0.5) / number * (right - left)
            w, h = 0.55 * pixel, 1.4 * pixel
            view.fill([(x - w, y), (x + w, y), (x + w, y - h), (x - w, y - h)], glass)
    if rng.uniform() < 0.6:
        x = left + rng.uniform(0.2, 0.8) * (right - left)
        view.fill(
            [(x - 0.4 * pixel, ridge), (x + 0.4 * pixel, ridge), (x + 0.4 * pixel, ridge - 1.0 * pixel),
             (x - 0.4 * pixel, ridge - 1.0 * pixel)],
            view.color(roof, 0.3, far, column),
        )  # fmt: skip


def clouds(rng: np.random.Generator, directions: Floats, sun: ArrayLike, cover: float) -> tuple[Floats, Floats]:
    """Return how dense clouds are, 0 to 1, and how bright, about 0.5 to 1, in directions (h, w, 3); (h, w) each.

    The clouds float on a plane, so that they get smaller towards the horizon; those between the sun and a place shade
    it.

    Args:
        rng: random generator.
        directions: unit vectors.
        sun: unit vector to the sun, (3,).
        cover: share of the sky that they cover, about.
    """
    shape, sun = (_CLOUD_PIXELS, _CLOUD_PIXELS), np.asarray(sun, float)
    heap = np.sum([smooth_noise(rng, shape, 128 >> k) / 1.7**k for k in range(7)], axis=0)
    heap = np.asarray(cv2.GaussianBlur(heap, (0, 0), 0.8), float)
    edge = float(np.quantile(heap, 1.0 - cover))
    density = np.clip((heap - edge) / (0.9 * float(heap.std())), 0.0, 1.0)
    towards = np.round(14 * sun[:2] / max(float(np.hypot(*sun[:2])), 1e-6)).astype(int)
    shaded = cv2.GaussianBlur(np.roll(density, (-towards[1], -towards[0]), axis=(0, 1)), (0, 0), 5.0)
    bright = 1.06 - 0.42 * (0.4 * shaded + 0.6 * cv2.GaussianBlur(density, (0, 0), 9.0)) * density
    up = np.maximum(directions[..., 2], 0.0) + _CEILING
    place = (directions[..., :2] / up[..., None] * 130 + rng.uniform(0, _CLOUD_PIXELS, 2)) % _CLOUD_PIXELS
    place = place.astype(np.float32)
    found = [
        cv2.remap(each.astype(np.float32), place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        for each in (density, bright)
    ]
    haze = np.clip(directions[..., 2] / 0.10, 0.0, 1.0)
    return found[0].astype(float) * haze, found[1].astype(float)
