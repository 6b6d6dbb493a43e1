"""Pictures of a scene with light sources: its still surfaces in their light, and over them what moves.

The light of still surfaces is kept with the background of a camera. Moving meshes are lit by the light in the air
around them, less what bodies keep from each other and themselves; a map of the floor, and maps at some heights above
it, say what they keep from the still surfaces, which are darkened by it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering import tone
from simharness.capture.rendering.backgrounds import Background, LitBackground, fill_empty
from simharness.capture.rendering.finishes import MATTE, Finishes, PosedFinishes
from simharness.capture.rendering.moving_light import MovingMeshes, capsules, moving_light
from simharness.capture.rendering.moving_shadows import BLOCK, ShadowLayer, UpwardLight, cast, touched_blocks
from simharness.capture.rendering.room_light import RoomLight, last_light, room_light
from simharness.capture.rendering.scene_geometry import SceneGeometry
from simharness.capture.rendering.shaded_pixels import HEIGHTS, ShadowLayers, blocks_below, dim
from simharness.capture.rendering.shading_kernels import FaceLight, shade_lit
from simharness.capture.rendering.surface_kernels import DrawnPixels, PixelRays
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.srgb import LUMINANCE

Floats = NDArray[np.float32]

_LUMINANCE = np.array(LUMINANCE)
_CELL, _MOST_CELLS = 0.06, 384  # metres; cells of the map along each side: beyond, they are larger


@dataclass(frozen=True)
class MovingSamples:
    """Light samples of the moving meshes of a scene."""

    of_vertex: NDArray[np.int32]
    """Vertex of each sample, (n,) int32."""
    of_face: NDArray[np.int32]
    """Face whose normal it has, -1 for that of the vertex, (n,) int32."""
    spans: NDArray[np.int64]
    """First and end of the samples of each mesh, (meshes, 2)."""
    corner_samples: NDArray[np.int32]
    """Samples of the corners of the faces, (k, 3) int32."""
    divisions: NDArray[np.int32]
    """Divisions of the faces, (k,): none, unlike those of still meshes."""
    group: NDArray[np.int32]
    """Part of a body that each vertex belongs to, (v,) int32."""
    ranges: NDArray[np.int64]
    """First and end of the parts of each mesh, (meshes, 2)."""

    @classmethod
    def from_meshes(cls, meshes: tuple[Mesh, ...]) -> "MovingSamples":
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
        corners = np.concatenate([empty.reshape(0, 3), *corner_samples]).astype(np.int32)
        return cls(
            np.concatenate([empty, *of_vertex]).astype(np.int32),
            np.concatenate([empty, *of_face]).astype(np.int32),
            np.array(spans, np.int64).reshape(-1, 2),
            corners,
            np.ones(len(corners), np.int32),
            np.concatenate([empty, *group]).astype(np.int32),
            np.array(ranges, np.int64).reshape(-1, 2),
        )


def _lists(count: int) -> tuple[list[NDArray], ...]:
    return tuple([] for _ in range(count))


@dataclass(frozen=True)
class ShadowGrid:
    """Cells of the maps of shadows: around the probes."""

    corner: NDArray[np.float64]
    """x and y of the corner, (2,)."""
    cell: float
    """Side of a cell, metres."""
    shape: tuple[int, int]
    """Rows and columns."""

    @classmethod
    def around_probes(cls, room: RoomLight) -> "ShadowGrid":
        """Return the grid of a room."""
        probes = room.probes
        counts = np.array(probes.every.shape[:2])
        extent = probes.step[:2] * (counts - 1) + 0.12
        cell = max(_CELL, float(extent.max()) / _MOST_CELLS)
        columns, rows = (np.ceil(extent / (BLOCK * cell)).astype(int) * BLOCK).tolist()
        return cls(probes.origin[:2] - 0.06, cell, (rows, columns))


@dataclass(frozen=True, eq=False)
class LitScene:
    """Light of a scene at one time."""

    geometry: SceneGeometry
    """Triangles of the scene."""
    lighting: Lighting
    """Its lighting, with sources."""
    room: RoomLight
    """Light of its still meshes."""
    samples: MovingSamples
    """Light samples of the moving meshes."""
    finishes: Finishes | None
    """Finishes of the moving meshes; None if all are matte."""

    @classmethod
    def in_light(cls, geometry: SceneGeometry, lighting: Lighting, last: "LitScene | None" = None) -> "LitScene | None":
        """Return the light of a scene; None where the closed form lights it.

        Args:
            geometry: triangles of the scene.
            lighting: its lighting.
            last: light of the last picture, which is reused as far as nothing has changed.
        """
        if lighting.sources is None:
            return None
        if last is not None and last.geometry is geometry and last.lighting == lighting:
            return last
        still = geometry.still
        if lighting.mirror is not None:
            room = last_light(lighting.sources)
        elif len(still.vertices):
            room = room_light(lighting.sources, still.topology, still.vertices, still.normals)
        else:
            room = None
        if room is None:
            return None
        if last is not None and last.geometry.topology is geometry.topology:
            return cls(geometry, lighting, room, last.samples, last.finishes)
        moving = geometry.topology.meshes[len(still.meshes) :]
        return cls(geometry, lighting, room, MovingSamples.from_meshes(moving), Finishes.from_meshes(moving))

    @cached_property
    def _moving(self) -> MovingMeshes:
        """Moving meshes, before a mirror."""
        geometry = self.geometry
        faces, vertices = geometry.topology.still
        moving, (of_faces, of_vertices) = geometry.moving_vertices, geometry.normals
        of_faces, of_vertices = of_faces[faces:], of_vertices[vertices:]
        if self.lighting.mirror is None:
            return MovingMeshes(moving, of_faces, of_vertices)
        mirror, normal = self.lighting.mirror, np.array(self.lighting.mirror.normal, np.float32)
        return MovingMeshes(
            mirror.reflect(moving).astype(np.float32),
            of_faces - 2 * (of_faces @ normal)[:, None] * normal,
            of_vertices - 2 * (of_vertices @ normal)[:, None] * normal,
        )

    @cached_property
    def _bodies(self) -> Floats:
        """Capsules around the parts of the moving meshes, (n, 7)."""
        return capsules(self._moving.vertices, self.samples.group, int(self.samples.ranges.max(initial=0)))

    @cached_property
    def moving_light(self) -> Floats:
        """Irradiance at the samples of the moving meshes, (n, 3)."""
        samples = self.samples
        places = samples.of_vertex, samples.of_face, samples.spans
        return moving_light(self._moving, places, self._bodies, samples.ranges, self.room.probes.air)

    @cached_property
    def _posed_finishes(self) -> PosedFinishes | None:
        """Finishes of the moving meshes in their pose; None if all are matte."""
        if self.finishes is None:
            return None
        before_mirror, vertices = self._moving.vertices, self.geometry.moving_vertices
        return PosedFinishes.in_pose(self.finishes, vertices, before_mirror, self.lighting, self.room.probes)

    @cached_property
    def shadows(self) -> ShadowLayers:
        """What the moving meshes keep from the still ones."""
        grid, upward, bodies = ShadowGrid.around_probes(self.room), self._upward_light(), self._bodies
        fine = np.ones(grid.shape, np.float32)
        coarse = np.ones((len(HEIGHTS), grid.shape[0] // 2, grid.shape[1] // 2), np.float32)
        layers = [ShadowLayer(fine, grid.corner, grid.cell, 0.0)]
        for left, height in zip(coarse[1:], HEIGHTS[1:].tolist(), strict=True):
            layers.append(ShadowLayer(left, grid.corner, 2 * grid.cell, height))
        for around in (True, False):
            for layer in layers:
                cast(layer, bodies, self.samples.ranges, upward, around)
        coarse[0] = fine.reshape(coarse.shape[1], 2, coarse.shape[2], 2).mean(axis=(1, 3))
        return ShadowLayers(grid.corner, grid.cell, fine, coarse, HEIGHTS, touched_blocks(fine, coarse))

    def _upward_light(self) -> UpwardLight:
        """Return the light of the room on surfaces that face up."""
        probes, sources = self.room.probes, self.lighting.sources
        assert sources is not None
        lamps = np.zeros((len(sources.areas), 11))
        for row, area in zip(lamps, sources.areas, strict=True):
            radiance = _LUMINANCE @ (self.room.exposure * area.radiance)
            row[:] = *area.center, *area.right, *area.up, radiance, area.focus
        sun = np.zeros(4)
        if sources.sun is not None:
            sun[:] = *sources.sun.direction, _LUMINANCE @ (self.room.exposure * sources.sun.irradiance)
        up = np.ascontiguousarray((probes.every[..., 4, :] @ _LUMINANCE.astype(np.float32))[..., None])
        return UpwardLight(lamps, sun, probes.origin, probes.step, up, probes.shares)

    def background(self, background: Background, view: PixelRays) -> LitBackground:
        """Return the background in this light; the last one is kept."""
        kept = background.lit
        if kept is not None and kept.lighting == self.lighting and kept.light is self.room:
            return kept
        triangle, inverse_depth = background.triangle, background.inverse_depth
        rgb = np.empty((*triangle.shape, 3), np.uint8)
        fill_empty(rgb, triangle < 0, self.lighting, view.to_rays, self.room.exposure)
        still, samples, room = self.geometry.still, self.room.samples, self.room
        if len(still.topology.faces):
            pixels = DrawnPixels(triangle, inverse_depth, background.corners).shown(triangle >= 0)
            emission = still.topology.emission
            light = FaceLight(emission, room.exposure, room.light, samples.corner_samples, samples.divisions)
            shade_lit(pixels, background.corners, still.faces, view.to_rays, light, (0, 0), MATTE, tone.table(), rgb)
        grid = ShadowGrid.around_probes(room)
        shape = grid.shape[0] // BLOCK, grid.shape[1] // BLOCK
        blocks = blocks_below(triangle, inverse_depth, view, grid.corner, BLOCK * grid.cell, shape)
        background.lit = LitBackground(self.lighting, self.room, rgb, blocks, np.zeros((0, 0), np.float32))
        return background.lit

    def draw(self, lit: LitBackground, drawn: DrawnPixels, view: PixelRays) -> NDArray[np.uint8]:
        """Return the picture, (h, w, 3): the background with the moving meshes and what they keep from it.

        Args:
            lit: the background in this light.
            drawn: what the pixels show.
            view: rays of the pixels.
        """
        rgb, topology, samples = lit.rgb.copy(), self.geometry.topology, self.samples
        first = topology.still
        if first[0] == len(topology.faces):
            return rgb
        if first[0]:
            dim(drawn, lit.shadow_place, view, self.shadows, tone.dimming(), rgb)
        posed, emission = self._posed_finishes, topology.emission[first[0] :]
        finishes = MATTE if posed is None else posed.arrays(view)
        light = FaceLight(emission, self.room.exposure, self.moving_light, samples.corner_samples, samples.divisions)
        pixels, faces = drawn.shown(drawn.triangle >= first[0]), self.geometry.faces
        shade_lit(pixels, drawn.corners, faces, view.to_rays, light, first, finishes, tone.table(), rgb)
        return rgb
