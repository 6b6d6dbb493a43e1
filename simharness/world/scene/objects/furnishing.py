"""Assembly of textured furniture: parts of materials and prints from one sheet, joined to one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.geoms import Box, Cylinder, carried
from simharness.world.scene.objects.materials import Material, Sheet
from simharness.world.scene.objects.shapes import bar_mesh, box_mesh, joined, lathe, loft, quad_mesh, shifted, surface
from simharness.world.scene.objects.solids import ObjectModel

_GOLDEN = (5**0.5 - 1) / 2
_CORNERS = (
    np.linspace(0, np.pi / 2, 3),
    np.linspace(0, np.pi / 2, 4),
)  # directions of a small and a large round corner
_PAINTED = 0.74  # albedo from which wood counts as painted
_SMALL = 0.04  # metres: radius of a small round corner


class Furnishing:
    """Builder of a textured object model, which stands on z = 0 with its front towards +x and its back at -x.

    Attributes:
        sheet: materials and prints.
    """

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self._meshes: list[Mesh] = []
        self._uv: list[NDArray[np.float32]] = []

    def box(
        self,
        center: Sequence[float],
        size: Sequence[float],
        color: ArrayLike,
        material: Material = "plain",
        *,
        yaw: float = 0.0,
    ) -> Self:
        """Add a box of ``size`` x, y, z in metres; ``yaw`` turns it about its own vertical axis."""
        dx, dy, dz = (float(v) / 2 for v in size)
        mesh = box_mesh([Box((0.0, 0.0, 0.0), (dx, dy, dz))], np.asarray(color, float)[None])
        return self.part(mesh, material, center=center, yaw=yaw)

    def block(
        self, low: Sequence[float], high: Sequence[float], color: ArrayLike, material: Material = "plain"
    ) -> Self:
        """Add a box from its lowest to its highest corner, metres."""
        a, b = np.asarray(low, float), np.asarray(high, float)
        return self.box(((a + b) / 2).tolist(), (b - a).tolist(), color, material)

    def bar(
        self,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        color: ArrayLike,
        material: Material = "plain",
        *,
        sides: int = 8,
    ) -> Self:
        """Add a round bar from one point to another, metres."""
        a, b = np.asarray(start, float), np.asarray(end, float)
        length = float(np.linalg.norm(b - a))
        x, y, z = ((a + b) / 2).tolist()
        i, j, k = ((b - a) / length).tolist()
        return self.part(bar_mesh(Cylinder((x, y, z), radius, length / 2, (i, j, k)), color, sides=sides), material)

    def turned(
        self,
        profile: ArrayLike,
        color: ArrayLike,
        material: Material = "plain",
        *,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        sides: int = 14,
        squash: float = 1.0,
    ) -> Self:
        """Add a body of revolution: see :func:`simharness.world.scene.objects.shapes.lathe`."""
        return self.part(lathe(profile, color, sides=sides, squash=squash), material, center=at)

    def cushion(
        self,
        center: Sequence[float],
        size: Sequence[float],
        color: ArrayLike,
        material: Material = "fabric",
        *,
        radius: float = 0.05,
        yaw: float = 0.0,
        tilt: float = 0.0,
    ) -> Self:
        """Add a box with round edges, such as a cushion; ``tilt`` leans it backwards about its y axis, radians."""
        mesh = _rounded(np.asarray(size, float), min(radius, 0.49 * min(size)), color)
        c, s = np.cos(tilt), np.sin(tilt)
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        return self.part(mesh, material, center=center, yaw=yaw, turn=turn)

    def print(self, name: str, corners: ArrayLike, *, tint: float = 1.0) -> Self:
        """Add a print on a flat sheet with corners (4, 3): lower left, lower right, upper right, upper left."""
        mesh = quad_mesh(np.asarray(corners, float), np.array([[0, 1, 2, 3]]), np.full((1, 3), tint))
        place = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], float).reshape(2, 3, 2)
        self._meshes.append(mesh)
        self._uv.append(self.sheet.uv(name, place))
        return self

    def front_print(self, name: str, x: float, y: float, z: float, size: tuple[float, float]) -> Self:
        """Add a print of width and height ``size`` around (x, y, z) that faces +x."""
        w, h = size[0] / 2, size[1] / 2
        return self.print(name, [(x, y - w, z - h), (x, y + w, z - h), (x, y + w, z + h), (x, y - w, z + h)])

    def round_print(self, name: str, center: Sequence[float], radius: float) -> Self:
        """Add a round print around a centre that faces +x."""
        turn = 2 * np.pi * np.arange(28) / 28
        rim = np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.column_stack([np.zeros(28), radius * rim]) + np.asarray(center, float)
        fan = np.column_stack([np.zeros(26, int), np.arange(1, 27), np.arange(2, 28)]).astype(np.int32)
        self._meshes.append(Mesh(points.astype(np.float32), fan, np.ones((26, 3), np.float32)))
        self._uv.append(self.sheet.uv(name, (0.5 + 0.5 * rim * [1, -1])[fan]))
        return self

    def part(
        self,
        mesh: Mesh,
        material: Material = "plain",
        *,
        center: Sequence[float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        turn: Floats | None = None,
    ) -> Self:
        """Add a mesh of one material, turned by a matrix (3, 3) and a yaw, then moved to ``center``.

        The material is projected along the main axes of the unturned mesh, with the grain along its longest extent.
        Wood that is painted white shows no grain.
        """
        if material == "wood" and len(mesh.colors) and mesh.colors.min() > _PAINTED:
            material = "plain"
        self._uv.append(self._projected(mesh, material))
        x, y, z = (float(v) for v in center)
        vertices = mesh.vertices.astype(float) if turn is None else mesh.vertices @ turn.T
        vertices = carried(vertices, (x, y), yaw) + [0.0, 0.0, z]
        self._meshes.append(replace(mesh, vertices=vertices.astype(np.float32)))
        return self

    def group(self, other: Furnishing, place: Sequence[float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> Self:
        """Add all parts of another furnishing, turned by ``yaw`` and moved to ``place``."""
        for mesh, uv in zip(other._meshes, other._uv, strict=True):
            vertices = carried(mesh.vertices, place[:2], yaw) + [0.0, 0.0, place[2]]
            self._meshes.append(replace(mesh, vertices=vertices.astype(np.float32)))
            self._uv.append(uv)
        return self

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self._meshes)

    def mesh(self) -> Mesh:
        """Return the mesh of all parts."""
        return replace(joined(*self._meshes), texture=self.sheet.texture, uv=np.concatenate(self._uv))

    def model(self) -> ObjectModel:
        """Return the object model of all parts, centred on the origin; one geom has exactly its triangles."""
        mesh = self.mesh()
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        mesh = shifted(mesh, (*(-(low + high) / 2)[:2], 0.0))
        vertices = mesh.vertices.copy()
        vertices[:, 2] = np.maximum(vertices[:, 2], 0.0)  # what would sink into the floor lies flat on it
        mesh = replace(mesh, vertices=vertices)
        return ObjectModel(mesh, (surface(mesh),))

    def _projected(self, mesh: Mesh, material: Material) -> NDArray[np.float32]:
        """Return the texture coordinates of a material on a mesh, (k, 3, 2)."""
        corners = mesh.vertices[mesh.faces].astype(float)
        low = mesh.vertices.min(axis=0)
        extent = mesh.vertices.max(axis=0) - low
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        main = np.abs(normal).argmax(axis=1)
        across = np.array([[b, c] if extent[b] >= extent[c] else [c, b] for b, c in ((1, 2), (0, 2), (0, 1))])[main]
        place = np.take_along_axis(corners - low, np.repeat(across[:, None], 3, axis=1), axis=2)
        patch = self.sheet.extent(material)
        scale = np.minimum(1.0, 0.98 * patch / np.maximum(extent[across], 1e-6))
        place = place * scale[:, None] / patch
        number = len(self._meshes)
        spare = 1.0 - place.reshape(-1, 2).max(axis=0)
        start = spare * [(number * _GOLDEN) % 1.0, (number * _GOLDEN**2) % 1.0]
        return self.sheet.uv(material, place + start)


def _rounded(size: Floats, radius: float, color: ArrayLike) -> Mesh:
    """Return a box around the origin with round edges."""
    half = size / 2
    inner = half - radius
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    corner = _CORNERS[int(radius > _SMALL)]
    turns = np.concatenate([k * np.pi / 2 + corner for k in range(4)])
    outline = np.repeat(corners, len(corner), axis=0) * inner[:2]
    round_ = np.column_stack([np.cos(turns), np.sin(turns)])
    rings = []
    for sense in (-1.0, 1.0):
        for angle in corner if sense > 0 else -corner[::-1]:
            ring = outline + radius * np.cos(angle) * round_
            rings.append(np.column_stack([ring, np.full(len(ring), sense * inner[2] + radius * np.sin(angle))]))
    tip = np.zeros((len(outline), 3))
    ends = tip - [0, 0, half[2]], tip + [0, 0, half[2]]
    return loft(np.stack([ends[0], *rings, ends[1]]), np.asarray(color, float))
