"""Pictures of posters: a drawn person, almost life-size, whose joints in the picture are known."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats

_FINER = 3  # supersampling factor
_SUBPIXEL_BITS = 4
_SKINS = np.array([[0.93, 0.78, 0.68], [0.80, 0.60, 0.46], [0.62, 0.43, 0.31], [0.42, 0.28, 0.20]])
_HAIR = np.array([[0.20, 0.15, 0.12], [0.38, 0.25, 0.16], [0.72, 0.55, 0.32], [0.10, 0.09, 0.09]])
_TROUSERS = np.array([[0.20, 0.25, 0.36], [0.22, 0.22, 0.24], [0.55, 0.48, 0.38], [0.30, 0.38, 0.50]])

# COCO-17 joints of a standing person of height 1, facing the viewer: x to the right of the viewer, y up from the soles.
_FACE = [(0.0, 0.912), (0.018, 0.930), (-0.018, 0.930), (0.046, 0.920), (-0.046, 0.920)]
_SHOULDER, _HIP, _KNEE, _ANKLE = (0.108, 0.812), (0.062, 0.520), (0.070, 0.285), (0.070, 0.050)
_ARMS = np.array(  # elbow and wrist of the right-hand arm: hanging, on the hip, waving, held out
    [
        [(0.140, 0.645), (0.145, 0.480)],
        [(0.225, 0.665), (0.105, 0.560)],
        [(0.230, 0.745), (0.215, 0.920)],
        [(0.165, 0.640), (0.205, 0.490)],
    ]
)


def draw_person(rng: np.random.Generator, size: tuple[int, int], *, tall: float) -> tuple[NDArray[np.uint8], Floats]:
    """Draw a poster of a person.

    Args:
        rng: random generator for pose, clothes and background.
        size: width and height in pixels.
        tall: height of the person as a share of the height of the picture.

    Returns:
        The picture, (h, w, 3) uint8, and the COCO-17 joints in it, (17, 2), 0 to 1 to the right and down.
    """
    hue, warmth, sense = rng.uniform(), rng.uniform(-0.06, 0.06), rng.choice([-1.0, 1.0])
    arms, apart = _ARMS[rng.integers(len(_ARMS), size=2)], rng.uniform(0.9, 1.5)
    skin, hair = _SKINS[rng.integers(len(_SKINS))], _HAIR[rng.integers(len(_HAIR))]
    trousers, is_long = _TROUSERS[rng.integers(len(_TROUSERS))], rng.uniform() < 0.5
    shirt = np.array(colorsys.hsv_to_rgb((hue + 0.5 + warmth) % 1, 0.62, 0.78))
    width, height = size
    canvas = _Canvas(size, foot=(0.5, 0.955), scale=tall * height)
    _background(canvas, hue, sense)
    joints = np.empty((17, 2))
    joints[:5] = _FACE
    for side, first in ((1.0, 0), (-1.0, 1)):
        flip = np.array([side, 1.0])
        elbow, wrist = arms[first]
        leg = np.array([1.0, 1.0]) + [apart - 1.0, 0.0]
        chain = [_SHOULDER, elbow, wrist, _HIP, np.array(_KNEE) * leg, np.array(_ANKLE) * leg]
        joints[[5 + first, 7 + first, 9 + first, 11 + first, 13 + first, 15 + first]] = np.array(chain) * flip
    _person(canvas, joints, skin=skin, hair=hair, shirt=shirt, trousers=trousers, is_long=is_long)
    return canvas.picture(), canvas.place(joints) / [width, height]


class _Canvas:
    """Drawing canvas in units of the height of the person: x from the middle, y up from the soles."""

    def __init__(self, size: tuple[int, int], *, foot: tuple[float, float], scale: float) -> None:
        self.size = size
        self._foot = np.array(foot) * size
        self._scale = scale
        self._large = np.zeros((size[1] * _FINER, size[0] * _FINER, 3), np.float32)

    def place(self, points: ArrayLike) -> Floats:
        """Return the pixels, from the corner of the picture, of points (..., 2)."""
        return self._foot + np.asarray(points, float) * [self._scale, -self._scale]

    def fill(self, color: ArrayLike) -> None:
        """Fill the canvas with one colour (3,), or one for each row (h, 3)."""
        color = np.asarray(color, np.float32)
        self._large[:] = color if color.ndim == 1 else np.repeat(color, _FINER, axis=0)[:, None]

    def shape(self, points: ArrayLike, color: ArrayLike) -> None:
        """Draw a filled polygon."""
        corners = self.place(points) * _FINER
        cv2.fillPoly(self._large, [_fixed(corners)], _ink(color), cv2.LINE_8, _SUBPIXEL_BITS)

    def disc(self, center: ArrayLike, radii: tuple[float, float], color: ArrayLike) -> None:
        """Draw a filled ellipse."""
        turn = 2 * np.pi * np.arange(48) / 48
        self.shape(np.asarray(center, float) + np.column_stack([np.cos(turn), np.sin(turn)]) * radii, color)

    def limb(self, path: ArrayLike, radii: ArrayLike, color: ArrayLike) -> None:
        """Draw a rounded limb along points (n, 2) with radii ``radii`` (n,)."""
        points, radii = np.asarray(path, float), np.asarray(radii, float)
        for (a, ra), (b, rb) in zip(
            zip(points, radii, strict=True), zip(points[1:], radii[1:], strict=True), strict=False
        ):
            across = np.array([a[1] - b[1], b[0] - a[0]]) / max(np.linalg.norm(b - a), 1e-9)
            self.shape([a + ra * across, b + rb * across, b - rb * across, a - ra * across], color)
        for point, radius in zip(points, radii, strict=True):
            self.disc(point, (radius, radius), color)

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture drawn so far, (h, w, 3) uint8."""
        small = cv2.resize(self._large, self.size, interpolation=cv2.INTER_AREA)
        return np.round(255 * np.clip(small, 0, 1)).astype(np.uint8)


def _fixed(points: Floats) -> NDArray[np.int32]:
    return np.round((points - 0.5) * 2**_SUBPIXEL_BITS).astype(np.int32)


def _ink(color: ArrayLike) -> list[float]:
    return np.asarray(color, float).tolist()


def _background(canvas: _Canvas, hue: float, sense: float) -> None:
    """Draw a coloured background that fades downwards, a large disc, and bars in place of a headline."""
    width, height = canvas.size
    top, foot = (np.array(colorsys.hsv_to_rgb(hue, *shade)) for shade in ((0.42, 0.86), (0.14, 0.95)))
    share = np.linspace(0, 1, height)[:, None]
    canvas.fill((1 - share) * top + share * foot)
    canvas.disc((0.13 * sense, 0.62), (0.30, 0.30), colorsys.hsv_to_rgb((hue + 0.08) % 1, 0.30, 0.93))
    canvas.disc((0.0, 0.012), (0.20, 0.022), 0.8 * foot)
    corner, line = canvas.place((0, 0)), 1 / np.linalg.norm(canvas.place((1, 0)) - canvas.place((0, 0)))
    for row, (length, thick) in enumerate(((0.62, 0.030), (0.44, 0.016))):
        x, y = 0.10 * width, (0.045 + 0.045 * row) * height
        box = np.array(
            [[x, y], [x + length * width, y], [x + length * width, y + thick * height], [x, y + thick * height]]
        )
        canvas.shape((box - corner) * [line, -line], (0.97, 0.97, 0.95))


def _person(
    canvas: _Canvas, joints: Floats, *, skin: Floats, hair: Floats, shirt: Floats, trousers: Floats, is_long: bool
) -> None:
    shade = 0.86
    if is_long:
        canvas.limb([(0, 0.93), (0, 0.80)], [0.062, 0.075], shade * hair)
    for side in (0, 1):
        hip, knee, ankle = joints[11 + side], joints[13 + side], joints[15 + side]
        out = 1.0 if side == 0 else -1.0
        canvas.limb([ankle + [0.012 * out, -0.028], ankle + [0.030 * out, -0.036]], [0.022, 0.017], (0.16, 0.16, 0.18))
        canvas.limb([hip, knee, ankle], [0.048, 0.041, 0.032], trousers if side == 0 else 0.92 * trousers)
    canvas.limb([(0, 0.80), (0, 0.87)], [0.028, 0.026], shade * skin)
    for side in (0, 1):
        shoulder, elbow, wrist = joints[5 + side], joints[7 + side], joints[9 + side]
        hand = wrist + 0.035 * (wrist - elbow) / np.linalg.norm(wrist - elbow)
        canvas.limb([elbow, wrist, hand], [0.025, 0.018, 0.023], skin)
        canvas.limb([shoulder, elbow], [0.038, 0.031], shade * shirt)
    trunk = [(0.0, 0.852), (0.085, 0.842), (0.128, 0.815), (0.112, 0.70), (0.088, 0.62), (0.112, 0.50)]
    canvas.shape([*trunk, *[(-x, y) for x, y in reversed(trunk)]], shirt)
    canvas.limb([(-0.068, 0.50), (0.068, 0.50)], [0.045, 0.045], shirt)
    canvas.disc((0, 0.852), (0.036, 0.024), skin)
    canvas.disc((0, 0.925), (0.047, 0.064), skin)
    for x in (-0.047, 0.047):
        canvas.disc((x, 0.920), (0.009, 0.015), shade * skin)
    cap = np.linspace(-0.12 * np.pi, 1.12 * np.pi, 32)
    crown = np.column_stack([0.053 * np.cos(cap), 0.945 + 0.050 * np.sin(cap)])
    fringe = [(-0.030, 0.962), (0.004, 0.968), (0.034, 0.955)]
    canvas.shape([*crown, *fringe], hair)
    for x in (-0.018, 0.018):
        canvas.disc((x, 0.930), (0.0065, 0.0045), (0.12, 0.10, 0.10))
        canvas.limb([(x - 0.010, 0.943), (x + 0.010, 0.944)], [0.0022, 0.0022], 0.8 * hair)
    canvas.limb([(0, 0.926), (0.004, 0.908)], [0.0022, 0.0030], shade * skin)
    smile = np.linspace(-1, 1, 7)
    canvas.limb(np.column_stack([0.016 * smile, 0.886 + 0.006 * smile**2]), np.full(7, 0.003), (0.66, 0.30, 0.28))
