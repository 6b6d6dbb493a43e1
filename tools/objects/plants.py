"""Potted plants of three kinds: broad leaves on stems, arching fronds, upright blades."""

import numpy as np

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.shapes import joined, lathe, quad_mesh
from tools.objects.builder import ObjectBuilder

_POTS = np.array([[0.72, 0.42, 0.30], [0.90, 0.89, 0.86], [0.28, 0.30, 0.33], [0.52, 0.60, 0.62], [0.80, 0.70, 0.56]])
_SOIL = np.array([0.24, 0.18, 0.14])
_STEM = np.array([0.42, 0.40, 0.24])
_GREENS = np.array([[0.22, 0.44, 0.22], [0.30, 0.50, 0.26], [0.18, 0.38, 0.27], [0.40, 0.54, 0.28]])
_GOLDEN = np.pi * (3 - 5**0.5)  # golden angle between successive leaves around a stem


def plant(f: ObjectBuilder, rng: np.random.Generator) -> None:
    """Draw a potted plant 1 to 1.8 m tall."""
    kind = rng.integers(3)
    pot = rng.uniform(0.15, 0.20), rng.uniform(0.28, 0.40)
    color, green = _POTS[rng.integers(len(_POTS))], _GREENS[rng.integers(len(_GREENS))]
    grow = (_broad_leaves, _fronds, _blades)[kind]
    f.part(joined(_pot(*pot, color), grow(rng, pot[1] - 0.03, green)))


def _pot(radius: float, height: float, color: Floats) -> Mesh:
    rim = height - 0.04
    profile = [
        *((0.0, 0.0), (0.72 * radius, 0.0), (0.97 * radius, rim), (1.06 * radius, rim), (1.06 * radius, height)),
        *((0.96 * radius, height), (0.94 * radius, height - 0.03), (0.0, height - 0.02)),
    ]
    colors = np.array([color, color, 0.9 * color, color, color, 0.8 * color, _SOIL])
    return lathe(profile, colors, sides=20)


def _broad_leaves(rng: np.random.Generator, ground: float, green: Floats) -> Mesh:
    """Draw leaves as large as hands around a few stems, as of a rubber plant."""
    parts = []
    lean, tall = rng.uniform(0.08, 0.22, 3), rng.uniform(0.75, 1.3, 3)
    shade = rng.uniform(0.82, 1.18, (3, 16))
    wild = rng.uniform(-1, 1, (3, 16, 3))
    for k, bearing in enumerate(rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(3) / 3):
        tip = np.array([lean[k] * np.cos(bearing), lean[k] * np.sin(bearing), ground + tall[k]])
        foot = np.array([0.03 * np.cos(bearing), 0.03 * np.sin(bearing), ground])
        parts.append(_strip(np.linspace(foot, tip, 4), np.full(4, 0.012), _STEM, facing=bearing))
        parts.append(_strip(np.linspace(foot, tip, 4), np.full(4, 0.012), _STEM, facing=bearing + np.pi / 2))
        for n in range(16):
            along = 0.18 + 0.82 * n / 15
            around = bearing + n * _GOLDEN + 0.3 * wild[k, n, 0]
            length = 0.36 - 0.12 * along + 0.03 * wild[k, n, 1]
            rise = 0.35 + 0.5 * along + 0.2 * wild[k, n, 2]
            parts.append(_leaf(foot + along * (tip - foot), around, length, 0.46 * length, rise, shade[k, n] * green))
    return joined(*parts)


def _leaf(base: Floats, bearing: float, length: float, width: float, rise: float, color: Floats) -> Mesh:
    """Return one oval leaf that starts at an elevation of ``rise`` radians and bends down."""
    t = np.linspace(0, 1, 6)
    pitch = rise - 1.3 * t
    step = length / 5 * np.stack([np.cos(pitch), np.sin(pitch)], axis=1)
    out = np.concatenate([np.zeros((1, 2)), np.cumsum(step[:-1], axis=0)])
    spine = base + np.column_stack([out[:, 0] * np.cos(bearing), out[:, 0] * np.sin(bearing), out[:, 1]])
    half = np.concatenate([[0.006], width / 2 * np.sin(np.pi * (0.06 + 0.94 * t[1:] ** 0.85))])
    return _strip(spine, half, color, facing=bearing, fold=0.35)


def _fronds(rng: np.random.Generator, ground: float, green: Floats) -> Mesh:
    """Draw long arching fronds with leaflets on both sides, as of a parlour palm."""
    parts = []
    count = 11
    reach, tall, jitter = rng.uniform(0.28, 0.5, count), rng.uniform(0.7, 1.25, count), rng.uniform(-0.3, 0.3, count)
    shade = rng.uniform(0.85, 1.15, count)
    for k in range(count):
        bearing = k * _GOLDEN + jitter[k]
        t = np.linspace(0, 1, 9)
        out, up = reach[k] * t**1.5, tall[k] * (1.35 * t - 0.5 * t**3)
        spine = np.column_stack([out * np.cos(bearing), out * np.sin(bearing), ground + up])
        parts.append(_strip(spine, np.full(9, 0.006), 0.9 * shade[k] * green, facing=bearing))
        side = np.array([-np.sin(bearing), np.cos(bearing), 0.0])
        for n in range(2, 9):
            ahead = spine[n] - spine[n - 1]
            ahead /= np.linalg.norm(ahead)
            length = 0.30 * np.sin(np.pi * (0.12 + 0.80 * n / 8)) + 0.03
            for sense in (-1.0, 1.0):
                way = 0.75 * sense * side + 0.65 * ahead
                blade = spine[n] + np.linspace(0, length, 4)[:, None] * way
                blade[:, 2] -= 0.35 * np.linspace(0, length, 4) ** 2 / max(length, 1e-6)
                heading = float(np.arctan2(way[1], way[0]))
                width = np.array([0.007, 0.022, 0.016, 0.001])
                parts.append(_strip(blade, width, shade[k] * green, facing=heading))
    return joined(*parts)


def _blades(rng: np.random.Generator, ground: float, green: Floats) -> Mesh:
    """Draw stiff upright blades with pale edges, as of a snake plant."""
    parts = []
    count = 15
    tall, lean, at = rng.uniform(0.65, 1.15, count), rng.uniform(0.03, 0.3, count), rng.uniform(0.01, 0.10, count)
    shade, turn = rng.uniform(0.85, 1.1, count), rng.uniform(-0.5, 0.5, count)
    for k in range(count):
        bearing = k * _GOLDEN
        t = np.linspace(0, 1, 7)
        out = at[k] + lean[k] * tall[k] * t**1.5
        spine = np.column_stack([out * np.cos(bearing), out * np.sin(bearing), ground + tall[k] * t])
        half = 0.05 * np.sin(np.pi * (0.30 + 0.68 * t))
        parts.append(_strip(spine, 1.18 * half, [0.74, 0.74, 0.44], facing=bearing + turn[k], offset=-0.002))
        parts.append(_strip(spine, 0.9 * half, shade[k] * green, facing=bearing + turn[k], offset=0.002))
    return joined(*parts)


def _strip(
    spine: Floats, half: Floats, color: Floats | list[float], *, facing: float, fold: float = 0.0, offset: float = 0.0
) -> Mesh:
    """Return a ribbon along a curve, horizontal across the curve, visible from both sides.

    Args:
        spine: points of the curve from root to tip, (m, 3), metres.
        half: half widths, (m,), metres.
        color: albedo, (3,).
        facing: bearing of the normal of the ribbon, radians.
        fold: rise of the edges over the spine, as a share of their distance from it.
        offset: shift of the ribbon from the curve in the direction of ``facing``, metres.
    """
    across = np.array([-np.sin(facing), np.cos(facing), 0.0])
    spine = spine + offset * np.array([np.cos(facing), np.sin(facing), 0.0])
    lift = fold * half[:, None] * np.array([0.0, 0.0, 1.0])
    left, right = spine + half[:, None] * across + lift, spine - half[:, None] * across + lift
    m = len(spine)
    k = np.arange(m - 1)
    if fold:
        vertices = np.concatenate([left, spine, right])
        quads = np.concatenate([np.column_stack([k + a, k + 1 + a, k + 1 + b, k + b]) for a, b in ((m, 0), (2 * m, m))])
    else:
        vertices = np.concatenate([left, right])
        quads = np.column_stack([k + m, k + m + 1, k + 1, k])
    return quad_mesh(vertices, quads, np.broadcast_to(np.asarray(color, float), (len(quads), 3)))
