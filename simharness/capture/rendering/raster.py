"""Software renderer without dependencies on the machine: a z-buffer and one shading pass, compiled by numba.

Depth and ids are exact at pixel centres: the ray of every pixel is intersected with the triangles in float64 (see
:func:`simharness.capture.rendering.raster_kernels.rasterise`), without a sampling pattern or fixed-point grid.

Meshes that stay where they are (``Mesh.still``) are drawn first, and the others over them, so that what a camera sees
of the former can be kept for its next picture; a picture is the same to the bit whether it was kept or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.backgrounds import Background, Backgrounds, LitBackground, fill_empty
from simharness.capture.rendering.lens import through_lens
from simharness.capture.rendering.lit_scene import LitScene
from simharness.capture.rendering.raster_kernels import LONGEST_SIDE, NOTHING_DRAWN, draw_projected, rasterise
from simharness.capture.rendering.renderer import DAYLIGHT, NEAR, Image, check_count
from simharness.capture.rendering.scene_geometry import SceneGeometry
from simharness.capture.rendering.shading_kernels import shade
from simharness.capture.rendering.shadow_maps import NO_SHADOW, SHADOW_SIZE, ShadowMap, shadow_places
from simharness.capture.rendering.vertex_kernels import (
    covering_spans,
    lifted,
    project_vertices,
    put_back,
    resolve,
    whole,
)
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.world.rigs.projection import projection_matrix

_MOST_MESHES = np.iinfo(np.int16).max
_KEPT_SCENES = 2  # a scene and its reflection in a mirror


@dataclass
class _Scene:
    """Scene at the time of the last picture, and what cameras see of its still meshes."""

    geometry: SceneGeometry
    backgrounds: Backgrounds = field(default_factory=Backgrounds)


class RasterRenderer:
    """Renderer on one CPU core.

    It keeps the last scenes, so that all views of a frame share its shadows, and what cameras see of meshes that stay
    where they are, within a limit of memory.
    """

    def __init__(self) -> None:
        self._scenes: list[_Scene] = []

    def render(
        self,
        camera: Camera,
        meshes: Sequence[Mesh],
        *,
        color: bool = True,
        lighting: Lighting = DAYLIGHT,
        parts: bool = False,
    ) -> Image:
        """Render ``meshes`` from ``camera``: see :class:`~simharness.capture.rendering.renderer.Renderer`.

        Raises:
            ValueError: too many meshes, or a picture with a side above ``LONGEST_SIDE``.
        """
        if max(camera.size) > LONGEST_SIDE:
            raise ValueError(
                f"camera {camera.name!r}: a picture must have at most {LONGEST_SIDE} pixels a side, got "
                f"{camera.size[0]} x {camera.size[1]}"
            )
        check_count(meshes, most=_MOST_MESHES)
        scene = self._scene(meshes)
        return through_lens(camera, lambda pinhole: _picture(scene, pinhole, color, lighting, parts))

    def _scene(self, meshes: Sequence[Mesh]) -> _Scene:
        """Return the scene of these meshes: the last one with the same still meshes, moved on."""
        for scene in self._scenes:
            if scene.geometry.still.holds(meshes):
                scene.geometry = SceneGeometry.of(meshes, scene.geometry)
                return scene
        scene = _Scene(SceneGeometry.of(meshes))
        self._scenes = [scene, *self._scenes][:_KEPT_SCENES]
        return scene


def _picture(scene: _Scene, camera: Camera, color: bool, lighting: Lighting, parts: bool) -> Image:
    """Draw the moving meshes into the background of a camera, and take them out again when the picture is done."""
    geometry, background = scene.geometry, _background(scene, camera)
    topology, (width, height) = geometry.topology, camera.size
    inverse_depth, triangle, first = background.inverse_depth, background.triangle, topology.still[0]
    corners, seen, codes = project_vertices(
        geometry.vertices, projection_matrix(camera), NEAR, background.corners, width, height
    )
    rays = background.to_rays
    sources = LitScene.of(geometry, lighting) if color else None
    if sources is not None:
        lit = sources.background(background, camera, rays)
    elif color:
        lit = _lit(background, geometry, camera, lighting)
    else:
        rgb = np.zeros((height, width, 3), np.uint8)
    depth, ids = background.depth.copy(), _ids(background, topology.mesh).copy()
    spans = covering_spans(codes, topology.moving_starts, height, width)
    hidden = lifted(spans, inverse_depth, triangle)
    try:
        draw_projected(topology.faces, corners, seen, codes, NEAR, inverse_depth, triangle, first)
        resolve(spans, inverse_depth, triangle, topology.mesh, depth, ids)
        labels = topology.parts[triangle] if parts else None
        if sources is not None:
            rgb = sources.draw(lit, (spans, triangle, inverse_depth, corners), camera, rays)
        elif color:
            rgb, moving = lit.rgb.copy(), geometry.shadows(lighting).moving
            drawn = triangle, inverse_depth, corners
            _shade(geometry, camera, rays, lighting, *drawn, moving, lit.shadow_place, lit.shadow_depth, first, rgb)
    finally:
        put_back(spans, *hidden, inverse_depth, triangle)
    return Image(rgb=rgb, depth=depth, ids=ids, parts=labels)


def _background(scene: _Scene, camera: Camera) -> Background:
    """Return what a camera sees of the still meshes of a scene."""
    projection, shape = projection_matrix(camera), camera.size[::-1]
    found = scene.backgrounds.find(projection, camera.size)
    if found is None:
        still = scene.geometry.still
        inverse_depth, triangle = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
        faces = still.topology.faces
        corners = rasterise(still.vertices, faces, projection, NEAR, inverse_depth, triangle, NOTHING_DRAWN, 0)
        depth, labels, ids = np.empty(shape, np.float32), scene.geometry.topology.mesh, np.empty(shape, np.int16)
        resolve(whole(*shape), inverse_depth, triangle, labels, depth, ids)
        rays = np.ascontiguousarray(np.linalg.inv(projection[:, :3]))
        found = Background(rays, inverse_depth, triangle, corners, depth, labels, ids)
        scene.backgrounds.keep(projection, camera.size, found)
    return found


def _ids(background: Background, labels: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return the mesh at every pixel of a background; it changes with the order of the meshes in the scene."""
    if background.labels is not labels:
        background.labels, background.ids = labels, labels[background.triangle]
    return background.ids


def _lit(background: Background, geometry: SceneGeometry, camera: Camera, lighting: Lighting) -> LitBackground:
    """Return the background in a light; the last one is kept."""
    shadows, seen = geometry.shadows(lighting), (background.triangle, background.inverse_depth)
    if background.lit is None or background.lit.lighting != lighting or background.lit.light != shadows.light:
        rgb = np.empty((*background.triangle.shape, 3), np.uint8)
        fill_empty(rgb, background.triangle < 0, lighting, background.to_rays)
        place, depth = shadow_places(*seen, camera.center, background.to_rays, shadows.light.P, SHADOW_SIZE)
        _shade(
            geometry, camera, background.to_rays, lighting, *seen, background.corners, NO_SHADOW, place, depth, 0, rgb
        )
        background.lit = LitBackground(lighting, shadows.light, rgb, place, depth, np.zeros((0, 5), np.int32))
    return background.lit


def _shade(
    geometry: SceneGeometry,
    camera: Camera,
    rays: NDArray[np.float64],
    lighting: Lighting,
    triangle: NDArray[np.int32],
    inverse_depth: NDArray[np.float32],
    corners: NDArray[np.float64],
    moving: ShadowMap,
    shadow_place: NDArray[np.uint16],
    shadow_depth: NDArray[np.float32],
    first_face: int,
    rgb: NDArray[np.uint8],
) -> None:
    """Colour a picture in place; see :func:`~simharness.capture.rendering.shading_kernels.shade`."""
    topology, shadows = geometry.topology, geometry.shadows(lighting)
    if not len(topology.faces):
        return
    shade(
        triangle,
        inverse_depth,
        corners,
        topology.faces,
        topology.colors,
        topology.smooth,
        *geometry.normals,
        topology.texture,
        topology.uv,
        *topology.pyramids,
        camera.center,
        rays,
        np.array(lighting.direction),
        np.array([lighting.key, lighting.sky, lighting.fill]),
        255 * np.sqrt(lighting.tint),  # sRGB is about the square root of linear light
        shadows.light.P,
        shadows.light.bias,
        shadows.still.nearest,
        shadows.still.blocks,
        moving.nearest,
        moving.blocks,
        shadow_place,
        shadow_depth,
        first_face,
        rgb,
    )
