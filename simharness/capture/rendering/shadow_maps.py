"""Shadow maps of a distant light: what it sees of the meshes that stay where they are, and of the others.

The kernels take the light from pixels that the maps show to be in shadow.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.raster_kernels import pixels_of, rasterise
from simharness.capture.rendering.surface_kernels import PixelRays
from simharness.types.lighting import facing

Floats = NDArray[np.float32]

SHADOW_SIZE = 1024  # pixels
BIAS = 2.5  # pixels of the shadow map, divided by the cosine: least lead in depth of a surface that casts a shadow
_LIGHT_DISTANCE = 1000.0  # in radii of what the map covers: rays are almost parallel


@dataclass(frozen=True)
class LightView:
    """View of a distant light on a box of the scene."""

    direction: tuple[float, float, float]
    """Unit vector to the light."""
    middle: tuple[float, float, float]
    """Centre of the box, metres."""
    radius: float
    """Half the diagonal of the box, metres."""

    @classmethod
    def on_box(cls, direction: tuple[float, float, float], low: Floats, high: Floats) -> "LightView":
        """Return the view on the box from ``low`` to ``high``, (3,) each; any view where the box is empty."""
        if not np.isfinite(low).all():
            low = high = np.zeros(3, np.float32)
        radius = max(float(np.linalg.norm(high - low)) / 2, 1e-3)
        return cls(direction, tuple(((low + high) / 2).tolist()), radius)

    @cached_property
    def projection(self) -> NDArray[np.float64]:
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


class ShadowMap(NamedTuple):
    """Shadow map of a distant light."""

    nearest: Floats
    """Inverse depth from the light of the first surface, (s, s) float32, 0 if there is none."""
    blocks: Floats
    """Highest inverse depth in every block of the map."""


NO_SHADOW = ShadowMap(
    np.zeros((SHADOW_SIZE, SHADOW_SIZE), np.float32), np.zeros((SHADOW_SIZE // 8 + 1, SHADOW_SIZE // 8 + 1), np.float32)
)
"""Map of no mesh."""


@dataclass(frozen=True)
class Shadows:
    """Shadow maps of a scene."""

    light: LightView
    """View of the light."""
    still: ShadowMap
    """Map of the still meshes."""
    moving: ShadowMap
    """Map of the other meshes."""

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
    corners = pixels_of(vertices, light.projection)
    rasterise(faces, corners, light.radius, nearest, unused, 0)
    rows = corners[:, 1] / corners[:, 2]
    return ShadowMap(nearest, nearest_blocks(nearest, max(int(rows.min()) - 1, 0), int(rows.max()) + 2))


_BLOCK_SHIFT = np.uint32(3)
_BLOCK = 1 << 3  # pixels of the shadow map
_LAST = np.uint32(3)
_FILTER = 4  # side of the filter that softens shadow edges, pixels of the shadow map


@njit(cache=True, error_model="numpy")
def shadow_places(
    triangle: np.ndarray, inverse_depth: np.ndarray, view: PixelRays, light_P: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return where each pixel lies in a shadow map: index of the block (h, w) uint16, and inverse depth (h, w) float32.

    Args:
        triangle: visible face or -1, (h, w) int32.
        inverse_depth: inverse depth, 1/m, (h, w) float32.
        view: rays of the pixels.
        light_P: projection into the shadow map, (3, 4).
        side: side of the map in pixels. The index after the last block stands for a pixel without a surface, and for a
            place outside of the map.
    """
    height, width = triangle.shape
    center, rays = view
    count, end = (side + _BLOCK - 1) // _BLOCK, side - _FILTER + 1
    place, depth = np.full((height, width), count * count, np.uint16), np.ones((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            if triangle[y, x] < 0:
                continue
            far = 1.0 / inverse_depth[y, x]
            px = center[0] + far * (rays[0, 0] * x + rays[0, 1] * y + rays[0, 2])
            py = center[1] + far * (rays[1, 0] * x + rays[1, 1] * y + rays[1, 2])
            pz = center[2] + far * (rays[2, 0] * x + rays[2, 1] * y + rays[2, 2])
            w = 1.0 / (light_P[2, 0] * px + light_P[2, 1] * py + light_P[2, 2] * pz + light_P[2, 3])
            u = (light_P[0, 0] * px + light_P[0, 1] * py + light_P[0, 2] * pz + light_P[0, 3]) * w - 1.0
            v = (light_P[1, 0] * px + light_P[1, 1] * py + light_P[1, 2] * pz + light_P[1, 3]) * w - 1.0
            if 0 <= u < end and 0 <= v < end:
                place[y, x] = int(v) // _BLOCK * count + int(u) // _BLOCK
                depth[y, x] = w
    return place, depth


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def darken(
    key_light: np.ndarray, map_x: np.ndarray, map_y: np.ndarray, near: np.ndarray, still: ShadowMap, moving: ShadowMap
) -> None:
    """Remove the key light, in place, from the shaded pixels of a row, with soft edges; the two maps are one."""
    still_shadow, still_blocks = still
    shadow, blocks = moving
    end = np.float32(len(shadow) - _FILTER + 1)
    for x in range(len(key_light)):
        if key_light[x] <= 0:
            continue
        u, v, here = map_x[x], map_y[x], near[x]
        if not ((u >= 0) & (u < end) & (v >= 0) & (v < end)):
            continue
        i, j = np.uint32(u), np.uint32(v)
        of_still = still_blocks[j >> _BLOCK_SHIFT, i >> _BLOCK_SHIFT] > here
        of_others = blocks[j >> _BLOCK_SHIFT, i >> _BLOCK_SHIFT] > here
        if not (of_still | of_others):  # no surface nearby is nearer to the light
            continue
        if not of_others:
            blocked = _blocked(still_shadow, still_shadow, i, j, u - i, v - j, here)
        elif not of_still:
            blocked = _blocked(shadow, shadow, i, j, u - i, v - j, here)
        else:
            blocked = _blocked(still_shadow, shadow, i, j, u - i, v - j, here)
        key_light[x] *= 1.0 - blocked


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def _blocked(
    one: np.ndarray, other: np.ndarray, i: np.uint32, j: np.uint32, du: float, dv: float, here: float
) -> float:
    """Return the share of the light that surfaces of two shadow maps block at a place.

    Percentage-closer filtering: 4 x 4 comparisons under a sliding box of 3 x 3; mostly the four corners agree, and
    their result is used for all.
    """
    corners = int((one[j, i] > here) | (other[j, i] > here))
    corners += int((one[j, i + _LAST] > here) | (other[j, i + _LAST] > here))
    corners += int((one[j + _LAST, i] > here) | (other[j + _LAST, i] > here))
    corners += int((one[j + _LAST, i + _LAST] > here) | (other[j + _LAST, i + _LAST] > here))
    if corners == 0 or corners == 4:
        return 0.25 * corners
    blocked = 0.0
    for m in range(_FILTER):
        row = 0.0
        for n in range(_FILTER):
            y, x = j + np.uint32(m), i + np.uint32(n)
            if (one[y, x] > here) | (other[y, x] > here):
                row += (1.0 - du) if n == 0 else (du if n == _FILTER - 1 else 1.0)
        blocked += row * ((1.0 - dv) if m == 0 else (dv if m == _FILTER - 1 else 1.0)) / 9.0
    return blocked


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def nearest_blocks(shadow: np.ndarray, first: int, end: int) -> np.ndarray:
    """Return the highest inverse depth under all filters that begin in each block of 8 x 8 pixels of a shadow map.

    Only the rows from ``first`` to before ``end`` have a surface.
    """
    side = len(shadow)
    count = (side + _BLOCK - 1) // _BLOCK
    bands, blocks = np.zeros((count, side), np.float32), np.zeros((count, count), np.float32)
    first_block = max(first - _FILTER + 1, 0) // _BLOCK
    for block in range(first_block, min((end + _BLOCK - 1) // _BLOCK, count)):
        band = bands[block]
        for y in range(_BLOCK * block, min(_BLOCK * (block + 1) + _FILTER - 1, side)):
            row = shadow[y]
            for x in range(side):
                band[x] = row[x] if row[x] > band[x] else band[x]
        for column in range(count):
            for value in band[_BLOCK * column : _BLOCK * (column + 1) + _FILTER - 1]:
                blocks[block, column] = max(blocks[block, column], value)
    return blocks
