"""Software renderer without dependencies on the machine: a z-buffer and one shading pass, compiled by numba.

Depth and ids are exact at pixel centres: the ray of every pixel is intersected with the triangles in float64 (see
:func:`simharness.capture.rendering.raster_kernels.rasterise`), without a sampling pattern or fixed-point grid.

Meshes that stay where they are (``Mesh.still``) are drawn first, and the others over them, so that what a camera sees
of the former can be kept for its next picture; a picture is the same to the bit whether it was kept or not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.backgrounds import Background, Backgrounds, LitBackground, fill_empty
from simharness.capture.rendering.lens import through_lens
from simharness.capture.rendering.lit_scene import LitScene
from simharness.capture.rendering.raster_kernels import LONGEST_SIDE, draw_projected, rasterise
from simharness.capture.rendering.renderer import DAYLIGHT, NEAR, Image, Renderer, Unavailable, check_count
from simharness.capture.rendering.scene_geometry import SceneGeometry
from simharness.capture.rendering.shading_kernels import DistantLight, shade
from simharness.capture.rendering.shadow_maps import NO_SHADOW, SHADOW_SIZE, LightView, shadow_places
from simharness.capture.rendering.surface_kernels import DrawnPixels, PixelRays
from simharness.capture.rendering.vertex_kernels import (
    copied_pixels,
    covering_spans,
    mark_visible,
    picture_spans,
    project_vertices,
    restore_pixels,
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
    lit: LitScene | None = None


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
                scene.geometry = SceneGeometry.from_meshes(meshes, scene.geometry)
                return scene
        scene = _Scene(SceneGeometry.from_meshes(meshes))
        self._scenes = [scene, *self._scenes][:_KEPT_SCENES]
        return scene


def _picture(scene: _Scene, camera: Camera, color: bool, lighting: Lighting, parts: bool) -> Image:
    """Draw the moving meshes into the background of a camera, and take them out again when the picture is done."""
    geometry, background = scene.geometry, _background(scene, camera)
    topology, (width, height) = geometry.topology, camera.size
    inverse_depth, triangle, first = background.inverse_depth, background.triangle, topology.still[0]
    projected = project_vertices(geometry.vertices, projection_matrix(camera), NEAR, background.corners, width, height)
    view, drawn = PixelRays(camera.center, background.to_rays), DrawnPixels(triangle, inverse_depth, projected[0])
    sources = None
    if color:
        scene.lit = sources = LitScene.in_light(geometry, lighting, scene.lit)
    if sources is not None:
        lit = sources.background(background, view)
    elif color:
        lit = _lit(background, geometry, view, lighting)
    else:
        rgb = np.zeros((height, width, 3), np.uint8)
    ids = _ids(background, topology.mesh).copy()
    spans = covering_spans(projected[2], topology.moving_starts, height, width)
    hidden = copied_pixels(spans, inverse_depth, triangle)
    try:
        draw_projected(topology.faces, projected, NEAR, inverse_depth, triangle, first)
        mark_visible(spans, triangle, topology.mesh, ids)
        with np.errstate(divide="ignore"):
            depth = np.reciprocal(inverse_depth)  # infinite without a surface
        labels = topology.parts[triangle] if parts else None
        if sources is not None:
            rgb = sources.draw(lit, spans, drawn, view)
        elif color:
            rgb, maps = lit.rgb.copy(), geometry.shadows(lighting)
            if len(topology.faces):
                light, places = _distant(lighting, maps.light), (lit.shadow_place, lit.shadow_depth)
                shade(drawn, geometry.faces, view, light, (maps.still, maps.moving), places, first, rgb)
    finally:
        restore_pixels(spans, *hidden, inverse_depth, triangle)
    return Image(rgb=rgb, depth=depth, ids=ids, parts=labels)


def _background(scene: _Scene, camera: Camera) -> Background:
    """Return what a camera sees of the still meshes of a scene."""
    projection, shape = projection_matrix(camera), camera.size[::-1]
    found = scene.backgrounds.find(projection, camera.size)
    if found is None:
        still = scene.geometry.still
        inverse_depth, triangle = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
        faces = still.topology.faces
        corners = rasterise(still.vertices, faces, projection, NEAR, inverse_depth, triangle)
        labels, ids = scene.geometry.topology.mesh, np.empty(shape, np.int16)
        mark_visible(picture_spans(*shape), triangle, labels, ids)
        rays = np.ascontiguousarray(np.linalg.inv(projection[:, :3]))
        found = Background(rays, inverse_depth, triangle, corners, labels, ids)
        scene.backgrounds.keep(projection, camera.size, found)
    return found


def _ids(background: Background, labels: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return the mesh at every pixel of a background; it changes with the order of the meshes in the scene."""
    if background.labels is not labels:
        background.labels, background.ids = labels, labels[background.triangle]
    return background.ids


def _lit(background: Background, geometry: SceneGeometry, view: PixelRays, lighting: Lighting) -> LitBackground:
    """Return the background in a light; the last one is kept."""
    maps = geometry.shadows(lighting)
    if background.lit is None or background.lit.lighting != lighting or background.lit.light != maps.light:
        drawn = DrawnPixels(background.triangle, background.inverse_depth, background.corners)
        rgb = np.empty((*drawn.triangle.shape, 3), np.uint8)
        fill_empty(rgb, drawn.triangle < 0, lighting, view.to_rays)
        places = shadow_places(drawn.triangle, drawn.inverse_depth, view, maps.light.projection, SHADOW_SIZE)
        if len(geometry.topology.faces):
            light = _distant(lighting, maps.light)
            shade(drawn, geometry.faces, view, light, (maps.still, NO_SHADOW), places, 0, rgb)
        background.lit = LitBackground(lighting, maps.light, rgb, places[0], places[1], np.zeros((0, 5), np.int32))
    return background.lit


def _distant(lighting: Lighting, seen: LightView) -> DistantLight:
    """Return lighting in closed form as the kernels take it."""
    return DistantLight(
        np.array(lighting.direction),
        np.array([lighting.key, lighting.sky, lighting.fill]),
        255 * np.sqrt(lighting.tint),  # sRGB is about the square root of linear light
        seen.projection,
        seen.bias,
    )


RendererName = Literal["auto", "raster", "gl"]


def make_renderer(name: RendererName = "raster") -> Renderer:
    """Return the renderer of this name.

    Args:
        name: ``"raster"`` (numba, runs everywhere), ``"gl"`` (pyrender on EGL), or ``"auto"``: gl where it works, else
            raster.

    Raises:
        Unavailable: ``"gl"`` was requested and no context can be created.
        ValueError: an unknown name.
    """
    if name not in ("raster", "gl", "auto"):
        raise ValueError(f"renderer must be 'raster', 'gl' or 'auto', got {name!r}")
    if name == "raster":
        return RasterRenderer()
    from simharness.capture.rendering.gl import GlRenderer  # needs OpenGL, which not every machine has

    try:
        return GlRenderer()
    except Unavailable:
        if name == "gl":
            raise
        return RasterRenderer()
