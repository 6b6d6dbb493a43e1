"""Pictures of the materials and prints of a scene's objects: screens, posters, papers, boards and packages."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from mvpose.arrays import Floats
from simharness.types.random_streams import stream
from tools.objects.finishes import smooth_noise

Draw = Callable[[np.random.Generator], Floats]


def _plain(rng: np.random.Generator) -> Floats:
    shape = (128, 128)
    return _grey(0.985 + 0.008 * smooth_noise(rng, shape, 16) + 0.004 * rng.uniform(-1, 1, shape))


def _wood(rng: np.random.Generator) -> Floats:
    """Draw planed wood: long grain, cathedral figure of the growth rings, pores."""
    shape = (250, 620)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    bend = 16 * smooth_noise(rng, shape, 310, across=125) + 5 * smooth_noise(rng, shape, 155, across=60)
    rings = np.sin((y + bend + 0.006 * (x - 300)) / 5.5)
    grain = smooth_noise(rng, shape, 124, across=2)
    pores = np.minimum(smooth_noise(rng, shape, 40, across=1), -0.35) + 0.35
    shade = 0.93 + 0.035 * rings + 0.035 * grain + 0.10 * pores
    warm = np.array([1.0, 0.985, 0.96])
    return _grey(shade) ** (1 + 1.2 * (1 - warm))


def _fabric(rng: np.random.Generator) -> Floats:
    """Draw woven cloth: over and under, with threads of uneven shade."""
    side = 256
    i, j = np.mgrid[:side, :side]
    weave = np.where((i // 2 + j // 2) % 2 == 0, 1.0, 0.93)
    threads = 1 + 0.03 * rng.uniform(-1, 1, (side // 2, 1)).repeat(2, axis=0) + 0.03 * rng.uniform(-1, 1, (1, side))
    return _grey(0.96 * weave * threads * (1 + 0.03 * smooth_noise(rng, (side, side), 64)))


def _metal(rng: np.random.Generator) -> Floats:
    shape = (160, 320)
    brushed = smooth_noise(rng, shape, 80, across=1)
    return _grey(0.96 + 0.02 * brushed + 0.015 * smooth_noise(rng, shape, 80))


def _leaves(rng: np.random.Generator) -> Floats:
    """Draw foliage: small leaves of different shade with dark gaps."""
    side = 256
    picture = np.full((side, side, 3), 0.30)
    for depth in range(3):
        for x, y, turn, shade in zip(
            *rng.uniform(0, side, (2, 420)), rng.uniform(0, 180, 420), rng.uniform(0.5, 1.0, 420), strict=True
        ):
            tone = shade * (0.66 + 0.17 * depth)
            cv2.ellipse(picture, ((x, y), (9.0, 4.5), turn), (tone, tone, 0.92 * tone), -1)
    return np.asarray(picture)


def _grey(shade: Floats) -> Floats:
    return np.repeat(np.asarray(shade)[..., None], 3, axis=2)


def landscape(rng: np.random.Generator, size: tuple[int, int] = (240, 160)) -> Floats:
    """Draw a painted landscape: sky, sun and rows of hills, (h, w, 3), 0 to 1."""
    width, height = size
    hue = rng.uniform(0.5, 0.66) if rng.uniform() < 0.7 else rng.uniform(0.02, 0.12)
    top, low = (np.array(colorsys.hsv_to_rgb(hue, *shade)) for shade in ((0.45, 0.80), (0.18, 0.96)))
    share = np.linspace(0, 1, height)[:, None, None]
    picture = np.tile((1 - share) * top + share * low, (1, width, 1))
    sun = (int(rng.uniform(0.2, 0.8) * width), int(rng.uniform(0.2, 0.45) * height))
    cv2.circle(picture, sun, int(0.09 * width), (0.98, 0.90, 0.72), -1, cv2.LINE_AA)
    x = np.arange(width)
    for row in range(4):
        base = height * (0.45 + 0.14 * row)
        waves = sum(
            rng.uniform(2, 12) / k * np.sin(2 * np.pi * k * x / width * 1.3 + rng.uniform(0, 6)) for k in (1, 2, 4)
        )
        color = np.array(colorsys.hsv_to_rgb((hue + 0.68 + 0.04 * row) % 1, 0.22 + 0.07 * row, 0.74 - 0.13 * row))
        picture[np.arange(height)[:, None] > base + waves] = color
    return picture


def abstract(rng: np.random.Generator, size: tuple[int, int] = (160, 220)) -> Floats:
    """Draw an abstract poster: discs and bars in three colours on paper."""
    width, height = size
    hue = rng.uniform()
    inks = [
        colorsys.hsv_to_rgb((hue + k * 0.37) % 1, rng.uniform(0.35, 0.6), rng.uniform(0.45, 0.85)) for k in range(3)
    ]
    picture = np.tile(np.array([0.93, 0.91, 0.86]), (height, width, 1))
    for ink in inks:
        place = tuple(int(v) for v in rng.uniform(0.25, 0.75, 2) * size)
        cv2.circle(picture, place, int(rng.uniform(0.14, 0.34) * width), ink, -1, cv2.LINE_AA)
        left, top = (rng.uniform(0.08, 0.6, 2) * size).astype(int)
        picture[top : top + int(0.05 * height), left : left + int(rng.uniform(0.2, 0.5) * width)] = ink
    _lines(picture, rng, left=0.12, right=0.7, top=0.88, bottom=0.95, pitch=7, ink=0.3)
    return picture


def notice(rng: np.random.Generator, size: tuple[int, int] = (120, 168)) -> Floats:
    """Draw a sheet of paper with a headline, text and sometimes a picture."""
    width, height = size
    picture = np.full((height, width, 3), 0.96)
    ink = np.array(colorsys.hsv_to_rgb(rng.uniform(), 0.7, 0.55))
    picture[12:22, 12 : int(width * rng.uniform(0.5, 0.85))] = ink
    first = 0.2
    if rng.uniform() < 0.6:
        picture[34:84, 12:-12] = landscape(rng, (width - 24, 50))
        first = 0.55
    _lines(picture, rng, left=0.1, right=0.9, top=first, bottom=0.93, pitch=6, ink=0.45)
    return picture


def screen(rng: np.random.Generator, size: tuple[int, int] = (256, 150)) -> Floats:
    """Draw the picture of a computer's screen: windows with text and a plot."""
    width, height = size
    picture = np.tile(np.array([0.16, 0.24, 0.34]) * rng.uniform(0.8, 1.3), (height, width, 1))
    for _ in range(2):
        left, top = (rng.uniform(0.02, 0.4, 2) * size).astype(int)
        right, low = min(width - 4, left + int(0.55 * width)), min(height - 12, top + int(0.6 * height))
        dark = rng.uniform() < 0.4
        picture[top:low, left:right] = 0.14 if dark else 0.95
        picture[top : top + 7, left:right] = (0.35, 0.45, 0.60) if dark else (0.78, 0.80, 0.84)
        window = picture[top + 9 : low, left:right]
        _lines(window, rng, left=0.05, right=0.9, top=0.08, bottom=0.95, pitch=5, ink=0.75 if dark else 0.40)
    picture[-9:] = (0.10, 0.12, 0.16)
    picture[-7:-2, 6:80:12] = (0.55, 0.60, 0.70)
    return picture


def whiteboard(rng: np.random.Generator, size: tuple[int, int] = (420, 220)) -> Floats:
    """Draw a used whiteboard: wiped areas, handwriting, boxes with arrows, a curve."""
    width, height = size
    picture = np.full((height, width, 3), 0.95)
    for _ in range(5):  # traces of the sponge
        left, top = (rng.uniform(0, 0.7, 2) * size).astype(int)
        picture[top : top + 40, left : left + 130] *= 0.985
    inks = [(0.12, 0.22, 0.55), (0.70, 0.15, 0.15), (0.10, 0.42, 0.22), (0.12, 0.12, 0.14)]
    for row in range(6):
        _scribble(picture, rng, (0.05 * width, (0.12 + 0.11 * row) * height), rng.uniform(0.15, 0.3) * width, inks[3])
    box = np.array([0.45, 0.15]) * size
    for k in range(3):
        x, y = int(box[0]), int(box[1]) + 55 * k
        cv2.rectangle(picture, (x, y), (x + 70, y + 30), inks[0], 2, cv2.LINE_AA)
        _scribble(picture, rng, (x + 10.0, y + 16.0), 48.0, inks[0])
        if k < 2:
            cv2.arrowedLine(picture, (x + 35, y + 32), (x + 35, y + 53), inks[1], 2, cv2.LINE_AA)
    t = np.linspace(0, 1, 60)
    fall = 0.75 - 0.5 * t ** rng.uniform(0.5, 2.0) + 0.05 * np.sin(9 * t)
    curve = np.column_stack([(0.70 + 0.24 * t) * width, fall * height]).astype(np.int32)
    cv2.polylines(picture, [curve], False, inks[1], 2, cv2.LINE_AA)
    axes = np.array([[0.70, 0.2], [0.70, 0.78], [0.96, 0.78]]) * size
    cv2.polylines(picture, [axes.astype(np.int32)], False, inks[3], 2, cv2.LINE_AA)
    return picture


def clock(rng: np.random.Generator, side: int = 96) -> Floats:
    """Draw the face of a clock with its two hands."""
    picture = np.full((side, side, 3), 0.95)
    middle, radius = np.array([side / 2, side / 2]), 0.46 * side
    for k in range(12):
        way = np.array([np.sin(k * np.pi / 6), -np.cos(k * np.pi / 6)])
        ends = [(middle + r * radius * way).astype(int).tolist() for r in (0.82, 0.95)]
        cv2.line(picture, ends[0], ends[1], (0.1, 0.1, 0.1), 2, cv2.LINE_AA)
    for length, turn, thick in ((0.5, rng.uniform(0, 2 * np.pi), 4), (0.75, rng.uniform(0, 2 * np.pi), 2)):
        end = middle + length * radius * np.array([np.sin(turn), -np.cos(turn)])
        cv2.line(picture, middle.astype(int).tolist(), end.astype(int).tolist(), (0.1, 0.1, 0.1), thick, cv2.LINE_AA)
    return picture


def package(rng: np.random.Generator, size: tuple[int, int] = (96, 128)) -> Floats:
    """Draw the front of a package of goods: brand, picture and small print."""
    width, height = size
    hue = rng.uniform()
    ground, brand = (
        np.array(colorsys.hsv_to_rgb(h % 1, s, v))
        for h, s, v in ((hue, rng.uniform(0.2, 0.55), 0.72), (hue + rng.uniform(0.3, 0.7), 0.5, 0.72))
    )
    picture = np.tile(ground if rng.uniform() < 0.6 else np.array([0.92, 0.91, 0.88]), (height, width, 1))
    top = int(rng.uniform(0.06, 0.2) * height)
    picture[top : top + int(0.18 * height), 8:-8] = brand
    picture[top + int(0.05 * height) : top + int(0.11 * height), 16:-24] = 0.97
    cv2.circle(picture, (width // 2, int(0.58 * height)), int(0.26 * width), (brand * 0.7).tolist(), -1, cv2.LINE_AA)
    cv2.circle(picture, (width // 2, int(0.58 * height)), int(0.16 * width), (0.95, 0.93, 0.85), -1, cv2.LINE_AA)
    _lines(picture, rng, left=0.12, right=0.85, top=0.84, bottom=0.95, pitch=5, ink=0.25)
    return picture


def spines(rng: np.random.Generator, size: tuple[int, int] = (300, 96)) -> Floats:
    """Draw the spines of books or folders side by side."""
    width, height = size
    picture = np.zeros((height, width, 3))
    at = 0
    while at < width:
        thick = int(rng.uniform(9, 22))
        color = np.array(colorsys.hsv_to_rgb(rng.uniform(), rng.uniform(0.05, 0.45), rng.uniform(0.25, 0.85)))
        picture[:, at : at + thick] = color
        picture[14:18, at : at + thick] = picture[-20:-17, at : at + thick] = 0.7 * color + 0.3
        picture[24 : 24 + int(rng.uniform(20, 45)), at + thick // 2 - 1 : at + thick // 2 + 2] = 0.92
        picture[:, at : at + 2] *= 0.6
        at += thick
    return picture


def _lines(
    picture: Floats,
    rng: np.random.Generator,
    *,
    left: float,
    right: float,
    top: float,
    bottom: float,
    pitch: int,
    ink: float,
) -> None:
    """Draw lines of text as bars of words, in place."""
    height, width = picture.shape[:2]
    for row in range(int(top * height), int(bottom * height) - 2, pitch):
        at, end = int(left * width), int((left + (right - left) * rng.uniform(0.6, 1.0)) * width)
        while at < end:
            word = int(rng.uniform(0.03, 0.12) * width) + 2
            picture[row : row + max(1, pitch // 3), at : min(at + word, end)] = ink
            at += word + 3


def _scribble(
    picture: Floats,
    rng: np.random.Generator,
    start: tuple[float, float],
    length: float,
    ink: tuple[float, float, float],
) -> None:
    """Draw a line of handwriting, in place."""
    x = np.arange(0, length, 2.0)
    y = 4 * np.sin(x / rng.uniform(1.6, 2.6)) * rng.uniform(0.4, 1.0, len(x))
    line = np.column_stack([start[0] + x, start[1] + y]).astype(np.int32)
    for piece in np.array_split(line, max(1, int(length // 28))):
        cv2.polylines(picture, [piece[:-2]], False, ink, 1, cv2.LINE_AA)


PICTURES: dict[str, tuple[Draw, int]] = {
    **{name: (draw, 3) for name, draw in (("plain", _plain), ("wood", _wood), ("fabric", _fabric), ("metal", _metal))},
    "leaves": (_leaves, 3),
    "landscape": (landscape, 8),
    "poster": (abstract, 12),
    "notice": (notice, 12),
    "screen": (screen, 12),
    "package": (package, 24),
    "spines": (spines, 8),
    "whiteboard": (whiteboard, 6),
    "clock": (clock, 6),
}
"""Functions that draw materials and prints, and the number of pictures of each, by name."""
_QUALITY = 92


def write_pictures(folder: Path) -> None:
    """Write the pictures of all materials and prints as ``NAME.0.webp`` and so on."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (draw, count) in PICTURES.items():
        for k in range(count):
            picture = np.round(255 * np.clip(draw(stream(0, "prints", name, k)), 0, 1)).astype(np.uint8)
            path = str(folder / f"{name}.{k}.webp")
            cv2.imwrite(path, picture[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
