"""OpenGL renderer: pyrender on EGL, off-screen, without a display. It uses a GPU if there is one, and verifies raster.

One pass gives colour in RGB, depth in the z-buffer, and the id in alpha as (id + 1) / 255, which 8 bits represent
exactly; parts need a second pass. Multi-sampling would blend ids and take depth away from the pixel centre (measured:
30 % of the pixels wrong by more than 5 mm), so the frame buffer has one sample per pixel.

The shaders at the end of this module implement the lighting, shadows and textures of the rasteriser, and use the shadow
map that its kernel draws. So pictures look the same with both renderers in lighting in closed form. Lighting with
sources (lamps and windows of rooms) is shown by its nearest closed form, which is what
:class:`~simharness.types.lighting.Lighting` holds beside them.
"""

from __future__ import annotations

import os
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
            self._folder = TemporaryDirectory(prefix="simharness-")  # pyrender reads shaders from files
            for name, text in _SHADERS.items():
                Path(self._folder.name, name).write_text(text, encoding="utf-8")
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


_CORNERS = """#version 330 core
// Faces with separate corners. pyrender replaces the names in capitals by attribute locations.

layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 corner;
#endif
layout(location = COLOR_0_LOC) in vec4 color;
layout(location = INST_M_LOC) in mat4 instance;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;

out vec3 at;
out vec3 outwards;
out vec2 place;
out vec4 albedo;

void main()
{
    vec4 world = M * instance * vec4(position, 1.0);
    gl_Position = P * V * world;
    at = world.xyz;
    outwards = normal;
#ifdef TEXCOORD_0_LOC
    place = corner;
#else
    place = vec2(0.0);
#endif
    albedo = color;
}
"""

_SHADED = """#version 330 core
// Shading rule of simharness.types.lighting.Lighting, as in simharness.capture.rendering.shading_kernels; id in alpha.

struct Material {
    vec4 base_color_factor;  // 1, 1, 1, id
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};

uniform Material material;
uniform vec3 cam_pos;
uniform vec3 light;      // unit direction to the key light
uniform vec3 strengths;  // strengths of key, sky and fill light
uniform vec3 tint;
uniform vec4 light_x;    // rows of the projection into the shadow map
uniform vec4 light_y;
uniform vec4 light_w;
uniform sampler2D shadow_map;  // inverse depth from the light of the first surface
uniform float bias;            // in inverse depth
uniform float least_cosine;

in vec3 at;
in vec3 outwards;
in vec2 place;
in vec4 albedo;

out vec4 frag_color;

float blocked(vec4 point, float cosine)
{
    float w = 1.0 / dot(light_w, point);
    vec2 where = vec2(dot(light_x, point), dot(light_y, point)) * w - 1.0;
    w += bias / max(cosine, least_cosine);
    int side = textureSize(shadow_map, 0).x;
    if (min(where.x, where.y) < 0.0 || max(where.x, where.y) >= float(side - 3))
        return 0.0;
    ivec2 corner = ivec2(where);
    // Mostly the corners of the filter agree, and their result is used for all.
    float corners = 0.0;
    for (int k = 0; k < 4; k++)
        corners += float(texelFetch(shadow_map, corner + ivec2(3 * (k & 1), 3 * (k >> 1)), 0).r > w);
    if (corners == 0.0 || corners == 4.0)
        return 0.25 * corners;
    vec2 share = where - vec2(corner);
    float sum = 0.0;  // 4 x 4 comparisons under a sliding box of 3 x 3
    for (int row = 0; row < 4; row++)
        for (int column = 0; column < 4; column++) {
            vec2 weight = vec2(column == 0 ? 1.0 - share.x : (column == 3 ? share.x : 1.0),
                               row == 0 ? 1.0 - share.y : (row == 3 ? share.y : 1.0));
            if (texelFetch(shadow_map, corner + ivec2(column, row), 0).r > w)
                sum += weight.x * weight.y;
        }
    return sum / 9.0;
}

void main()
{
    vec3 n = normalize(outwards) * (gl_FrontFacing ? 1.0 : -1.0);
    vec3 to_camera = (cam_pos - at) * gl_FragCoord.w;  // of length 1 along the optical axis
    float cosine = dot(n, light);
    float lit = cosine > 0.0 ? strengths.x * cosine * (1.0 - blocked(vec4(at, 1.0), cosine)) : 0.0;
    float sky = strengths.y * (0.65 + 0.35 * n.z);
    float fill = strengths.z * clamp(dot(n, to_camera), 0.0, 1.0);
    vec3 color = albedo.rgb * sqrt(min(lit + sky + fill, 4.0) * tint);  // sRGB is about the square root of linear light
#ifdef HAS_BASE_COLOR_TEX
    vec2 texels = vec2(textureSize(material.base_color_texture, 0));
    vec2 right = dFdx(place) * texels, down = dFdy(place) * texels;
    float area = 0.5 * (dot(right, right) + dot(down, down));  // level whose texels are about as large as a pixel
    float level = max(ceil(0.5 * log2(max(0.5 * area, 1.0))), 0.0);
    color *= textureLod(material.base_color_texture, place, level).rgb;
#endif
    frag_color = vec4(clamp(color, 0.0, 1.0), material.base_color_factor.a);
}
"""

_FLAT = """#version 330 core
// Unlit: label of the part in red, id of the mesh in alpha.

struct Material {
    vec4 base_color_factor;
};

uniform Material material;

in vec4 albedo;

out vec4 frag_color;

void main()
{
    frag_color = vec4(albedo.a, 0.0, 0.0, material.base_color_factor.a);
}
"""

_SHADERS = {"mesh.vert": _CORNERS, "mesh.frag": _SHADED, "flat.vert": _CORNERS, "flat.frag": _FLAT}
"""Files that pyrender takes for pictures, and for ids and parts alone."""
