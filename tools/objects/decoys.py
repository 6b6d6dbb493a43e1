"""Decoys, which a detector may take for people: posters, mirrors and coat stands, as they stand and as they hang."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.shapes import joined, lathe, loft
from tools.objects.builder import ObjectBuilder
from tools.objects.clutter import WOOD
from tools.objects.posters import draw_person

Place = tuple[float, float, float]

_RESOLUTION = 320  # pixels per metre of a poster
_ALUMINIUM = np.array([0.74, 0.75, 0.77])
_FRAMES = np.array([[0.20, 0.20, 0.22], [0.85, 0.84, 0.81], [0.62, 0.47, 0.33], [0.40, 0.30, 0.24]])
_GLASS = np.array([0.78, 0.84, 0.85])
_CLOTHS = np.array([[0.29, 0.31, 0.36], [0.62, 0.50, 0.36], [0.34, 0.40, 0.32], [0.46, 0.26, 0.26], [0.24, 0.32, 0.44]])
# Profile of a coat on a stand: height, half width, half depth; metres.
_COAT = np.array(
    [
        *((0.48, 0.265, 0.165), (0.70, 0.250, 0.155), (0.95, 0.225, 0.140), (1.15, 0.215, 0.130)),
        *((1.32, 0.222, 0.120), (1.43, 0.215, 0.095), (1.485, 0.150, 0.070), (1.50, 0.055, 0.050)),
    ]
)
_FOLDS = 7


def poster(f: ObjectBuilder, rng: np.random.Generator, *, on_wall: bool) -> None:
    """Draw a poster of a person, almost life-size: framed on a wall, or on a free-standing banner."""
    width, height = rng.uniform(0.72, 0.85), rng.uniform(1.75, 1.95)
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    f.picture, joints = draw_person(rng, (round(width * _RESOLUTION), round(height * _RESOLUTION)), tall=0.82)
    low, front = 0.12 if on_wall else 0.09, 0.024
    middle = (front - 0.006, 0.0, low + height / 2)
    f.box(middle, (0.012, width, height), (1.0, 1.0, 1.0))
    f.front_print("picture", front + 0.0005, 0.0, middle[2], (width, height))
    if on_wall:
        f.origin = (0.0, 0.0, 0.0)
        _rim(f, middle, (width, height), 0.028, frame)
    else:
        f.box((0.0, 0.0, 0.045), (0.20, width + 0.02, 0.09), _ALUMINIUM)
        f.box((0.0, 0.0, low + height / 2), (0.024, 0.024, height), 0.85 * _ALUMINIUM)
    f.figure = np.column_stack([np.full(17, front), (joints[:, 0] - 0.5) * width, low + (1 - joints[:, 1]) * height])


def _rim(f: ObjectBuilder, middle: Place, size: tuple[float, float], rim: float, color: Floats) -> None:
    """Add four bars around a sheet of width and height ``size`` that faces +x, slightly thicker than the sheet."""
    (x, y, z), (wide, tall) = middle, size
    for side in (-0.5, 0.5):
        f.box((x, y + side * (wide + rim), z), (0.036, rim, tall + 2 * rim), color)
        f.box((x, y, z + side * (tall + rim)), (0.036, wide, rim), color)


def mirror(f: ObjectBuilder, rng: np.random.Generator, *, on_wall: bool) -> None:
    """Draw a framed mirror as tall as a person: on a wall, or on two feet."""
    width, height = rng.uniform(0.65, 1.0), rng.uniform(1.55, 1.8)
    frame = _FRAMES[rng.integers(len(_FRAMES))]
    low, rim = 0.14, 0.05
    middle = (0.020, 0.0, low + height / 2)
    f.box(middle, (0.012, width, height), _GLASS, "mirror")
    _rim(f, middle, (width, height), rim, frame)
    if on_wall:
        f.origin = (0.0, 0.0, 0.0)
        return
    for side in (-1.0, 1.0):
        y = side * (width / 2 + rim / 2)
        f.box((0.02, y, 0.02), (0.46, 0.05, 0.04), frame)
        f.box((0.02, y, 0.065), (0.05, 0.05, 0.05), frame)


def coat_stand(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a coat stand as tall as a person: a pole on a round foot with a coat and a hat."""
    tall, wide = rng.uniform(0.94, 1.10), rng.uniform(0.92, 1.08)
    cloth, wood = _CLOTHS[rng.integers(len(_CLOTHS))], WOOD[rng.integers(len(WOOD))]
    felt, phase = 0.75 * _CLOTHS[rng.integers(len(_CLOTHS))], rng.uniform(0, 2 * np.pi)
    f.bar((0, 0, 0), (0, 0, 0.03), 0.20, 0.9 * wood)
    f.bar((0, 0, 0.03), (0, 0, 1.72 * tall), 0.02, wood)
    shape = _COAT * [tall, wide, wide]
    f.part(joined(_coat(shape, cloth, phase), *(_sleeve(shape, side, cloth) for side in (-1.0, 1.0))))
    crown = 1.60 * tall
    brim = [(0.0, 0.0), (0.165, 0.0), (0.170, 0.012), (0.098, 0.022)]
    hat = np.array([*brim, (0.095, 0.06), (0.092, 0.105), (0.078, 0.130), (0.04, 0.128), (0.0, 0.118)])
    bands = np.array([felt, felt, felt, 0.4 * felt, felt, felt, felt, felt])
    f.part(lathe(hat, bands, sides=20, squash=1.1), center=(0, 0, crown))
    f.figure = _coat_figure(shape, crown, tall)


def _coat(shape: Floats, cloth: Floats, phase: float) -> Mesh:
    """Return the body of a coat, closed below, with folds that deepen downwards."""
    sides = 36
    turn = 2 * np.pi * np.arange(sides) / sides
    depth = np.linspace(1, 0, len(shape))[:, None] ** 1.5
    fold = 1 + 0.055 * depth * np.sin(_FOLDS * turn + phase)
    rounded = np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** 0.8, np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** 0.8
    rings = np.stack(
        [shape[:, 2:] * fold * rounded[1], shape[:, 1:2] * fold * rounded[0], np.tile(shape[:, :1], (1, sides))], axis=2
    )
    hem, collar = rings[:1] * [0.0, 0.0, 1.0], rings[-1:] * [0.0, 0.0, 1.0]
    colors = np.tile(cloth, (len(rings) + 1, sides, 1))
    colors[1:-1, 0] *= 0.72  # edge of the front flap
    return loft(np.concatenate([hem, rings, collar]), colors, edges=(1,))


def _sleeve(shape: Floats, side: float, cloth: Floats) -> Mesh:
    """Return an empty sleeve that hangs from a shoulder."""
    top, wide = shape[5, 0], shape[5, 1]
    path = np.array(
        [[0.0, 0.80, 0.01], [0.0, 0.98, -0.04], [0.01, 1.13, -0.20], [0.02, 1.20, -0.42], [0.02, 1.22, -0.60]]
    )
    centers = path * [1.0, side * wide, 1.0] + [0.0, 0.0, top]
    radii = np.array([[0.045, 0.03], [0.075, 0.055], [0.070, 0.055], [0.062, 0.050], [0.060, 0.048]])
    turn = 2 * np.pi * np.arange(14) / 14
    rings = (
        np.stack([radii[:, :1] * np.cos(turn), radii[:, 1:] * np.sin(turn), np.zeros((len(radii), 14))], axis=2)
        + centers[:, None]
    )
    ends = centers[[0]][:, None].repeat(14, axis=1), centers[[-1]][:, None].repeat(14, axis=1)
    return loft(np.concatenate([ends[1], rings[::-1], ends[0]]), 0.93 * cloth, edges=(1,))


def _coat_figure(shape: Floats, crown: float, tall: float) -> Floats:
    """Return the COCO-17 joints of the apparent person, (17, 3)."""
    shoulder, wide = shape[5, 0], 0.8 * shape[5, 1]
    face = [
        (0.09, 0.0, -0.05),
        *((0.08, side * 0.032, -0.02) for side in (1, -1)),
        *((0.0, side * 0.075, -0.03) for side in (1, -1)),
    ]
    head = [(x, y, crown + z) for x, y, z in face]
    rows = [
        (0.0, wide, shoulder),
        (0.02, 1.25 * wide, shoulder - 0.28 * tall),
        (0.03, 1.35 * wide, shoulder - 0.55 * tall),
        (0.0, 0.55 * wide, 0.90 * tall),
        (0.02, 0.50 * wide, 0.50 * tall),
        (0.0, 0.45 * wide, 0.08 * tall),
    ]
    return np.array([*head, *((x, s * y, z) for x, y, z in rows for s in (1, -1))])
