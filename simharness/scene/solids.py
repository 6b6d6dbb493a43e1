"""Static things: boxes in the world, and the solids that are built from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.rendering.mesh import Mesh

Floats = NDArray[np.float64]

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
# Corners of each side in the order of _SIGNS, counter-clockwise from outside: -x, +x, -y, +y, -z, +z.
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
TOP = 5  # of a box's sides


@dataclass(frozen=True)
class Box:
    """A cuboid that stands upright, turned about the vertical.

    Attributes:
        center: metres, (3,).
        half: half its sides along its own axes, metres, (3,).
        yaw: its turn about z, radians.
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw: float = 0.0

    @cached_property
    def axes(self) -> Floats:
        """Its own axes as columns, (3, 3)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def corners(self) -> Floats:
        """The eight corners, (8, 3) metres."""
        return np.array(self.center) + (_SIGNS * self.half) @ self.axes.T

    def distance(self, points: ArrayLike) -> Floats:
        """Distance of points (..., 3) to the box, (...) metres; 0 inside."""
        return np.linalg.norm(self._outside(points), axis=-1)

    def distance_on_floor(self, points: ArrayLike) -> Floats:
        """Horizontal distance of points (..., 3) to the box's ground plan, (...) metres; 0 over it."""
        return np.linalg.norm(self._outside(points)[..., :2], axis=-1)

    def _outside(self, points: ArrayLike) -> Floats:
        local = (np.asarray(points, float) - self.center) @ self.axes
        return np.maximum(np.abs(local) - self.half, 0.0)

    def gap_on_floor(self, other: Box) -> float:
        """Horizontal distance between two boxes' ground plans by separating axes, metres; 0 where they overlap.

        Corner to corner the true distance is larger; never smaller.
        """
        best = 0.0
        for axis in (*self.axes.T[:2], *other.axes.T[:2]):
            mine, theirs = self.corners @ axis, other.corners @ axis
            best = max(best, mine.min() - theirs.max(), theirs.min() - mine.max())
        return best

    def moved(self, place: ArrayLike, yaw: float) -> Box:
        """The box turned about the world's z axis and then carried to ``place`` (2,) on the floor."""
        c, s = np.cos(yaw), np.sin(yaw)
        x, y, z = self.center
        dx, dy = np.asarray(place, float)
        return Box((float(c * x - s * y + dx), float(s * x + c * y + dy), z), self.half, self.yaw + yaw)


@dataclass(frozen=True)
class Solid:
    """A static thing in the room.

    Attributes:
        kind: "room" (floor, walls) or "clutter".
        name: what messages and the MuJoCo model call it.
        mesh: how it looks.
        boxes: what it is made of; geoms of the MuJoCo model.
        hull: a box around all of it; for a shelf the space between the boards is inside.
    """

    kind: Literal["room", "clutter"]
    name: str
    mesh: Mesh
    boxes: tuple[Box, ...]
    hull: Box


def box_mesh(boxes: Sequence[Box], colors: ArrayLike) -> Mesh:
    """Boxes as one mesh of flat faces, counter-clockwise from outside.

    Args:
        boxes: n boxes.
        colors: albedo 0..1 of each box (n, 3) or of each of its sides -x, +x, -y, +y, -z, +z (n, 6, 3).
    """
    colors = np.asarray(colors, float)
    if colors.ndim == 2:
        colors = np.repeat(colors[:, None], 6, axis=1)
    vertices = np.concatenate([box.corners for box in boxes])
    quads = (8 * np.arange(len(boxes))[:, None, None] + _QUADS).reshape(-1, 4)
    return quad_mesh(vertices, quads, colors.reshape(-1, 3))


def quad_mesh(vertices: Floats, quads: NDArray[np.int_], colors: Floats) -> Mesh:
    """Quadrilaterals (k, 4), counter-clockwise from outside, each with a colour (k, 3), as triangles."""
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return Mesh(
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        colors=np.repeat(np.clip(colors, 0, 1), 2, axis=0).astype(np.float32),
        smooth=False,
    )
