"""Foliage: round or clipped crowns with leaves that stand out, and whole trees."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.shapes import loft
from tools.objects.builder import ObjectBuilder

GREENS = np.array([[0.30, 0.44, 0.20], [0.24, 0.38, 0.18], [0.38, 0.48, 0.22], [0.28, 0.42, 0.26]])
"""Albedo of leaves, sRGB; the material "leaves" is darker, so crowns take them times 1.7."""
_BARK = np.array([0.34, 0.27, 0.21])


def leaf_color(rng: np.random.Generator) -> Floats:
    """Draw the colour of a crown of the material "leaves"."""
    return np.minimum(1.7 * GREENS[rng.integers(len(GREENS))], 1.0)


def crown(
    rng: np.random.Generator,
    half: tuple[float, float, float],
    color: Floats,
    *,
    box: float = 2.0,
    bumps: float = 0.12,
    rows: int = 9,
    sides: int = 16,
) -> Mesh:
    """Return the body of a crown: a superellipsoid with bumps.

    Args:
        rng: random generator.
        half: half its extents x, y, z, metres.
        color: albedo.
        box: exponent; 2 for an ellipsoid, 5 for a clipped hedge.
        bumps: height of its bumps, as a share of its extents.
        rows: points from the bottom to the top.
        sides: points around.
    """
    up, turn = np.linspace(-np.pi / 2, np.pi / 2, rows), 2 * np.pi * np.arange(sides) / sides
    c, s = np.cos(turn), np.sin(turn)
    round_ = np.column_stack([np.sign(c) * np.abs(c) ** (2 / box), np.sign(s) * np.abs(s) ** (2 / box)])
    ring = np.maximum(np.cos(up), 0.0) ** (2 / box)
    ring[[0, -1]] = 0.0
    bumpy = 1 + rng.uniform(-bumps, bumps, (rows, sides))
    heights = np.sign(np.sin(up)) * np.abs(np.sin(up)) ** (2 / box)
    flat = ring[:, None, None] * bumpy[..., None] * round_ * half[:2]
    rings = np.concatenate([flat, np.broadcast_to((heights * half[2])[:, None, None], (rows, sides, 1))], axis=2)
    return loft(rings, color)


def sprays(
    rng: np.random.Generator, half: tuple[float, float, float], color: Floats, count: int, size: float, box: float = 2.0
) -> Mesh:
    """Return leaves that stand out of a crown: triangles of about ``size`` metres across its surface.

    The other arguments are those of :func:`crown`.
    """
    ways = rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    reach = (np.abs(ways) ** box).sum(axis=1, keepdims=True) ** (-1 / box)
    places = ways * reach * half * rng.uniform(0.94, 1.06, (count, 1))
    corners = places[:, None] + size * rng.normal(0, 0.62, (count, 3, 3))
    shade = rng.uniform(0.75, 1.1, (count, 1))
    return Mesh(
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        np.clip(shade * color, 0, 1).astype(np.float32),
        smooth=True,
    )


def put_tree(
    f: ObjectBuilder,
    rng: np.random.Generator,
    tall: float,
    *,
    at: tuple[float, float] = (0.0, 0.0),
    leaves: int = 60,
    rows: int = 7,
    sides: int = 10,
) -> None:
    """Add a tree of a height in metres: a trunk with boughs, and a crown of clumps.

    Args:
        f: furnishing to add to.
        rng: random generator.
        tall: height, metres.
        at: place of the foot, x and y, metres.
        leaves: leaves that stand out of each clump.
        rows: detail of a clump: see :func:`crown`.
        sides: see ``rows``.
    """
    color, foot = leaf_color(rng), np.array([*at, 0.0])
    reach, clear = tall * rng.uniform(0.22, 0.30), tall * rng.uniform(0.24, 0.34)
    thick = 0.022 * tall
    profile = [(0, 0), (1.5 * thick, 0), (thick, 0.3), (0.7 * thick, 0.6 * tall), (0, 0.6 * tall)]
    f.turned(profile, _BARK, "wood", at=foot.tolist(), sides=8)
    middle = foot + [0.0, 0.0, (clear + tall) / 2]
    high = (tall - clear) / 2
    clumps = [(middle, 0.72)]
    for k in range(6):
        turn, up = rng.uniform(0, 0.6) + k * np.pi * (3 - 5**0.5), -0.55 + 1.1 * k / 5 + rng.uniform(-0.1, 0.1)
        out = 0.55 * np.sqrt(max(1 - up * up, 0.1)) * reach
        clumps.append((middle + [out * np.cos(turn), out * np.sin(turn), 0.75 * up * high], rng.uniform(0.42, 0.58)))
    for k, (place, share) in enumerate(clumps):
        half = (share * reach, share * reach, 0.9 * share * high)
        shade = color * rng.uniform(0.82, 1.0)
        f.part(crown(rng, half, shade, bumps=0.22, rows=rows, sides=sides), "leaves", center=place.tolist())
        f.part(sprays(rng, half, shade, leaves, 0.20 * reach**0.6), "leaves", center=place.tolist())
        if 0 < k < 5:
            f.bar((*at, clear + 0.1 * k), place.tolist(), 0.35 * thick, _BARK, "wood", sides=5)
