"""All triangles of a scene in one, and what shading them needs: normals, texture pyramids, the shadows of the light.

From frame to frame most of it stays: only vertices move. So what hangs on the meshes' faces is a :class:`SceneTopology`, kept
as long as they are the same, and what hangs on the vertices a :class:`SceneGeometry`.
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
_LIGHT_DISTANCE = 1000.0  # in radii of what casts shadows: its rays are all but parallel


@dataclass(frozen=True)
class SceneTopology:
    """The faces of a scene: n vertices and k faces in all."""

    meshes: tuple[Mesh, ...]

    def matches(self, meshes: Sequence[Mesh]) -> bool:
        """Whether meshes are these but for where their vertices are."""
        return len(meshes) == len(self.meshes) and all(map(_same_topology, meshes, self.meshes))

    @cached_property
    def faces(self) -> NDArray[np.uint32]:
        """(k, 3) into all vertices."""
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in self.meshes)]).astype(np.int32)
        faces = [mesh.faces + start for mesh, start in zip(self.meshes, starts, strict=False)]
        return np.concatenate([np.zeros((0, 3), np.int32), *faces]).view(np.uint32)

    @cached_property
    def mesh(self) -> NDArray[np.int16]:
        """Index of the mesh of every face; one entry more, -1, for face -1: nothing. (k + 1,)."""
        return np.append(self._per_face(range(len(self.meshes))), -1).astype(np.int16)

    @cached_property
    def parts(self) -> NDArray[np.int8]:
        """Label of every face and one more, -1, for face -1. (k + 1,)."""
        none = (np.full(len(mesh.faces), -1, np.int8) for mesh in self.meshes)
        labels = [rest if mesh.parts is None else mesh.parts for mesh, rest in zip(self.meshes, none, strict=True)]
        return np.concatenate([*labels, np.array([-1], np.int8)])

    @cached_property
    def colors(self) -> Floats:
        """(k, 3)."""
        return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.colors for mesh in self.meshes)])

    @cached_property
    def smooth(self) -> NDArray[np.bool_]:
        """(k,)."""
        return self._per_face(mesh.smooth for mesh in self.meshes).astype(bool)

    @cached_property
    def texture(self) -> NDArray[np.int16]:
        """Index of the texture of every face, -1 for none, (k,)."""
        index = {id(texture): k for k, texture in enumerate(self._textures)}
        return self._per_face(index.get(id(mesh.texture), -1) for mesh in self.meshes).astype(np.int16)

    @cached_property
    def uv(self) -> Floats:
        """Corners in the textures, (k, 3, 2); zeros for faces without, (1, 3, 2) where no face has any."""
        if not self._textures:
            return np.zeros((1, 3, 2), np.float32)
        corners = [
            np.zeros((len(mesh.faces), 3, 2), np.float32) if mesh.uv is None else mesh.uv for mesh in self.meshes
        ]
        return np.concatenate(corners)

    @cached_property
    def pyramids(self) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
        """Texels of all textures at all sizes, packed, (m,), and of each its levels' first texel, height and width.

        The latter is (textures, levels, 3); small textures repeat their last level. Around every level there is
        one texel more, that of the other side.
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
        """Each once."""
        return list({id(mesh.texture): mesh.texture for mesh in self.meshes if mesh.texture is not None}.values())

    def _per_face(self, values: Iterable[int]) -> NDArray:
        return np.repeat(np.array(list(values), int), [len(mesh.faces) for mesh in self.meshes])


@dataclass(frozen=True)
class SceneGeometry:
    """The triangles of a scene where they are; what only the shading needs is made when it asks."""

    topology: SceneTopology
    meshes: tuple[Mesh, ...]

    @classmethod
    def of(cls, meshes: Sequence[Mesh], last: SceneGeometry | None = None) -> SceneGeometry:
        """Of a scene; the ``last`` one as far as it is the same."""
        if last is not None and len(meshes) == len(last.meshes) and all(map(operator.is_, meshes, last.meshes)):
            return last  # the very objects, and frozen: nothing in them changed
        kept = last is not None and last.topology.matches(meshes)
        return cls(last.topology if last is not None and kept else SceneTopology(tuple(meshes)), tuple(meshes))

    @cached_property
    def vertices(self) -> Floats:
        """(n, 3) world."""
        return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in self.meshes)])

    @cached_property
    def normals(self) -> tuple[Floats, Floats]:
        """Of the faces, (k, 3), and of the vertices, (n, 3)."""
        return normals(self.vertices, self.topology.faces, self.topology.smooth)

    def shadows(self, lighting: Lighting) -> Shadows:
        """What stands in a light; the last one asked for is kept."""
        kept: Shadows | None = self.__dict__.get("_shadows")
        if kept is None or kept.direction != lighting.direction:
            kept = cast_shadows(self, lighting)
            self.__dict__["_shadows"] = kept
        return kept


@dataclass(frozen=True)
class Shadows:
    """A map of what a far light meets first.

    Attributes:
        direction: to the light.
        P: projection into the map, (3, 4).
        nearest: inverse depth from the light of what it meets first, (s, s) float32, 0 where nothing stands.
        bias: by how much more inverse depth something must have to shade a surface that faces the light.
    """

    direction: tuple[float, float, float]
    P: NDArray[np.float64]
    nearest: Floats
    bias: float

    @cached_property
    def blocks(self) -> Floats:
        """The nearest in every block of the map, for the rasteriser."""
        return nearest_blocks(self.nearest)


def cast_shadows(geometry: SceneGeometry, lighting: Lighting) -> Shadows:
    """Look from the light.

    Only faces turned to the light cast shadows: that is all a closed body needs, and a room, whose walls face inwards,
    lets the light in. The floor and the walls that the light falls on have nothing behind them. The map just holds
    what is left.
    """
    vertices, direction = geometry.vertices, np.array(lighting.direction)
    nearest = np.zeros((SHADOW_SIZE, SHADOW_SIZE), np.float32)
    faces, low, high = casters(vertices, geometry.topology.faces, geometry.normals[0], direction)
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-3)
    R, half = facing(direction), SHADOW_SIZE / 2
    K = np.array([[half * (_LIGHT_DISTANCE - 1), 0, half], [0, half * (_LIGHT_DISTANCE - 1), half], [0, 0, 1]])
    P = K @ np.column_stack([R, -R @ (middle + _LIGHT_DISTANCE * radius * direction)])
    rasterise(vertices, faces, P, radius, nearest, np.full(nearest.shape, -1, np.int32))
    bias = BIAS * (radius / half) / (_LIGHT_DISTANCE * radius) ** 2  # of inverse depth, where all is about as far
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
    """A texture, and half its size, and half of that, down to one texel."""
    picture = texture
    while True:
        yield picture
        height, width = picture.shape[:2]
        if height == width == 1:
            return
        size = (max(1, width // 2), max(1, height // 2))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
