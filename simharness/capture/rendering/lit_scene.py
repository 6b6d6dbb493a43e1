"""Pictures of a scene with light sources: its still surfaces in their light, and over them what moves.

The light of still surfaces is kept with the background of a camera. Moving meshes are lit by the light in the air
around them, less what bodies keep from each other and themselves; a map of the floor, and maps at some heights above
it, say what they keep from the still surfaces, which are darkened by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering import tone
from simharness.capture.rendering.backgrounds import Background, LitBackground, fill_empty
from simharness.capture.rendering.finishes import MATTE, Finishes, PosedFinishes
from simharness.capture.rendering.lit_kernels import shade_lit
from simharness.capture.rendering.moving_light import capsules, moving_light
from simharness.capture.rendering.moving_shadows import BLOCK, cast, dim, runs_below, touched_blocks
from simharness.capture.rendering.room_light import RoomLight, last_light, room_light
from simharness.capture.rendering.scene_geometry import SceneGeometry
from simharness.capture.rendering.scene_topology import SceneTopology
from simharness.capture.rendering.vertex_kernels import whole
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.srgb import LUMINANCE

Floats = NDArray[np.float32]

_LUMINANCE = np.array(LUMINANCE)
_CELL, _MOST_CELLS = 0.06, 384  # metres; cells of the map along each side: beyond, they are larger
_HEIGHTS = np.array([0.0, 0.5, 1.1, 1.9], np.float32)  # metres, of the maps above the floor


@dataclass(frozen=True)
class MovingSamples:
    """Light samples of the moving meshes of a scene.

    Attributes:
        of_vertex: vertex of each sample, (n,) int32.
        of_face: face whose normal it has, -1 for that of the vertex, (n,) int32.
        spans: first and end of the samples of each mesh, (meshes, 2).
        corner_samples: samples of the corners of the faces, (k, 3) int32.
        group: part of a body that each vertex belongs to, (v,) int32.
        ranges: first and end of the parts of each mesh, (meshes, 2).
    """

    of_vertex: NDArray[np.int32]
    of_face: NDArray[np.int32]
    spans: NDArray[np.int64]
    corner_samples: NDArray[np.int32]
    group: NDArray[np.int32]
    ranges: NDArray[np.int64]

    @cached_property
    def divisions(self) -> NDArray[np.int32]:
        """Divisions of the faces, (k,): none, unlike those of still meshes."""
        return np.ones(len(self.corner_samples), np.int32)

    @classmethod
    def of(cls, meshes: tuple[Mesh, ...]) -> MovingSamples:
        """Return the samples of meshes in the order of their faces and vertices."""
        of_vertex, of_face, corner_samples, group = _lists(4)
        spans, ranges = [], []
        vertices = faces = samples = parts = 0
        for mesh in meshes:
            count = len(mesh.vertices) if mesh.smooth else 3 * len(mesh.faces)
            if mesh.smooth:
                of_vertex.append(vertices + np.arange(count))
                of_face.append(np.full(count, -1))
                corner_samples.append(samples + mesh.faces)
            else:
                of_vertex.append(vertices + mesh.faces.ravel())
                of_face.append(faces + np.repeat(np.arange(len(mesh.faces)), 3))
                corner_samples.append(samples + np.arange(count).reshape(-1, 3))
            label = np.zeros(len(mesh.vertices), int)
            if mesh.parts is not None and len(mesh.faces):
                label[mesh.faces.ravel()] = np.repeat(np.maximum(mesh.parts, 0), 3)
            number = int(label.max(initial=-1)) + 1
            group.append(parts + label)
            spans.append((samples, samples + count))
            ranges.append((parts, parts + number))
            vertices, faces = vertices + len(mesh.vertices), faces + len(mesh.faces)
            samples, parts = samples + count, parts + number
        empty = np.zeros(0, int)
        return cls(
            np.concatenate([empty, *of_vertex]).astype(np.int32),
            np.concatenate([empty, *of_face]).astype(np.int32),
            np.array(spans, np.int64).reshape(-1, 2),
            np.concatenate([empty.reshape(0, 3), *corner_samples]).astype(np.int32),
            np.concatenate([empty, *group]).astype(np.int32),
            np.array(ranges, np.int64).reshape(-1, 2),
        )


def _lists(count: int) -> tuple[list[NDArray], ...]:
    return tuple([] for _ in range(count))


@dataclass(frozen=True)
class ShadowLayers:
    """Share of the light that moving bodies leave to still surfaces that face up.

    Attributes:
        fine: on the floor, (rows, columns).
        coarse: at ``_HEIGHTS``, in cells twice as large.
        touched: blocks of cells in which anything is dark.
    """

    fine: Floats
    coarse: Floats
    touched: NDArray[np.bool_]


@dataclass(frozen=True)
class LitScene:
    """Light of a scene at one time.

    Attributes:
        geometry: triangles of the scene.
        lighting: its lighting, with sources.
        room: light of its still meshes.
    """

    geometry: SceneGeometry
    lighting: Lighting
    room: RoomLight

    @classmethod
    def of(cls, geometry: SceneGeometry, lighting: Lighting) -> LitScene | None:
        """Return the light of a scene, the last one if nothing has changed; None where the closed form lights it."""
        if lighting.sources is None:
            return None
        kept: LitScene | None = geometry.__dict__.get("_lit_scene")
        if kept is not None and kept.lighting == lighting:
            return kept
        still = geometry.still
        if lighting.mirror is not None:
            room = last_light(lighting.sources)
        elif len(still.vertices):
            room = room_light(lighting.sources, still.topology, still.vertices, still.normals)
        else:
            room = None
        if room is None:
            return None
        scene = cls(geometry, lighting, room)
        geometry.__dict__["_lit_scene"] = scene
        return scene

    @cached_property
    def _samples(self) -> MovingSamples:
        """Samples of the moving meshes; kept with the topology."""
        topology = self.geometry.topology
        samples: MovingSamples | None = topology.__dict__.get("_moving_samples")
        if samples is None:
            samples = MovingSamples.of(topology.meshes[len(self.geometry.still.meshes) :])
            topology.__dict__["_moving_samples"] = samples
        return samples

    @cached_property
    def _moving(self) -> tuple[Floats, Floats, Floats]:
        """Vertices of the moving meshes and normals of their faces and vertices, before a mirror."""
        geometry = self.geometry
        faces, vertices = geometry.topology.still
        moving, (of_faces, of_vertices) = geometry.moving_vertices, geometry.normals
        of_faces, of_vertices = of_faces[faces:], of_vertices[vertices:]
        if self.lighting.mirror is None:
            return moving, of_faces, of_vertices
        mirror, normal = self.lighting.mirror, np.array(self.lighting.mirror.normal, np.float32)
        return (
            mirror.reflect(moving).astype(np.float32),
            of_faces - 2 * (of_faces @ normal)[:, None] * normal,
            of_vertices - 2 * (of_vertices @ normal)[:, None] * normal,
        )

    @cached_property
    def _bodies(self) -> Floats:
        """Capsules around the parts of the moving meshes, (n, 7)."""
        samples = self._samples
        return capsules(self._moving[0], samples.group, int(samples.ranges.max(initial=0)))

    @cached_property
    def moving_light(self) -> Floats:
        """Irradiance at the samples of the moving meshes, (n, 3)."""
        samples, probes = self._samples, self.room.probes
        every = probes.every.reshape(*probes.every.shape[:3], 18)
        return moving_light(
            *self._moving, samples.of_vertex, samples.of_face, samples.spans, self._bodies, samples.ranges,
            probes.origin, probes.step, every, probes.straight,
        )  # fmt: skip

    @cached_property
    def _finishes(self) -> PosedFinishes | None:
        """Finishes of the moving meshes; None if all are matte."""
        topology = self.geometry.topology
        if "_finishes" not in topology.__dict__:
            topology.__dict__["_finishes"] = Finishes.of(topology.meshes[len(self.geometry.still.meshes) :])
        finishes: Finishes | None = topology.__dict__["_finishes"]
        if finishes is None:
            return None
        vertices = self.geometry.moving_vertices
        return PosedFinishes.of(finishes, vertices, self._moving[0], self.lighting, self.room.probes)

    @cached_property
    def shadows(self) -> ShadowLayers:
        """What the moving meshes keep from the still ones."""
        probes, sources, grid = self.room.probes, self.lighting.sources, Grid.of(self.room)
        assert sources is not None
        lamps = np.zeros((len(sources.areas), 11))
        for row, area in zip(lamps, sources.areas, strict=True):
            radiance = _LUMINANCE @ (self.room.exposure * area.radiance)
            row[:] = *area.center, *area.right, *area.up, radiance, area.focus
        sun = np.zeros(4)
        if sources.sun is not None:
            sun[:] = *sources.sun.direction, _LUMINANCE @ (self.room.exposure * sources.sun.irradiance)
        up = probes.every[..., 4, :] @ _LUMINANCE.astype(np.float32)
        fixed = (
            self._bodies, self._samples.ranges, lamps, sun, probes.origin, probes.step,
            np.ascontiguousarray(up[..., None]), probes.shares,
        )  # fmt: skip
        fine = np.ones(grid.shape, np.float32)
        coarse = np.ones((len(_HEIGHTS), grid.shape[0] // 2, grid.shape[1] // 2), np.float32)
        for around in (True, False):
            cast(fine, 0.0, grid.cell, grid.corner, *fixed, around)
            for layer, height in zip(coarse[1:], _HEIGHTS[1:].tolist(), strict=True):
                cast(layer, height, 2 * grid.cell, grid.corner, *fixed, around)
        coarse[0] = fine.reshape(coarse.shape[1], 2, coarse.shape[2], 2).mean(axis=(1, 3))
        return ShadowLayers(fine, coarse, touched_blocks(fine, coarse))

    def background(self, background: Background, camera: Camera, rays: NDArray[np.float64]) -> LitBackground:
        """Return the background in this light; the last one is kept."""
        kept = background.lit
        if kept is not None and kept.lighting == self.lighting and kept.light is self.room:
            return kept
        triangle, inverse_depth = background.triangle, background.inverse_depth
        rgb = np.empty((*triangle.shape, 3), np.uint8)
        fill_empty(rgb, triangle < 0, self.lighting, rays, self.room.exposure)
        still, samples, grid = self.geometry.still, self.room.samples, Grid.of(self.room)
        if len(still.topology.faces):
            seen = whole(*triangle.shape), triangle, background.corners
            self._shade(
                still.topology, seen, still.normals, rays, self.room.exposure, self.room.light,
                samples.corner_samples, samples.divisions, (0, 0), MATTE, rgb,
            )  # fmt: skip
        block, (rows, columns) = BLOCK * grid.cell, grid.blocks
        runs = runs_below(
            triangle, inverse_depth, camera.center, rays, grid.corner, block, rows, columns, float(_HEIGHTS[-1])
        )
        nothing = np.zeros((0, 0), np.uint16), np.zeros((0, 0), np.float32)
        background.lit = LitBackground(self.lighting, self.room, rgb, *nothing, runs)
        return background.lit

    def draw(
        self,
        lit: LitBackground,
        seen: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32], NDArray[np.float64]],
        camera: Camera,
        rays: NDArray[np.float64],
    ) -> NDArray[np.uint8]:
        """Return the picture, (h, w, 3): the background with the moving meshes and what they keep from it."""
        rgb, topology, samples = lit.rgb.copy(), self.geometry.topology, self._samples
        spans, triangle, inverse_depth, corners = seen
        first = topology.still[0]
        if first == len(topology.faces):
            return rgb
        grid, shadows = Grid.of(self.room), self.shadows
        if first:
            dim(
                inverse_depth, lit.runs, camera.center, rays, grid.corner, grid.cell,
                shadows.fine, shadows.coarse, _HEIGHTS, shadows.touched, tone.dimming(), rgb,
            )  # fmt: skip
        finishes = self._finishes
        self._shade(
            topology, (spans, triangle, corners), self.geometry.normals, rays, self.room.exposure, self.moving_light,
            samples.corner_samples, samples.divisions, topology.still, MATTE if finishes is None else
            finishes.arguments(camera, rays), rgb,
        )  # fmt: skip
        return rgb

    @staticmethod
    def _shade(
        topology: SceneTopology,
        seen: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]],
        normals: tuple[Floats, Floats],
        rays: NDArray[np.float64],
        exposure: Floats,
        light: Floats,
        corner_samples: NDArray[np.int32],
        divisions: NDArray[np.int32],
        first: tuple[int, int],
        finish: tuple[Any, ...],
        rgb: NDArray[np.uint8],
    ) -> None:
        shade_lit(
            *seen, topology.faces, topology.colors, topology.smooth, *normals, topology.texture, topology.uv,
            *topology.pyramids, rays, topology.emission[first[0] :], exposure, light, corner_samples, divisions,
            *first, *finish,
            tone.table(), tone.BRIGHTEST, rgb,
        )  # fmt: skip


@dataclass(frozen=True)
class Grid:
    """Cells of the maps of shadows: around the probes.

    Attributes:
        corner: x and y of the corner, (2,).
        cell: side of a cell, metres.
        shape: rows and columns.
    """

    corner: NDArray[np.float64]
    cell: float
    shape: tuple[int, int]

    @classmethod
    def of(cls, room: RoomLight) -> Grid:
        """Return the grid of a room."""
        probes = room.probes
        counts = np.array(probes.every.shape[:2])
        extent = probes.step[:2] * (counts - 1) + 0.12
        cell = max(_CELL, float(extent.max()) / _MOST_CELLS)
        columns, rows = (np.ceil(extent / (BLOCK * cell)).astype(int) * BLOCK).tolist()
        return cls(probes.origin[:2] - 0.06, cell, (rows, columns))

    @property
    def blocks(self) -> tuple[int, int]:
        """Rows and columns of blocks."""
        return self.shape[0] // BLOCK, self.shape[1] // BLOCK
