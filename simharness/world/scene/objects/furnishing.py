"""Assembly of textured fittings and lamps: parts of materials and prints from one sheet, joined to one mesh."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.types.mesh import Mesh
from simharness.world.scene.objects.geoms import Box, carried
from simharness.world.scene.objects.materials import Material, Sheet
from simharness.world.scene.objects.shapes import bar_mesh, box_mesh, joined, lathe, quad_mesh

_PAINTED = 0.74  # albedo from which wood counts as painted


class Furnishing:
    """Builder of a textured mesh, with its front towards +x.

    Attributes:
        sheet: materials and prints.
    """

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self._meshes: list[Mesh] = []
        self._uv: list[NDArray[np.float32]] = []

    def block(
        self, low: Sequence[float], high: Sequence[float], color: ArrayLike, material: Material = "plain"
    ) -> Self:
        """Add a box from its lowest to its highest corner, metres."""
        a, b = np.asarray(low, float), np.asarray(high, float)
        dx, dy, dz = ((b - a) / 2).tolist()
        mesh = box_mesh([Box((0.0, 0.0, 0.0), (dx, dy, dz))], np.asarray(color, float)[None])
        return self.part(mesh, material, center=((a + b) / 2).tolist())

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
        return self.part(bar_mesh(start, end, radius, color, sides=sides), material)

    def turned(
        self,
        profile: ArrayLike,
        color: ArrayLike,
        material: Material = "plain",
        *,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        sides: int = 14,
    ) -> Self:
        """Add a body of revolution: see :func:`simharness.world.scene.objects.shapes.lathe`."""
        return self.part(lathe(profile, color, sides=sides), material, center=at)

    def front_print(self, name: str, x: float, y: float, z: float, size: tuple[float, float]) -> Self:
        """Add a print of width and height ``size`` around (x, y, z) that faces +x."""
        w, h = size[0] / 2, size[1] / 2
        corners = np.array([(x, y - w, z - h), (x, y + w, z - h), (x, y + w, z + h), (x, y - w, z + h)])
        place = np.array([[0, 1], [1, 1], [1, 0], [0, 1], [1, 0], [0, 0]], float).reshape(2, 3, 2)
        self._meshes.append(quad_mesh(corners, np.array([[0, 1, 2, 3]]), np.ones((1, 3))))
        self._uv.append(self.sheet.uv(name, place))
        return self

    def round_print(self, name: str, center: Sequence[float], radius: float) -> Self:
        """Add a round print around a centre that faces +x."""
        turn = 2 * np.pi * np.arange(28) / 28
        rim = np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.column_stack([np.zeros(28), radius * rim]) + np.asarray(center, float)
        fan = np.column_stack([np.zeros(26, int), np.arange(1, 27), np.arange(2, 28)]).astype(np.int32)
        self._meshes.append(Mesh(points.astype(np.float32), fan, np.ones((26, 3), np.float32)))
        self._uv.append(self.sheet.uv(name, (0.5 + 0.5 * rim * [1, -1])[fan]))
        return self

    def part(self, mesh: Mesh, material: Material = "plain", *, center: Sequence[float] = (0.0, 0.0, 0.0)) -> Self:
        """Add a mesh of one material, moved to ``center``. Wood that is painted white shows no grain."""
        if material == "wood" and len(mesh.colors) and mesh.colors.min() > _PAINTED:
            material = "plain"
        self._uv.append(self.sheet.projected(mesh, material, len(self._meshes)))
        self._meshes.append(mesh.moved((mesh.vertices.astype(float) + center).astype(np.float32)))
        return self

    def group(self, other: "Furnishing", place: Sequence[float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> Self:
        """Add all parts of another furnishing, turned by ``yaw`` and moved to ``place``."""
        for mesh, uv in zip(other._meshes, other._uv, strict=True):
            vertices = carried(mesh.vertices, place[:2], yaw) + [0.0, 0.0, place[2]]
            self._meshes.append(mesh.moved(vertices.astype(np.float32)))
            self._uv.append(uv)
        return self

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self._meshes)

    def mesh(self) -> Mesh:
        """Return the mesh of all parts."""
        return replace(joined(*self._meshes), texture=self.sheet.texture, uv=np.concatenate(self._uv))
