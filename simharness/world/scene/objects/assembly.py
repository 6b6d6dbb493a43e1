"""Assembly of object models from parts, each with a mesh and a geom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.scene.objects.geoms import Box, Cylinder, Geom
from simharness.world.scene.objects.shapes import bar_mesh, box_mesh, joined, surface
from simharness.world.scene.objects.solids import ObjectModel


class Assembly:
    """Builder of an object model, which stands on z = 0 around the origin with its front towards +x."""

    def __init__(self) -> None:
        self._meshes: list[Mesh] = []
        self._geoms: list[Geom] = []

    def box(self, center: Sequence[float], size: Sequence[float], color: ArrayLike, *, yaw: float = 0.0) -> Self:
        """Add a box of ``size`` x, y, z in metres; ``color`` (3,) of the box or (6, 3) of its six sides."""
        x, y, z = (float(v) for v in center)
        dx, dy, dz = (float(v) / 2 for v in size)
        return self.boxes([Box((x, y, z), (dx, dy, dz), yaw)], np.asarray([color], float))

    def boxes(self, boxes: Sequence[Box], colors: ArrayLike) -> Self:
        """Add boxes; ``colors`` as for :func:`simharness.world.scene.objects.shapes.box_mesh`."""
        self._meshes.append(box_mesh(boxes, colors))
        self._geoms += boxes
        return self

    def bar(
        self, start: Sequence[float], end: Sequence[float], radius: float, color: ArrayLike, sides: int = 10
    ) -> Self:
        """Add a round bar from one point to another, metres."""
        a, b = np.asarray(start, float), np.asarray(end, float)
        length = float(np.linalg.norm(b - a))
        x, y, z = ((a + b) / 2).tolist()
        i, j, k = ((b - a) / length).tolist()
        bar = Cylinder((x, y, z), radius, length / 2, (i, j, k))
        self._meshes.append(bar_mesh(bar, color, sides=sides))
        self._geoms.append(bar)
        return self

    def mesh(self, mesh: Mesh) -> Self:
        """Add a mesh."""
        self._meshes.append(mesh)
        self._geoms.append(surface(mesh))
        return self

    def model(self, *, figure: Floats | None = None, mirror: Mirror | None = None) -> ObjectModel:
        """Return the object model of all parts."""
        return ObjectModel(joined(*self._meshes), tuple(self._geoms), figure=figure, mirror=mirror)
