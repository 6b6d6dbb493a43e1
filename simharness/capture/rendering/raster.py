"""Software renderer without dependencies on the machine: a z-buffer and one shading pass, compiled by numba.

Depth and ids are exact at pixel centres: the ray of every pixel is intersected with the triangles in float64 (see
:func:`simharness.capture.rendering.raster_kernels.rasterise`), without a sampling pattern or fixed-point grid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.lens import through_lens
from simharness.capture.rendering.raster_kernels import rasterise, resolve
from simharness.capture.rendering.renderer import DAYLIGHT, NEAR, Image, check_count
from simharness.capture.rendering.scene_geometry import SceneGeometry
from simharness.capture.rendering.shading_kernels import shade
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.world.rigs.projection import projection_matrix

_MOST_MESHES = np.iinfo(np.int16).max


class RasterRenderer:
    """Renderer on one CPU core. The last scene is kept, so all views of a frame share its shadows."""

    def __init__(self) -> None:
        self._geometry = SceneGeometry.of(())
        self._inverse_depth, self._triangle = np.zeros((0, 0), np.float32), np.zeros((0, 0), np.int32)

    def render(
        self,
        camera: Camera,
        meshes: Sequence[Mesh],
        *,
        color: bool = True,
        lighting: Lighting = DAYLIGHT,
        parts: bool = False,
    ) -> Image:
        """Render ``meshes`` from ``camera``: see :class:`~simharness.capture.rendering.renderer.Renderer`."""
        check_count(meshes, most=_MOST_MESHES)
        self._geometry = SceneGeometry.of(meshes, self._geometry)
        return through_lens(camera, lambda pinhole: self._picture(pinhole, color, lighting, parts))

    def _picture(self, camera: Camera, color: bool, lighting: Lighting, parts: bool) -> Image:
        geometry, shape = self._geometry, camera.size[::-1]
        inverse_depth, triangle = self._buffers(shape)
        projection = projection_matrix(camera)
        q = rasterise(geometry.vertices, geometry.topology.faces, projection, NEAR, inverse_depth, triangle)
        depth, ids = resolve(inverse_depth, triangle, geometry.topology.mesh)
        return Image(
            rgb=_shaded(geometry, camera, lighting, inverse_depth, triangle, q)
            if color
            else np.zeros((*shape, 3), np.uint8),
            depth=depth,
            ids=ids,
            parts=geometry.topology.parts[triangle] if parts else None,
        )

    def _buffers(self, shape: tuple[int, int]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Return cleared buffers of inverse depth and face per pixel; they reuse the memory of the last picture."""
        if self._triangle.shape != shape:
            self._inverse_depth, self._triangle = np.empty(shape, np.float32), np.empty(shape, np.int32)
        self._inverse_depth.fill(0)
        self._triangle.fill(-1)
        return self._inverse_depth, self._triangle


def _shaded(
    geometry: SceneGeometry,
    camera: Camera,
    lighting: Lighting,
    inverse_depth: NDArray[np.float32],
    triangle: NDArray[np.int32],
    q: NDArray[np.float64],
) -> NDArray[np.uint8]:
    empty = np.round(255 * np.array(lighting.background))
    if not len(geometry.topology.faces):
        return np.full((*triangle.shape, 3), empty, np.uint8)
    topology, shadows = geometry.topology, geometry.shadows(lighting)
    return shade(
        triangle,
        inverse_depth,
        q,
        topology.faces,
        topology.colors,
        topology.smooth,
        *geometry.normals,
        topology.texture,
        topology.uv,
        *topology.pyramids,
        camera.center,
        np.ascontiguousarray(np.linalg.inv(projection_matrix(camera)[:, :3])),
        np.array(lighting.direction),
        np.array([lighting.key, lighting.sky, lighting.fill]),
        255 * np.sqrt(lighting.tint),  # sRGB is about the square root of linear light
        empty,
        shadows.P,
        shadows.nearest,
        shadows.blocks,
        shadows.bias,
    )
