"""Finishes of the moving meshes of a scene, as the shading kernels take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.figure_kernels import figure_light, grain_of
from simharness.capture.rendering.room_light import Probes
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh

Floats = NDArray[np.float32]

_AROUND = 0.6  # metres: see Finish.around


@dataclass(frozen=True)
class Finishes:
    """Finishes of m faces and v vertices of moving meshes; see :class:`simharness.types.finish.Finish`.

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
    def of(cls, meshes: tuple[Mesh, ...]) -> Finishes | None:
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
    """Finishes in one pose and light.

    Attributes:
        finishes: what does not change.
        lights: light around the meshes, see :func:`.figure_kernels.figure_light`, (meshes, 7).
        grain: direction of the grain and slope of folds at the vertices, (v, 4).
        middles: middles of the meshes, (meshes, 3).
    """

    finishes: Finishes
    lights: Floats
    grain: Floats
    middles: Floats

    @classmethod
    def of(
        cls, finishes: Finishes, vertices: Floats, before_mirror: Floats, lighting: Lighting, probes: Probes
    ) -> PosedFinishes:
        """Return the finishes at vertices (v, 3); in a mirror their light is that of the vertices before it."""
        every = probes.every.reshape(*probes.every.shape[:3], 18)
        lights = figure_light(before_mirror, finishes.spans, probes.origin, probes.step, every, probes.straight)
        if lighting.mirror is not None:
            normal = np.array(lighting.mirror.normal, np.float32)
            lights[:, :3] -= 2 * (lights[:, :3] @ normal)[:, None] * normal
        middles = np.array([vertices[(a + b) // 2] if b > a else (0, 0, 0) for a, b in finishes.spans], np.float32)
        grain = grain_of(vertices, finishes.toward, finishes.rest, finishes.looseness)
        return cls(finishes, lights, grain, middles)

    def arguments(self, camera: Camera, rays: NDArray[np.float64]) -> tuple[Any, ...]:
        """Return what :func:`.finish_kernels.finish` takes from ``material`` to ``around``."""
        away = np.linalg.norm(self.middles - camera.center, axis=1)
        pixel = (away * np.linalg.norm(rays[:, 0])).astype(np.float32)
        kept = self.finishes
        return kept.material, kept.figure, self.lights, pixel, self.grain, kept.place, kept.around


MATTE = (
    np.zeros(0, np.int8),
    np.zeros(0, np.int16),
    np.zeros((0, 7), np.float32),
    np.zeros(0, np.float32),
    np.zeros((0, 4), np.float32),
    np.zeros(0, np.float32),
    _AROUND,
)
"""The same without a finish: all surfaces are matte."""
