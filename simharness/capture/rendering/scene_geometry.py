"""Geometry of a whole scene for shading: merged triangles, normals, texture pyramids, shadow map.

Between frames mostly vertices move. So everything that depends on the faces of the meshes is in :class:`SceneTopology`,
reused while they are the same, and everything that depends on the vertices in :class:`SceneGeometry`.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering.face_kernels import casters, normals
from simharness.capture.rendering.raster_kernels import rasterise
from simharness.capture.rendering.shading_kernels import BIAS, nearest_blocks, packed
from simharness.types.lighting import Lighting, facing
from simharness.types.mesh import Mesh

Floats = NDArray[np.float32]

SHADOW_SIZE = 768  # pixels
_LIGHT_DISTANCE = 1000.0  # in radii of the shadow casters: rays are almost parallel


@dataclass(frozen=True)
class SceneTopology:
    """Faces of a scene with n vertices and k faces in total."""

    meshes: tuple[Mesh, ...]

    def matches(self, meshes: Sequence[Mesh]) -> bool:
        """Return whether meshes are the same except for their vertex positions."""
        return len(meshes) == len(self.meshes) and all(map(_same_topology, meshes, self.meshes))

    @cached_property
    def faces(self) -> NDArray[np.uint32]:
        """Indices of all faces into all vertices, (k, 3)."""
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in self.meshes)]).astype(np.int32)
        faces = [mesh.faces + start for mesh, start in zip(self.meshes, starts, strict=False)]
        return np.concatenate([np.zeros((0, 3), np.int32), *faces]).view(np.uint32)

    @cached_property
    def mesh(self) -> NDArray[np.int16]:
        """Mesh index of every face, then -1 for face -1 (no face), (k + 1,)."""
        return np.append(self._per_face(range(len(self.meshes))), -1).astype(np.int16)

    @cached_property
    def parts(self) -> NDArray[np.int8]:
        """Part label of every face, then -1 for face -1 (no face), (k + 1,)."""
        none = (np.full(len(mesh.faces), -1, np.int8) for mesh in self.meshes)
        labels = [rest if mesh.parts is None else mesh.parts for mesh, rest in zip(self.meshes, none, strict=True)]
        return np.concatenate([*labels, np.array([-1], np.int8)])

    @cached_property
    def colors(self) -> Floats:
        """Colours of the faces, (k, 3)."""
        return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.colors for mesh in self.meshes)])

    @cached_property
    def smooth(self) -> NDArray[np.bool_]:
        """Whether each face has interpolated normals, (k,)."""
        return self._per_face(mesh.smooth for mesh in self.meshes).astype(bool)

    @cached_property
    def texture(self) -> NDArray[np.int16]:
        """Index of the texture of every face, -1 for none, (k,)."""
        index = {id(texture): k for k, texture in enumerate(self._textures)}
        return self._per_face(index.get(id(mesh.texture), -1) for mesh in self.meshes).astype(np.int16)

    @cached_property
    def uv(self) -> Floats:
        """Texture coordinates of the corners, (k, 3, 2); zeros for faces without texture, (1, 3, 2) if none has one."""
        if not self._textures:
            return np.zeros((1, 3, 2), np.float32)
        corners = [
            np.zeros((len(mesh.faces), 3, 2), np.float32) if mesh.uv is None else mesh.uv for mesh in self.meshes
        ]
        return np.concatenate(corners)

    @cached_property
    def pyramids(self) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
        """Packed texels of all textures at all mipmap levels, (m,), and first texel, height and width of each level.

        The latter is (textures, levels, 3); small textures repeat their last level. Every level has a border of one
        texel, copied from the opposite side.
        """
        pyramids = [list(pyramid(texture)) for texture in self._textures] or [[np.full((1, 1, 3), 255, np.uint8)]]
        table = np.zeros((len(pyramids), max(map(len, pyramids)), 3), np.int64)
        texels: list[NDArray[np.uint8]] = []
        first = 0
        for k, pictures in enumerate(pyramids):
            for level, picture in enumerate(pictures):
                table[k, level:] = first, *picture.shape[:2]
                texels.append(np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="wrap").reshape(-1, 3))
                first += len(texels[-1])
        return packed(np.concatenate(texels)), table

    @cached_property
    def _textures(self) -> list[NDArray[np.uint8]]:
        """Distinct textures."""
        return list({id(mesh.texture): mesh.texture for mesh in self.meshes if mesh.texture is not None}.values())

    def _per_face(self, values: Iterable[int]) -> NDArray:
        return np.repeat(np.array(list(values), int), [len(mesh.faces) for mesh in self.meshes])


@dataclass(frozen=True)
class SceneGeometry:
    """Triangles of a scene at their positions; what only shading needs is computed on first use."""

    topology: SceneTopology
    meshes: tuple[Mesh, ...]

    @classmethod
    def of(cls, meshes: Sequence[Mesh], last: SceneGeometry | None = None) -> SceneGeometry:
        """Return the geometry of a scene; reuses the ``last`` one as far as it is unchanged."""
        if last is not None and len(meshes) == len(last.meshes) and all(map(operator.is_, meshes, last.meshes)):
            return last  # the same frozen objects: nothing changed
        kept = last is not None and last.topology.matches(meshes)
        return cls(last.topology if last is not None and kept else SceneTopology(tuple(meshes)), tuple(meshes))

    @cached_property
    def vertices(self) -> Floats:
        """Vertices in the world, (n, 3)."""
        return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in self.meshes)])

    @cached_property
    def normals(self) -> tuple[Floats, Floats]:
        """Normals of the faces, (k, 3), and of the vertices, (n, 3)."""
        return normals(self.vertices, self.topology.faces, self.topology.smooth)

    def shadows(self, lighting: Lighting) -> Shadows:
        """Return the shadow map for a lighting; the last one is cached."""
        kept: Shadows | None = self.__dict__.get("_shadows")
        if kept is None or kept.direction != lighting.direction:
            kept = cast_shadows(self, lighting)
            self.__dict__["_shadows"] = kept
        return kept


@dataclass(frozen=True)
class Shadows:
    """Shadow map of a distant light.

    Attributes:
        direction: unit vector to the light.
        P: projection into the map, (3, 4).
        nearest: inverse depth from the light of the first surface, (s, s) float32, 0 if there is none.
        bias: least lead in inverse depth of a surface that shades another one that faces the light.
    """

    direction: tuple[float, float, float]
    P: NDArray[np.float64]
    nearest: Floats
    bias: float

    @cached_property
    def blocks(self) -> Floats:
        """Highest inverse depth in every block of the map, for the rasteriser."""
        return nearest_blocks(self.nearest)


def cast_shadows(geometry: SceneGeometry, lighting: Lighting) -> Shadows:
    """Render the shadow map of a scene from the light.

    Only faces turned to the light cast shadows: this is sufficient for closed bodies, and lets the light into a room,
    whose walls face inwards. The floor and the walls that receive light have nothing behind them. The map covers just
    the remaining faces.
    """
    vertices, direction = geometry.vertices, np.array(lighting.direction)
    nearest = np.zeros((SHADOW_SIZE, SHADOW_SIZE), np.float32)
    faces, low, high = casters(vertices, geometry.topology.faces, geometry.normals[0], direction)
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-3)
    R, half = facing(direction), SHADOW_SIZE / 2
    K = np.array([[half * (_LIGHT_DISTANCE - 1), 0, half], [0, half * (_LIGHT_DISTANCE - 1), half], [0, 0, 1]])
    P = K @ np.column_stack([R, -R @ (middle + _LIGHT_DISTANCE * radius * direction)])
    rasterise(vertices, faces, P, radius, nearest, np.full(nearest.shape, -1, np.int32))
    bias = BIAS * (radius / half) / (_LIGHT_DISTANCE * radius) ** 2  # as inverse depth, which is nearly constant here
    return Shadows(lighting.direction, P, nearest, bias)


def _same_topology(one: Mesh, other: Mesh) -> bool:
    return (
        one.faces is other.faces
        and one.colors is other.colors
        and one.texture is other.texture
        and one.uv is other.uv
        and one.parts is other.parts
        and one.smooth == other.smooth
        and len(one.vertices) == len(other.vertices)
    )


def pyramid(texture: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
    """Yield a texture and its halved versions (mipmap levels) down to one texel."""
    picture = texture
    while True:
        yield picture
        height, width = picture.shape[:2]
        if height == width == 1:
            return
        size = (max(1, width // 2), max(1, height // 2))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
