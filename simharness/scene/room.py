"""The room: a tiled floor and four walls, open above.

The floor's faces look up and the walls' faces look into the room: counter-clockwise as seen from inside, which is
the outside of the wall as a thing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simharness.rendering.mesh import Mesh
from simharness.scene.solids import Box, Solid, quad_mesh

Floats = NDArray[np.float64]

_TILE = 0.5  # metres, about
_PANEL = 1.0  # metres, about: walls are cut into panels, for light falls off from vertex to vertex
_THICK = 0.1  # metres: of the floor and the walls as solids, away from the room
_SKIRTING = 0.1  # metres
_LIGHT_TILE, _DARK_TILE = (0.86, 0.84, 0.80), (0.74, 0.73, 0.70)
_SKIRTING_COLOR = (0.55, 0.53, 0.51)
# Facing walls share a tone, so that the corners read and a picture tells where one looks.
_WALLS = {"wall -x": (0.88, 0.92, 0.94), "wall +x": (0.88, 0.92, 0.94), "wall -y": (0.95, 0.93, 0.88)}
_WALLS |= {"wall +y": (0.95, 0.93, 0.88)}


def make_room(size: tuple[float, float, float]) -> tuple[Solid, ...]:
    """Floor and walls of a room of ``size`` x, y, z metres around the origin, its floor at z = 0."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    slab = Box((0.0, 0.0, -_THICK / 2), (x, y, _THICK / 2))
    floor = Solid("room", "floor", _floor(x, y), (slab,), slab)
    # Each wall from its left corner to its right corner as seen from inside.
    runs = {
        "wall +x": ((x, y), (x, -y)),
        "wall -x": ((-x, -y), (-x, y)),
        "wall +y": ((-x, y), (x, y)),
        "wall -y": ((x, -y), (-x, -y)),
    }
    walls = []
    for name, (left, right) in runs.items():
        start, end = np.array(left), np.array(right)
        length = np.linalg.norm(end - start)
        along = (end - start) / length
        out = np.array([-along[1], along[0]])
        middle = (start + end) / 2 + out * _THICK / 2
        block = Box(
            (float(middle[0]), float(middle[1]), z / 2),
            (float(length / 2 + _THICK), _THICK / 2, z / 2),
            float(np.arctan2(along[1], along[0])),
        )
        heights = np.concatenate([[0.0], np.linspace(min(_SKIRTING, z / 2), z, max(2, round(z / _PANEL) + 1))])
        columns = np.linspace(0.0, length, max(2, round(length / _PANEL) + 1))
        walls.append(Solid("room", name, _wall(start, along, columns, heights, _WALLS[name]), (block,), block))
    return (floor, *walls)


def _floor(x: float, y: float) -> Mesh:
    columns = np.linspace(-x, x, max(1, round(2 * x / _TILE)) + 1)
    rows = np.linspace(-y, y, max(1, round(2 * y / _TILE)) + 1)
    i, j = np.meshgrid(np.arange(len(columns) - 1), np.arange(len(rows) - 1), indexing="ij")
    dark = ((i + j) % 2 == 1)[..., None]
    grain = 1.0 + 0.02 * np.sin(12.9898 * i + 78.233 * j)[..., None]  # no two tiles are quite alike
    colors = np.where(dark, _DARK_TILE, _LIGHT_TILE) * grain
    grid = np.stack([*np.meshgrid(columns, rows, indexing="ij"), np.zeros((len(columns), len(rows)))], axis=-1)
    return quad_mesh(grid.reshape(-1, 3), _grid_quads(len(columns), len(rows)), colors.reshape(-1, 3))


def _wall(start: Floats, along: Floats, columns: Floats, heights: Floats, color: tuple[float, float, float]) -> Mesh:
    grid = np.empty((len(columns), len(heights), 3))
    grid[..., :2] = (start + columns[:, None] * along)[:, None]
    grid[..., 2] = heights
    colors = np.broadcast_to(np.array(color), (len(columns) - 1, len(heights) - 1, 3)).copy()
    colors[:, 0] = _SKIRTING_COLOR
    return quad_mesh(grid.reshape(-1, 3), _grid_quads(len(columns), len(heights)), colors.reshape(-1, 3))


def _grid_quads(columns: int, rows: int) -> NDArray[np.int_]:
    """Cells of a grid of vertices in column-major order: right, then up, is counter-clockwise."""
    i, j = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1), indexing="ij")
    corner = (i * rows + j).ravel()
    return np.stack([corner, corner + rows, corner + rows + 1, corner + 1], axis=-1)
