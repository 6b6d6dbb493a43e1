"""Faces of a whole scene: merged triangles, their colours, labels and textures."""

import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering.surface_kernels import FaceArrays, packed
from simharness.types.mesh import Mesh

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class SceneTopology:
    """Faces of a scene with n vertices and k faces in total."""

    meshes: tuple[Mesh, ...]
    """Meshes in the order of their faces, those that are still first."""
    order: tuple[int, ...] = ()
    """Index of each of them in the scene, (meshes,); empty: in this order."""

    def matches(self, meshes: Sequence[Mesh], order: Sequence[int]) -> bool:
        """Return whether meshes are the same except for their vertex positions."""
        return (
            tuple(order) == self.order
            and len(meshes) == len(self.meshes)
            and all(map(_same_topology, meshes, self.meshes))
        )

    @cached_property
    def faces(self) -> NDArray[np.uint32]:
        """Indices of all faces into all vertices, (k, 3)."""
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in self.meshes)]).astype(np.int32)
        faces = [mesh.faces + start for mesh, start in zip(self.meshes, starts, strict=False)]
        return np.concatenate([np.zeros((0, 3), np.int32), *faces]).view(np.uint32)

    @cached_property
    def still(self) -> tuple[int, int]:
        """Number of faces and number of vertices of the still meshes, which come first."""
        meshes = [mesh for mesh in self.meshes if mesh.still]
        return sum(len(mesh.faces) for mesh in meshes), sum(len(mesh.vertices) for mesh in meshes)

    @cached_property
    def moving_faces(self) -> NDArray[np.uint32]:
        """Faces of the other meshes, with indices into their vertices alone."""
        faces, vertices = self.still
        return self.faces[faces:] - np.uint32(vertices)

    @cached_property
    def mesh(self) -> NDArray[np.int16]:
        """Mesh index of every face, then -1 for face -1 (no face), (k + 1,)."""
        return np.append(self._per_face(self.order or range(len(self.meshes))), -1).astype(np.int16)

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
    def emission(self) -> Floats:
        """Radiance that the faces send out, (k, 3)."""
        return np.repeat(
            np.array([mesh.emission for mesh in self.meshes], np.float32).reshape(-1, 3),
            [len(mesh.faces) for mesh in self.meshes],
            axis=0,
        )

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

    def face_arrays(self, face_normals: Floats, vertex_normals: Floats) -> FaceArrays:
        """Return the faces as the shading kernels take them, with normals (k, 3) and (n, 3)."""
        return FaceArrays(
            self.faces, self.colors, self.smooth, face_normals, vertex_normals, self.texture, self.uv, *self.pyramids
        )

    @cached_property
    def _textures(self) -> list[NDArray[np.uint8]]:
        """Distinct textures."""
        return list({id(mesh.texture): mesh.texture for mesh in self.meshes if mesh.texture is not None}.values())

    def _per_face(self, values: Iterable[int]) -> NDArray:
        return np.repeat(np.array(list(values), int), [len(mesh.faces) for mesh in self.meshes])


def _same_topology(one: Mesh, other: Mesh) -> bool:
    return (
        one.faces is other.faces
        and one.colors is other.colors
        and one.texture is other.texture
        and one.uv is other.uv
        and one.parts is other.parts
        and one.smooth == other.smooth
        and one.still == other.still
        and one.emission == other.emission
        and one.finish is other.finish
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


def same_meshes(meshes: Sequence[Mesh], others: Sequence[Mesh]) -> bool:
    """Return whether two lists hold the same frozen objects."""
    return len(meshes) == len(others) and all(map(operator.is_, meshes, others))
