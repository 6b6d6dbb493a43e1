"""The renderer that needs nothing: a z-buffer and one shading pass, compiled by numba.

Depth and ids are exact at pixel centres: the ray of every pixel is met with every triangle in float64 (see
:func:`simharness.rendering.kernels.rasterise`), no sampling pattern, no fixed-point grid.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.rendering.mesh import Mesh
from simharness.rendering.renderer import BACKGROUND, NEAR, TO_LIGHT, Image, check_scene

_LIGHT_DISTANCE = 20.0  # in radii of the scene: its rays are all but parallel
_SHADOW_SIZE = 1024
_MOST_MESHES = np.iinfo(np.int16).max


class RasterRenderer:
    """Renders on one core of any machine. The last scene is kept: all views of a frame share its shadows."""

    def __init__(self) -> None:
        self._soup = _Soup(())

    def render(self, camera: Camera, meshes: Sequence[Mesh], *, color: bool = True) -> Image:
        """Picture ``meshes`` as ``camera`` sees them: see :class:`~simharness.rendering.renderer.Renderer`."""
        check_scene(camera, meshes, most=_MOST_MESHES)
        if not self._soup.holds(meshes):
            self._soup = _Soup(tuple(meshes))
        soup = self._soup
        width, height = camera.size
        inverse_depth, triangle = _rasterise(soup.vertices, soup.faces, camera.P, (height, width))
        rgb = np.zeros((height, width, 3), np.uint8)
        if color:
            rgb = _shade(soup, camera, inverse_depth, triangle)
        with np.errstate(divide="ignore"):
            depth = np.float32(1) / inverse_depth
        return Image(rgb=rgb, depth=depth, ids=soup.mesh[triangle])


@dataclass(frozen=True)
class _Soup:
    """All triangles of a scene; what only the shading needs is made when it asks."""

    meshes: tuple[Mesh, ...]

    def holds(self, meshes: Sequence[Mesh]) -> bool:
        """Whether these are the very meshes, object by object; they are frozen, so nothing in them changed."""
        return len(meshes) == len(self.meshes) and all(map(operator.is_, meshes, self.meshes))

    @cached_property
    def vertices(self) -> NDArray[np.float32]:
        """(n, 3) world."""
        return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in self.meshes)])

    @cached_property
    def faces(self) -> NDArray[np.int32]:
        """(k, 3) into all vertices."""
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in self.meshes)]).astype(np.int32)
        parts = [mesh.faces + start for mesh, start in zip(self.meshes, starts, strict=False)]
        return np.concatenate([np.zeros((0, 3), np.int32), *parts])

    @cached_property
    def mesh(self) -> NDArray[np.int16]:
        """Index of the mesh of every face; one entry more, -1, for face -1: nothing. (k + 1,)."""
        return np.append(self._per_face(range(len(self.meshes))), -1).astype(np.int16)

    @cached_property
    def colors(self) -> NDArray[np.float32]:
        """(k, 3)."""
        return np.concatenate([np.zeros((0, 3), np.float32), *(mesh.colors for mesh in self.meshes)])

    @cached_property
    def smooth(self) -> NDArray[np.bool_]:
        """(k,)."""
        return self._per_face(mesh.smooth for mesh in self.meshes).astype(bool)

    @cached_property
    def normals(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Of the faces, (k, 3), and of the vertices, (n, 3)."""
        from simharness.rendering.kernels import normals

        return normals(self.vertices, self.faces, self.smooth)

    @cached_property
    def light(self) -> tuple[NDArray[np.float64], float]:
        """Projection (3, 4) of a far light into a square map that just holds the scene; its pixel in m."""
        low, high = (np.array([edge(axis) for axis in self.vertices.T], float) for edge in (np.min, np.max))
        middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-3)
        right = np.cross([0.0, 1.0, 0.0], TO_LIGHT)
        right /= np.linalg.norm(right)
        R = np.stack([right, np.cross(-TO_LIGHT, right), -TO_LIGHT])
        half = _SHADOW_SIZE / 2
        K = np.array([[half * (_LIGHT_DISTANCE - 1), 0, half], [0, half * (_LIGHT_DISTANCE - 1), half], [0, 0, 1]])
        return K @ np.column_stack([R, -R @ (middle + _LIGHT_DISTANCE * radius * TO_LIGHT)]), radius / half

    @cached_property
    def shadow(self) -> NDArray[np.float32]:
        """Inverse depth of what the light meets first, (s, s).

        Only faces turned to the light cast shadows: that is all a closed body needs, and a room, whose walls
        face inwards, lets the light in.
        """
        casting = self.faces[self.normals[0] @ TO_LIGHT.astype(np.float32) > 0]
        return _rasterise(self.vertices, casting, self.light[0], (_SHADOW_SIZE, _SHADOW_SIZE))[0]

    def _per_face(self, values: Iterable[int]) -> NDArray:
        return np.repeat(np.array(list(values), int), [len(mesh.faces) for mesh in self.meshes])


def _rasterise(
    vertices: NDArray[np.float32], faces: NDArray[np.int32], P: NDArray[np.float64], shape: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Inverse depth (h, w), 0 where nothing is, and the face seen (h, w), -1 where none."""
    from simharness.rendering.kernels import rasterise

    inverse_depth, triangle = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
    rasterise(vertices, faces, P, NEAR, inverse_depth, triangle)
    return inverse_depth, triangle


def _shade(
    soup: _Soup, camera: Camera, inverse_depth: NDArray[np.float32], triangle: NDArray[np.int32]
) -> NDArray[np.uint8]:
    from simharness.rendering.kernels import shade

    if not len(soup.faces):
        return np.full((*triangle.shape, 3), np.round(255 * np.array(BACKGROUND)), np.uint8)
    face_normals, vertex_normals = soup.normals
    light_P, texel = soup.light
    rays = np.ascontiguousarray(np.linalg.inv(camera.P[:, :3]))
    return shade(
        triangle,
        inverse_depth,
        soup.vertices,
        soup.faces,
        soup.colors,
        soup.smooth,
        face_normals,
        vertex_normals,
        camera.center,
        rays,
        TO_LIGHT,
        light_P,
        soup.shadow,
        texel,
        np.array(BACKGROUND),
    )
