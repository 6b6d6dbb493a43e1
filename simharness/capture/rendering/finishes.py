"""Finishes of the moving meshes of a scene in a pose: the light around figures, and the grain of their cloth and hair.

They are computed once for a frame and serve all cameras (:mod:`simharness.capture.rendering.finish_kernels`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from simharness.capture.rendering.finish_kernels import FinishArrays
from simharness.capture.rendering.moving_light import AirLight, light_at
from simharness.capture.rendering.room_light import Probes
from simharness.capture.rendering.surface_kernels import PixelRays
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.srgb import LUMINANCE

Floats = NDArray[np.float32]

_AROUND = 0.6  # metres: see Finish.around
_HEIGHT = 0.75  # share of a figure's height at which its light is taken
_SLACK = 0.02  # share of its length by which cloth shortens without a fold
_DEPTH, _DEEPEST = 1.3, 0.65  # slope of folds for each unit of shortening beyond it, and at most
_EVER = 0.07  # slope of folds of loose cloth at rest
_ZERO, _UNIT, _TINY = np.float32(0.0), np.float32(1.0), np.float32(1e-6)
_RED, _GREEN, _BLUE = LUMINANCE


@dataclass(frozen=True)
class Finishes:
    """Finishes of m faces and v vertices of moving meshes; see :class:`simharness.types.mesh.Finish`.

    Attributes:
        material: material of every face, (m,) int8.
        figure: mesh of every face, (m,) int16.
        spans: first and end of the vertices of each mesh, (meshes, 2).
        toward: vertex to which the grain points, (v,) int32.
        rest, place, looseness: the other fields, (v,).
    """

    material: NDArray[np.int8]
    figure: NDArray[np.int16]
    spans: NDArray[np.int64]
    toward: NDArray[np.int32]
    rest: Floats
    place: Floats
    looseness: Floats
    around: float = _AROUND

    @classmethod
    def from_meshes(cls, meshes: tuple[Mesh, ...]) -> "Finishes | None":
        """Return the finishes of meshes in the order of their faces and vertices; None if all are matte."""
        if all(mesh.finish is None for mesh in meshes):
            return None
        material: list[NDArray] = []
        toward: list[NDArray] = []
        rest: list[NDArray] = []
        place: list[NDArray] = []
        looseness: list[NDArray] = []
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        for mesh, start in zip(meshes, starts.tolist(), strict=False):
            count, finish = len(mesh.vertices), mesh.finish
            none = np.zeros(count, np.float32)
            material.append(np.zeros(len(mesh.faces), np.int8) if finish is None else finish.materials)
            toward.append(start + (np.arange(count) if finish is None else finish.toward))
            for parts, key in ((rest, "rest"), (place, "place"), (looseness, "looseness")):
                parts.append(none if finish is None else getattr(finish, key))
        return cls(
            np.concatenate(material),
            np.repeat(np.arange(len(meshes), dtype=np.int16), [len(mesh.faces) for mesh in meshes]),
            np.column_stack([starts[:-1], starts[1:]]).astype(np.int64),
            np.concatenate(toward).astype(np.int32),
            np.concatenate(rest),
            np.concatenate(place),
            np.concatenate(looseness),
        )


@dataclass(frozen=True)
class PosedFinishes:
    """Finishes in one pose and light."""

    finishes: Finishes
    """What does not change."""
    lights: Floats
    """Light around the meshes, see :func:`figure_light`, (meshes, 7)."""
    grain: Floats
    """Direction of the grain and slope of folds at the vertices, (v, 4)."""
    middles: Floats
    """Middles of the meshes, (meshes, 3)."""

    @classmethod
    def in_pose(
        cls, finishes: Finishes, vertices: Floats, before_mirror: Floats, lighting: Lighting, probes: Probes
    ) -> "PosedFinishes":
        """Return the finishes at vertices (v, 3); in a mirror their light is that of the vertices before it."""
        lights = figure_light(before_mirror, finishes.spans, probes.air)
        if lighting.mirror is not None:
            normal = np.array(lighting.mirror.normal, np.float32)
            lights[:, :3] -= 2 * (lights[:, :3] @ normal)[:, None] * normal
        middles = np.array([vertices[(a + b) // 2] if b > a else (0, 0, 0) for a, b in finishes.spans], np.float32)
        grain = grain_of(vertices, finishes.toward, finishes.rest, finishes.looseness)
        return cls(finishes, lights, grain, middles)

    def arrays(self, view: PixelRays) -> FinishArrays:
        """Return the finishes as the kernels take them, in the pictures of a camera."""
        away = np.linalg.norm(self.middles - view.center, axis=1)
        pixel = (away * np.linalg.norm(view.to_rays[:, 0])).astype(np.float32)
        kept = self.finishes
        return FinishArrays(kept.material, kept.figure, self.lights, pixel, self.grain, kept.place, kept.around)


MATTE = FinishArrays(
    np.zeros(0, np.int8),
    np.zeros(0, np.int16),
    np.zeros((0, 7), np.float32),
    np.zeros(0, np.float32),
    np.zeros((0, 4), np.float32),
    np.zeros(0, np.float32),
    _AROUND,
)
"""No finish: all surfaces are matte."""


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
def grain_of(vertices: np.ndarray, toward: np.ndarray, rest: np.ndarray, looseness: np.ndarray) -> np.ndarray:
    """Return the unit direction of the grain at every vertex and the slope of the folds there, (n, 4) float32.

    Args:
        vertices: positions, (n, 3) float32.
        toward: vertex that each points to, (n,).
        rest: distance to it at rest, metres, (n,) float32.
        looseness: see :class:`simharness.types.mesh.Finish`, (n,) float32.
    """
    grain = np.zeros((len(vertices), 4), np.float32)
    for i in range(len(vertices)):
        k = toward[i]
        if k == i:
            continue
        x, y, z = vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2]
        length = np.float32(math.sqrt(x * x + y * y + z * z))
        scale = _UNIT / max(length, _TINY)
        grain[i, 0], grain[i, 1], grain[i, 2] = x * scale, y * scale, z * scale
        if looseness[i] > _ZERO:
            short = np.float32(_DEPTH) * max(_UNIT - length / rest[i] - np.float32(_SLACK), _ZERO)
            grain[i, 3] = min(looseness[i] * (np.float32(_EVER) + short), np.float32(_DEEPEST))
    return grain


@njit(cache=True, error_model="numpy")
def figure_light(vertices: np.ndarray, spans: np.ndarray, air: AirLight) -> np.ndarray:
    """Return the light around figures, (meshes, 7) float32.

    A row is the unit direction to the direct light, the luminance of its irradiance, that of the rest, the change of
    the rest with the upward part of a normal, and how wide the direct light is as roughness.

    Args:
        vertices: vertices of the moving meshes, (v, 3).
        spans: first and end of the vertices of each mesh, (meshes, 2).
        air: light of the room.
    """
    origin, step, every, straight = air
    result = np.zeros((len(spans), 7), np.float32)
    column, direct, rest = np.empty(18), np.empty(6), np.empty(6)
    for mesh in range(len(spans)):
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(spans[mesh, 0], spans[mesh, 1]):
            for c in range(3):
                value = np.float64(vertices[i, c])
                low[c], high[c] = min(low[c], value), max(high[c], value)
        if not high[0] >= low[0]:
            continue
        x, y, z = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2] + _HEIGHT * (high[2] - low[2])
        light_at(origin, step, every, x, y, z, column)
        light_at(origin, step, straight, x, y, z, direct)
        dx, dy, dz = direct[0] - direct[1], direct[2] - direct[3], direct[4] - direct[5]
        length, whole, mean = math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6, 0.0
        scale = 1.0 / max(length, 1e-9)
        dx, dy, dz = dx * scale, dy * scale, dz * scale
        for axis in range(6):
            whole += direct[axis]
            way = (dx if axis < 2 else (dy if axis < 4 else dz)) * (1.0 - 2.0 * (axis % 2))
            total = _RED * column[3 * axis] + _GREEN * column[3 * axis + 1] + _BLUE * column[3 * axis + 2]
            rest[axis] = max(total - length * max(way, 0.0), 0.05 * total)
            mean += rest[axis] / 6.0
        rise = min(max(0.5 * (rest[4] - rest[5]), -0.9 * mean), 0.9 * mean)
        wide = 0.5 * min(max(0.9 - 0.8 * length / whole, 0.1), 0.7)
        result[mesh, 0], result[mesh, 1], result[mesh, 2], result[mesh, 3] = dx, dy, dz, length
        result[mesh, 4], result[mesh, 5], result[mesh, 6] = mean, rise, wide
    return result
