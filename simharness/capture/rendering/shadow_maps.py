"""Shadow maps of a distant light: what it sees of the meshes that stay where they are, and of the others."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering.raster_kernels import NOTHING_DRAWN, rasterise
from simharness.capture.rendering.shadow_kernels import nearest_blocks
from simharness.types.lighting import facing

Floats = NDArray[np.float32]

SHADOW_SIZE = 1024  # pixels
BIAS = 2.5  # pixels of the shadow map, divided by the cosine: least lead in depth of a surface that casts a shadow
_LIGHT_DISTANCE = 1000.0  # in radii of what the map covers: rays are almost parallel


@dataclass(frozen=True)
class LightView:
    """View of a distant light on a box of the scene.

    Attributes:
        direction: unit vector to the light.
        middle: centre of the box, metres.
        radius: half the diagonal of the box, metres.
    """

    direction: tuple[float, float, float]
    middle: tuple[float, float, float]
    radius: float

    @classmethod
    def of(cls, direction: tuple[float, float, float], low: Floats, high: Floats) -> LightView:
        """Return the view on the box from ``low`` to ``high``, (3,) each; any view where the box is empty."""
        if not np.isfinite(low).all():
            low = high = np.zeros(3, np.float32)
        radius = max(float(np.linalg.norm(high - low)) / 2, 1e-3)
        return cls(direction, tuple(((low + high) / 2).tolist()), radius)

    @cached_property
    def P(self) -> NDArray[np.float64]:
        """Projection into the shadow map, (3, 4)."""
        direction, half = np.array(self.direction), SHADOW_SIZE / 2
        R = facing(direction)
        K = np.array([[half * (_LIGHT_DISTANCE - 1), 0, half], [0, half * (_LIGHT_DISTANCE - 1), half], [0, 0, 1]])
        center = np.array(self.middle) + _LIGHT_DISTANCE * self.radius * direction
        return np.asarray(K @ np.column_stack([R, -R @ center]))

    @property
    def bias(self) -> float:
        """Least lead in inverse depth of a surface that shades another one that faces the light."""
        return BIAS * (2 * self.radius / SHADOW_SIZE) / (_LIGHT_DISTANCE * self.radius) ** 2  # nearly constant here


@dataclass(frozen=True)
class ShadowMap:
    """Shadow map of a distant light.

    Attributes:
        nearest: inverse depth from the light of the first surface, (s, s) float32, 0 if there is none.
        blocks: highest inverse depth in every block of the map.
    """

    nearest: Floats
    blocks: Floats


NO_SHADOW = ShadowMap(
    np.zeros((SHADOW_SIZE, SHADOW_SIZE), np.float32), np.zeros((SHADOW_SIZE // 8 + 1, SHADOW_SIZE // 8 + 1), np.float32)
)
"""Map of no mesh."""


@dataclass(frozen=True)
class Shadows:
    """Shadow maps of a scene.

    Attributes:
        light: view of the light.
        still: map of the still meshes.
        moving: map of the other meshes.
    """

    light: LightView
    still: ShadowMap
    moving: ShadowMap

    @cached_property
    def nearest(self) -> Floats:
        """Both maps in one, (s, s)."""
        return np.maximum(self.still.nearest, self.moving.nearest)


def shadow_map(light: LightView, vertices: Floats, faces: NDArray[np.uint32]) -> ShadowMap:
    """Render the shadow map of faces (k, 3) with ``vertices`` (n, 3)."""
    nearest = np.zeros((SHADOW_SIZE, SHADOW_SIZE), np.float32)
    if not len(faces):
        return NO_SHADOW
    unused = np.empty(nearest.shape, np.int32)  # which face it is
    corners = rasterise(vertices, faces, light.P, light.radius, nearest, unused, NOTHING_DRAWN, 0)
    rows = corners[:, 1] / corners[:, 2]
    return ShadowMap(nearest, nearest_blocks(nearest, max(int(rows.min()) - 1, 0), int(rows.max()) + 2))
