"""The second renderer: pyrender on EGL, off-screen, no display. It checks the rasteriser and uses a GPU where one is.

One pass carries everything: colour in RGB, depth in the z-buffer, and the id in alpha, as (id + 1) / 255, which
8 bits hold exactly. Multi-sampling would blend ids and take depth from beside the pixel's centre (measured: 30 %
of the pixels more than 5 mm wrong), so the frame buffer has one sample a pixel.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from simharness.rendering.mesh import Mesh
from simharness.rendering.renderer import BACKGROUND, NEAR, TO_LIGHT, Image, Unavailable, check_scene

_FAR = 200.0  # metres; 24 bits of depth between it and NEAR are 0.04 mm at 6 m
_MOST_MESHES = 254
_TO_GL = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL cameras look along -z with y up


class GlRenderer:
    """Renders with OpenGL. The last scene stays uploaded: all views of a frame share it.

    Raises:
        Unavailable: no EGL context can be made here; the message has the reason.
    """

    def __init__(self) -> None:
        # PyOpenGL binds to one platform at its first import; pyglet, which pyrender imports, asks for a display.
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        os.environ.setdefault("PYGLET_HEADLESS", "1")
        try:
            import pyrender
            from pyrender.platforms.egl import EGLPlatform, get_device_by_index

            device = get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0")))
            self._platform = EGLPlatform(1, 1, device=device)
            self._platform.init_context()
        except Exception as error:  # missing libraries, drivers and devices surface as a dozen types
            raise Unavailable(
                f"no EGL context can be made ({type(error).__name__}: {error}); install the GL libraries (Debian: "
                "apt-get install libegl1 libopengl0 libgl1 libgl1-mesa-dri) or use the renderer 'raster'"
            ) from error
        self._pyrender = pyrender
        self._renderer = _single_sample_renderer()
        self._meshes: tuple[Mesh, ...] | None = None
        self._scene: Any = None

    def render(self, camera: Camera, meshes: Sequence[Mesh], *, color: bool = True) -> Image:
        """Picture ``meshes`` as ``camera`` sees them: see :class:`~simharness.rendering.renderer.Renderer`.

        Raises:
            ValueError: lens distortion, skewed pixels, or more than 254 meshes.
        """
        check_scene(camera, meshes, most=_MOST_MESHES)
        if camera.K[0, 1]:
            raise ValueError(f"camera {camera.name!r} has skewed pixels, which 'gl' cannot draw: use 'raster'")
        flags = self._pyrender.RenderFlags
        self._platform.make_current()
        self._stage(meshes)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = camera.R.T, camera.center
        K = camera.K
        # OpenGL counts pixels from their corners, the project from their centres.
        lens = self._pyrender.IntrinsicsCamera(K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, znear=NEAR, zfar=_FAR)
        eye = self._scene.add(lens, pose=pose @ _TO_GL)
        try:
            self._scene.main_camera_node = eye
            self._renderer.viewport_width, self._renderer.viewport_height = camera.size
            wanted = flags.OFFSCREEN | flags.RGBA | flags.SKIP_CULL_FACES
            rgba, depth = self._renderer.render(self._scene, wanted if color else wanted | flags.FLAT)
        finally:
            self._scene.remove_node(eye)
        ids = rgba[..., 3].astype(np.int16) - 1
        rgb = np.ascontiguousarray(rgba[..., :3]) if color else np.zeros((*ids.shape, 3), np.uint8)
        return Image(rgb=rgb, depth=np.where(ids >= 0, depth, np.float32(np.inf)), ids=ids)

    def _stage(self, meshes: Sequence[Mesh]) -> None:
        """Put the meshes on stage, unless they stand there already: frozen, so the same objects are the same."""
        staged = self._meshes
        if staged is not None and len(meshes) == len(staged) and all(map(operator.is_, meshes, staged)):
            return
        scene = self._pyrender.Scene(bg_color=(*BACKGROUND, 0.0), ambient_light=(0.35, 0.35, 0.35))
        for index, mesh in enumerate(meshes):
            if len(mesh.faces):
                scene.add(self._pyrender.Mesh([self._primitive(mesh, index)]))
        scene.add(self._pyrender.DirectionalLight(color=np.ones(3), intensity=2.6), pose=_shining_from(TO_LIGHT))
        self._scene, self._meshes = scene, tuple(meshes)

    def _primitive(self, mesh: Mesh, index: int) -> Any:
        """Every face with corners of its own, so that it can have a colour of its own."""
        from simharness.rendering.kernels import normals

        of_face, of_vertex = normals(mesh.vertices, mesh.faces, np.full(len(mesh.faces), mesh.smooth))
        corners = mesh.faces.ravel()
        rgba = np.ones((len(corners), 4), np.float32)
        rgba[:, :3] = np.repeat(mesh.colors**2.2, 3, axis=0)  # to linear light
        material = self._pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(1.0, 1.0, 1.0, (index + 1) / 255),  # floats: integers would be read as 0..255
            metallicFactor=0.0,
            roughnessFactor=1.0,
            alphaMode="OPAQUE",
        )
        return self._pyrender.Primitive(
            positions=mesh.vertices[corners],
            normals=of_vertex[corners] if mesh.smooth else np.repeat(of_face, 3, axis=0),
            color_0=rgba,
            material=material,
            mode=self._pyrender.GLTF.TRIANGLES,
        )


def _shining_from(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose (4, 4) of a light that shines along its own -z, from a unit direction."""
    right = np.cross([0.0, 1.0, 0.0], direction)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(direction, right), direction])
    return pose


def _single_sample_renderer() -> Any:
    import pyrender
    from OpenGL import GL

    class SingleSample(pyrender.Renderer):
        """pyrender's renderer with its multi-sampled frame buffer at one sample a pixel."""

        def _configure_main_framebuffer(self) -> None:
            fresh = self._main_fb is None or self._main_fb_dims != (self.viewport_width, self.viewport_height)
            super()._configure_main_framebuffer()
            if not fresh:
                return
            for buffer, layout in ((self._main_cb_ms, GL.GL_RGBA), (self._main_db_ms, GL.GL_DEPTH_COMPONENT24)):
                GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
                GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, 0, layout, *self._main_fb_dims)

    return SingleSample(1, 1)
