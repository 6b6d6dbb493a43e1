"""OpenGL renderer: pyrender on EGL, off-screen, without a display. It uses a GPU if there is one, and verifies raster.

One pass gives colour in RGB, depth in the z-buffer, and the id in alpha as (id + 1) / 255, which 8 bits represent
exactly; parts need a second pass. Multi-sampling would blend ids and take depth away from the pixel centre (measured:
30 % of the pixels wrong by more than 5 mm), so the frame buffer has one sample per pixel.

The files in ``shaders`` implement the lighting, shadows and textures of the rasteriser, and use the shadow map that its
kernel draws. So pictures look the same with both renderers in lighting in closed form. Lighting with sources (lamps and
windows of rooms) is shown by its nearest closed form, which is what
:class:`~simharness.types.lighting.Lighting` holds beside them.
"""

import os
import shutil
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.capture.rendering.backgrounds import fill_empty
from simharness.capture.rendering.lens import through_lens
from simharness.capture.rendering.renderer import DAYLIGHT, NEAR, Image, Unavailable, check_count
from simharness.capture.rendering.scene_geometry import SceneGeometry, normals
from simharness.capture.rendering.scene_topology import pyramid
from simharness.capture.rendering.shading_kernels import LEAST_COSINE
from simharness.capture.rendering.shadow_maps import Shadows
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.world.rigs.projection import projection_matrix

_FAR = 200.0  # metres; 24 bits of depth between NEAR and this resolve 0.04 mm at 6 m
_MOST_MESHES = 254
_TO_GL = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL cameras look along -z with y up
_SHADERS = {"mesh": ("corners.vert", "shaded.frag"), "flat": ("corners.vert", "flat.frag")}
"""Files of the shaders of pictures, and of those of ids and parts alone, by the names that pyrender expects."""
_SHADOW_UNIT = 8  # texture unit of the shadow map; pyrender uses units from 0


class GlRenderer:
    """Renderer on OpenGL. The last scene stays uploaded, so all views of a frame share it.

    Raises:
        Unavailable: pyrender is not installed or no EGL context can be created; the message gives the reason.
    """

    def __init__(self) -> None:
        if find_spec("pyrender") is None:
            raise Unavailable(
                "pyrender is not installed; pip install 'simharness[gl]' (in a checkout: pip install -e '.[gl]') "
                "or use the renderer 'raster'"
            )
        # PyOpenGL binds to one platform at its first import; pyglet, which pyrender imports, needs a display otherwise.
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        os.environ.setdefault("PYGLET_HEADLESS", "1")
        try:
            import pyrender
            from pyrender.platforms.egl import EGLPlatform, get_device_by_index

            device = get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0")))
            self._platform = EGLPlatform(1, 1, device=device)
            self._platform.init_context()
        except Exception as error:  # missing libraries, drivers and devices raise a dozen exception types
            raise Unavailable(
                f"no EGL context can be created ({type(error).__name__}: {error}); install the GL libraries (Debian: "
                "apt-get install libegl1 libopengl0 libgl1 libgl1-mesa-dri) or use the renderer 'raster'"
            ) from error
        self._pyrender = pyrender
        self._renderer = _renderer()
        self._geometry: SceneGeometry | None = None
        self._scene: Any = None
        self._staged: dict[tuple[int, int], tuple[Mesh, Any]] = {}
        self._textures: dict[int, tuple[NDArray[np.uint8], Any]] = {}

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
            ValueError: skewed pixels, more than 254 meshes, or a lens that distorts too much.
        """
        check_count(meshes, most=_MOST_MESHES)
        if camera.K[0, 1]:
            raise ValueError(f"camera {camera.name!r} has skewed pixels, which 'gl' cannot draw: use 'raster'")
        self._platform.make_current()
        self._stage(meshes)
        return through_lens(camera, lambda pinhole: self._picture(pinhole, color, lighting, parts))

    def _picture(self, camera: Camera, color: bool, lighting: Lighting, parts: bool) -> Image:
        flags, width, height = self._pyrender.RenderFlags, *camera.size
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = camera.R.T, camera.center
        K = camera.K
        # OpenGL places integer pixel coordinates at pixel corners, this project at pixel centres.
        lens = self._pyrender.IntrinsicsCamera(K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, znear=NEAR, zfar=_FAR)
        node = self._scene.add(lens, pose=pose @ _TO_GL)
        try:
            self._scene.main_camera_node = node
            self._scene.bg_color = (*lighting.background, 0.0)
            self._renderer.viewport_width, self._renderer.viewport_height = width, height
            wanted = flags.OFFSCREEN | flags.RGBA | flags.SKIP_CULL_FACES
            rgb, labels = np.zeros((height, width, 3), np.uint8), None
            if color:
                assert self._geometry is not None  # set by _stage()
                self._renderer.light(lighting, self._geometry)
                rgba, depth = self._renderer.render(self._scene, wanted)
                rgb = np.ascontiguousarray(rgba[..., :3])
                if lighting.panorama is not None:
                    rays = np.linalg.inv(projection_matrix(camera)[:, :3].astype(np.float64))
                    fill_empty(rgb, rgba[..., 3] == 0, lighting, rays)
            if parts or not color:
                rgba, depth = self._renderer.render(self._scene, wanted | flags.FLAT)
        finally:
            self._scene.remove_node(node)
        ids = rgba[..., 3].astype(np.int16) - 1
        if parts:
            labels = np.where(ids >= 0, rgba[..., 0].astype(np.int16) - 1, -1).astype(np.int8)
        return Image(rgb=rgb, depth=np.where(ids >= 0, depth, np.float32(np.inf)), ids=ids, parts=labels)

    def _stage(self, meshes: Sequence[Mesh]) -> None:
        """Upload the meshes; those that are already uploaded (the same objects) are kept."""
        geometry = SceneGeometry.from_meshes(meshes, self._geometry)
        if geometry is self._geometry:
            return
        scene = self._pyrender.Scene()
        staged: dict[tuple[int, int], tuple[Mesh, Any]] = {}
        textures: dict[int, tuple[NDArray[np.uint8], Any]] = {}
        for index, mesh in enumerate(meshes):
            if not len(mesh.faces):
                continue
            if mesh.texture is not None:
                key = id(mesh.texture)
                textures[key] = self._textures.get(key) or (mesh.texture, _texture(mesh.texture))
            kept = self._staged.get((id(mesh), index))
            if kept is None:
                kept = mesh, self._pyrender.Mesh([self._primitive(mesh, index, textures)])
            staged[id(mesh), index] = kept
            scene.add(kept[1])
        self._scene, self._geometry, self._staged, self._textures = scene, geometry, staged, textures

    def _primitive(self, mesh: Mesh, index: int, textures: dict[int, tuple[NDArray[np.uint8], Any]]) -> Any:
        """Return the GL primitive of a mesh, with separate corners for every face so that each can have its colour."""
        of_face, of_vertex = normals(mesh.vertices, mesh.faces.view(np.uint32), np.full(len(mesh.faces), mesh.smooth))
        corners = mesh.faces.ravel()
        colors = np.zeros((len(corners), 4), np.float32)
        colors[:, :3] = np.repeat(mesh.colors, 3, axis=0)
        if mesh.parts is not None:
            colors[:, 3] = np.repeat((mesh.parts + 1) / np.float32(255), 3)
        material = self._pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(1.0, 1.0, 1.0, (index + 1) / 255),  # floats: integers would be read as 0..255
            baseColorTexture=None if mesh.texture is None else textures[id(mesh.texture)][1],
            alphaMode="OPAQUE",
        )
        return self._pyrender.Primitive(
            positions=mesh.vertices[corners],
            normals=of_vertex[corners] if mesh.smooth else np.repeat(of_face, 3, axis=0),
            texcoord_0=None if mesh.uv is None else mesh.uv.reshape(-1, 2) * [1, -1] + [0, 1],  # v is up in OpenGL
            color_0=colors,
            material=material,
            mode=self._pyrender.GLTF.TRIANGLES,
        )


def _texture(picture: NDArray[np.uint8]) -> Any:
    """Return a texture with the mipmap levels of the rasteriser, because drivers differ in how they halve odd sizes."""
    import pyrender
    from OpenGL import GL

    class MipmappedTexture(pyrender.Texture):
        def _add_to_context(self) -> None:
            super()._add_to_context()
            GL.glBindTexture(self.tex_type, self._texid)
            for level, smaller in enumerate(pyramid(picture)):
                upright, (height, width) = np.ascontiguousarray(smaller[::-1]), smaller.shape[:2]
                GL.glTexImage2D(
                    self.tex_type, level, GL.GL_RGB8, width, height, 0, GL.GL_RGB, GL.GL_UNSIGNED_BYTE, upright
                )
            GL.glBindTexture(self.tex_type, 0)

    sampler = pyrender.Sampler(minFilter=pyrender.GLTF.LINEAR_MIPMAP_NEAREST)
    return MipmappedTexture(source=picture, source_channels="RGB", sampler=sampler)


def _renderer() -> Any:
    import pyrender
    from OpenGL import GL
    from pyrender.shader_program import ShaderProgramCache

    class ShaderRenderer(pyrender.Renderer):
        """Renderer of pyrender with the project's shaders, and one sample per pixel in the multi-sampled buffer."""

        def __init__(self) -> None:
            super().__init__(1, 1)
            self._folder = TemporaryDirectory(prefix="simharness-")  # pyrender reads shaders by fixed names
            for name, files in _SHADERS.items():
                for file in map((Path(__file__).parent / "shaders").joinpath, files):
                    shutil.copyfile(file, Path(self._folder.name, name).with_suffix(file.suffix))
            self._program_cache = ShaderProgramCache(self._folder.name)
            self._lighting = DAYLIGHT
            self._shadows: Shadows | None = None
            self._map: int | None = None
            GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)  # rows of textures are stored without padding

        def light(self, lighting: Lighting, geometry: SceneGeometry) -> None:
            """Set the lighting and the shadow map of a scene in it."""
            shadows = geometry.shadows(lighting)
            self._lighting = lighting
            GL.glActiveTexture(GL.GL_TEXTURE0 + _SHADOW_UNIT)
            if self._map is None:
                self._map = GL.glGenTextures(1)
            GL.glBindTexture(GL.GL_TEXTURE_2D, self._map)
            if shadows is not self._shadows:
                self._shadows = shadows
                size = shadows.nearest.shape
                GL.glTexImage2D(
                    GL.GL_TEXTURE_2D, 0, GL.GL_R32F, *size[::-1], 0, GL.GL_RED, GL.GL_FLOAT, shadows.nearest
                )
                for name in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
                    GL.glTexParameteri(GL.GL_TEXTURE_2D, name, GL.GL_NEAREST)
            GL.glActiveTexture(GL.GL_TEXTURE0)

        def _bind_lighting(self, scene: Any, program: Any, node: Any, flags: int) -> None:
            lighting, shadows = self._lighting, self._shadows
            assert shadows is not None  # light() is called first
            program.set_uniform("light", np.array(lighting.direction))
            program.set_uniform("strengths", np.array([lighting.key, lighting.sky, lighting.fill]))
            program.set_uniform("tint", np.array(lighting.tint))
            for name, row in zip(("light_x", "light_y", "light_w"), shadows.light.projection, strict=True):
                program.set_uniform(name, row)
            program.set_uniform("shadow_map", _SHADOW_UNIT)
            program.set_uniform("bias", float(shadows.light.bias))
            program.set_uniform("least_cosine", LEAST_COSINE)

        def _configure_main_framebuffer(self) -> None:
            fresh = self._main_fb is None or self._main_fb_dims != (self.viewport_width, self.viewport_height)
            super()._configure_main_framebuffer()
            if not fresh:
                return
            for buffer, layout in ((self._main_cb_ms, GL.GL_RGBA), (self._main_db_ms, GL.GL_DEPTH_COMPONENT24)):
                GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
                GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, 0, layout, *self._main_fb_dims)

    return ShaderRenderer()
