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

from mvpose.camera import Camera
from simharness.capture.rendering.backgrounds import Background, Backgrounds, LitBackground, fill_empty
from simharness.capture.rendering.lens import through_lens
from simharness.capture.rendering.lit_scene import LitScene
from simharness.capture.rendering.raster_kernels import LONGEST_SIDE, pixels_of, rasterise
from simharness.capture.rendering.renderer import DAYLIGHT, NEAR, Image, Renderer, Unavailable, check_count
from simharness.capture.rendering.scene_geometry import SceneGeometry
from simharness.capture.rendering.shading_kernels import DistantLight, shade
from simharness.capture.rendering.shadow_maps import NO_SHADOW, SHADOW_SIZE, LightView, shadow_places
from simharness.capture.rendering.surface_kernels import DrawnPixels, PixelRays
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
    """Draw the moving meshes over the background of a camera."""
    geometry, background = scene.geometry, _background(scene, camera)
    topology, (width, height) = geometry.topology, camera.size
    inverse_depth, triangle, first = background.inverse_depth.copy(), background.triangle.copy(), topology.still[0]
    moving = pixels_of(geometry.moving_vertices, projection_matrix(camera))
    corners = np.concatenate([background.corners, moving])
    rasterise(topology.faces, corners, NEAR, inverse_depth, triangle, first)
    view, drawn = PixelRays(camera.center, background.to_rays), DrawnPixels(triangle, inverse_depth, corners)
    rgb = np.zeros((height, width, 3), np.uint8)
    if color:
        scene.lit = sources = LitScene.in_light(geometry, lighting, scene.lit)
        if sources is not None:
            rgb = sources.draw(sources.background(background, view), drawn, view)
        else:
            lit, maps = _lit(background, geometry, view, lighting), geometry.shadows(lighting)
            rgb = lit.rgb.copy()
            if len(topology.faces):
                # New are the moving meshes, and what of the others their shadows may fall on.
                shaded_from = np.append(maps.moving.blocks, np.float32(0.0))
                new = drawn.shown((triangle >= first) | (shaded_from[lit.shadow_place] > lit.shadow_depth))
                light = _distant(lighting, maps.light)
                shade(new, drawn, geometry.faces, view, light, (maps.still, maps.moving), rgb)
    with np.errstate(divide="ignore"):
        depth = np.reciprocal(inverse_depth)  # infinite without a surface
    ids = np.take(topology.mesh, triangle, mode="wrap")  # the last is none's
    return Image(rgb=rgb, depth=depth, ids=ids, parts=topology.parts[triangle] if parts else None)


def _background(scene: _Scene, camera: Camera) -> Background:
    """Return what a camera sees of the still meshes of a scene."""
    projection, shape = projection_matrix(camera), camera.size[::-1]
    found = scene.backgrounds.find(projection, camera.size)
    if found is None:
        still = scene.geometry.still
        inverse_depth, triangle = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
        corners = pixels_of(still.vertices, projection)
        rasterise(still.topology.faces, corners, NEAR, inverse_depth, triangle, 0)
        found = Background(np.ascontiguousarray(np.linalg.inv(projection[:, :3])), inverse_depth, triangle, corners)
        scene.backgrounds.keep(projection, camera.size, found)
    return found


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
            shade(drawn.shown(drawn.triangle >= 0), drawn, geometry.faces, view, light, (maps.still, NO_SHADOW), rgb)
        background.lit = LitBackground(lighting, maps.light, rgb, *places)
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
