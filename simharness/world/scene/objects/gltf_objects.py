"""glTF 2.0 files (.glb, .gltf) as MuJoCo models: triangles with the base colours and pictures of their materials.

glTF has y up and the front towards +z (Khronos Group, glTF 2.0 Specification, 2021, section 3.4); here z is up and the
front is +x.
"""

from pathlib import Path
from typing import Any
from urllib.parse import unquote

import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.files.input_files import read_json_object
from simharness.types.srgb import from_linear
from simharness.world.scene.objects.surfaces import add_surface


def read_gltf(path: Path) -> mujoco.MjSpec:
    """Return a MuJoCo model with a geom for each mesh of a glTF file, where its nodes put them.

    Vertices with colours of their own give their mesh the mean of these. Skins, animations, and other maps than those
    of base colours are left out.

    Raises:
        ValueError: the file cannot be read or shows no triangles, or trimesh, which reads it, is not installed.
    """
    try:
        import trimesh
    except ImportError:
        raise ValueError(
            "trimesh, which reads glTF, is not installed; pip install 'simharness[gltf]' (in a checkout: pip install "
            "-e '.[gltf]'), or save the object as OBJ"
        ) from None
    try:
        meshes = trimesh.load_scene(path, process=False).dump()
    except Exception as error:  # a damaged file raises errors of many types
        raise ValueError(f"not a valid glTF 2.0 file: {error or type(error).__name__}") from error
    spec = mujoco.MjSpec()
    for k, mesh in enumerate(each for each in meshes if isinstance(each, trimesh.Trimesh) and len(each.faces)):
        points, visual = np.asarray(mesh.vertices, float)[:, [2, 0, 1]], mesh.visual
        color, picture = _material(visual)
        add_surface(spec, str(k), points, mesh.faces, color, places=getattr(visual, "uv", None), picture=picture)
    if not spec.geoms:
        raise ValueError("it has no triangles")
    return spec


def gltf_dependencies(path: Path) -> tuple[Path, ...]:
    """Return a glTF file, and the buffers and pictures beside it that it names."""
    if path.suffix.lower() == ".glb" or not path.is_file():
        return (path,)
    content = read_json_object(path, what="an object as glTF")
    listed = (each for key in ("buffers", "images") if isinstance(content.get(key), list) for each in content[key])
    names = dict.fromkeys(str(each["uri"]) for each in listed if isinstance(each, dict) and "uri" in each)
    return (path, *(path.parent / unquote(name) for name in names if not name.startswith("data:")))


def _material(visual: Any) -> tuple[tuple[float, ...], NDArray[np.uint8] | None]:
    """Return the colour of a mesh, 0 to 1 in sRGB, and its picture (h, w, 3) with blue first, None for none."""
    shown = None
    if visual.kind == "texture":
        factor, picture = visual.material.baseColorFactor, visual.material.baseColorTexture
        linear = np.full(3, 255.0) if factor is None else np.asarray(factor, float)[:3]
        shown = None if picture is None else np.asarray(picture.convert("RGB"), np.uint8)[..., ::-1]
    else:
        linear = np.asarray(visual.vertex_colors, float)[:, :3].mean(axis=0)
    return tuple((from_linear(linear / 255) / 255).tolist()), shown
