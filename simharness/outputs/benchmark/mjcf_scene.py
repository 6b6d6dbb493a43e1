"""Export of a built scene as MJCF, which MuJoCo's viewer opens: ``python -m mujoco.viewer --mjcf=FOLDER/scene.xml``.

The file has the bodies and geoms of the scene at the first frame, fixed there, the cameras, and what pictures show as
meshes of their own, which touch nothing: those of people as they stand, in group 1, while the geoms for rays and
contacts are in group 3. Lenses have no distortion, and a picture that colours multiply face by face is drawn with at
most a few dozen colours.
"""

import hashlib
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from mvpose.files.atomic_files import atomic_folder
from simharness.capture.picture import meshes_at
from simharness.types.mesh import Mesh
from simharness.world.scene.build import Scene
from simharness.world.scene.playback import Playback

MJCF = "simharness mjcf"
"""What the manifest of the folder says."""
SHOWN_GROUP, HIDDEN_GROUP = 1, 3
"""Groups of the geoms that show the meshes, and of those for rays and contacts, which the viewer hides at first."""
_COLOR_STEPS = 32, 8, 4  # per channel: colours of textured meshes are rounded, the more coarsely the more there are
_MOST_COLORS = 48


def write_mjcf(scene: Scene, rig: Rig, folder: Path) -> Path:
    """Write a scene at its first frame as MJCF, with its meshes and textures beside it.

    Args:
        scene: built scene.
        rig: true cameras.
        folder: folder to write; it must not exist, or hold an earlier export, which is replaced.

    Returns:
        The file ``scene.xml`` in it.
    """
    playback = Playback(scene)
    state = playback.at(float(scene.time[0]))
    spec = mujoco.MjSpec()
    spec.modelname = "scene"
    spec.compiler.texturedir = spec.compiler.meshdir = "assets"
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    _add_bodies(spec, scene.model, playback.data)
    _add_cameras(spec, rig)
    towards = np.array(scene.lighting.direction)
    spec.worldbody.add_light(
        name="key", type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=-towards, pos=[0, 0, 10], castshadow=False
    )
    with atomic_folder(folder, MJCF) as place:
        (place / "assets").mkdir()
        for name, mesh in zip(_names(scene), meshes_at(scene, state), strict=True):
            _add_shown(spec, name, mesh, place / "assets")
        (place / "scene.xml").write_text(_xml(spec, place / "assets"), encoding="utf-8")
    return folder / "scene.xml"


def _names(scene: Scene) -> list[str]:
    """Return the names of people and solids in the order of their meshes."""
    return [*(f"person{i}" for i in range(len(scene.bodies))), *(solid.name for solid in scene.solids)]


def _add_bodies(spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Add all bodies of a model with their geoms, without joints, at their positions in a state."""
    bodies = [spec.worldbody]
    for k in range(1, model.nbody):
        parent = int(model.body_parentid[k])
        turn = data.xmat[parent].reshape(3, 3).T @ data.xmat[k].reshape(3, 3)
        body = bodies[parent].add_body(
            name=model.body(k).name,
            pos=data.xmat[parent].reshape(3, 3).T @ (data.xpos[k] - data.xpos[parent]),
            quat=_quaternion(turn),
            mocap=bool(model.body_mocapid[k] >= 0),
        )
        bodies.append(body)
    for k in range(model.nmesh):
        first, last = int(model.mesh_vertadr[k]), int(model.mesh_faceadr[k])
        spec.add_mesh(
            name=model.mesh(k).name,
            uservert=model.mesh_vert[first : first + model.mesh_vertnum[k]].ravel(),
            userface=model.mesh_face[last : last + model.mesh_facenum[k]].ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
    for k in range(model.ngeom):
        is_mesh = model.geom_type[k] == mujoco.mjtGeom.mjGEOM_MESH
        shape: dict[str, Any] = (
            {"meshname": model.mesh(int(model.geom_dataid[k])).name} if is_mesh else {"size": model.geom_size[k]}
        )
        bodies[int(model.geom_bodyid[k])].add_geom(
            name=model.geom(k).name,
            type=mujoco.mjtGeom(int(model.geom_type[k])),
            pos=model.geom_pos[k],
            quat=model.geom_quat[k],
            contype=int(model.geom_contype[k]),
            conaffinity=int(model.geom_conaffinity[k]),
            group=HIDDEN_GROUP,
            **shape,
        )


def _add_cameras(spec: mujoco.MjSpec, rig: Rig) -> None:
    """Add the cameras; those of MuJoCo look along -z, with y up in the picture."""
    for camera in rig:
        axes = np.column_stack([camera.R[0], -camera.R[1], -camera.R[2]])
        spec.worldbody.add_camera(
            name=camera.name,
            pos=camera.center,
            quat=_quaternion(axes),
            fovy=float(np.degrees(2 * np.arctan(camera.size[1] / 2 / camera.K[1, 1]))),
            resolution=list(camera.size),
        )


def _add_shown(spec: mujoco.MjSpec, name: str, mesh: Mesh, assets: Path) -> None:
    """Add the mesh of a person or solid: a geom for each colour of a textured mesh, else one with all colours.

    Absent people have no extent and are left out.
    """
    if not len(mesh.faces) or not np.ptp(mesh.vertices, axis=0).any():
        return
    if mesh.texture is None or mesh.uv is None:
        colors, which = np.unique(np.round(255 * mesh.colors).astype(np.uint8), axis=0, return_inverse=True)
        side = int(np.ceil(np.sqrt(len(colors))))
        picture = np.zeros((side * side, 3), np.uint8)
        picture[: len(colors)] = colors
        texel = np.column_stack(np.divmod(which.ravel(), side))[:, ::-1]
        uv = np.repeat(((texel + 0.5) / side)[:, None], 3, axis=1)
        material = _material(spec, f"{name} colors", picture.reshape(side, side, 3), np.ones(3), assets)
        _add_faces(spec, name, mesh, np.arange(len(mesh.faces)), uv, material)
        return
    keys, which = _rounded_colors(mesh.colors)
    for k, color in enumerate(keys):
        material = _material(spec, f"{name} {k}", mesh.texture, color, assets)
        faces = np.flatnonzero(which == k)
        _add_faces(spec, f"{name} {k}" if len(keys) > 1 else name, mesh, faces, mesh.uv[faces], material)


def _rounded_colors(colors: NDArray[np.float32]) -> tuple[Floats, Integers]:
    """Return at most a few dozen colours, (n, 3), and which of them each face has, (k,)."""
    for steps in _COLOR_STEPS:
        keys, which = np.unique(np.round(steps * colors), axis=0, return_inverse=True)
        if len(keys) <= _MOST_COLORS:
            break
    return np.clip(keys / steps, 0, 1), which.ravel()


def _material(spec: mujoco.MjSpec, name: str, picture: NDArray[np.uint8], color: Floats, assets: Path) -> str:
    """Add a material of a picture, written once, and a colour that multiplies it; return its name."""
    digest = hashlib.blake2b(picture.tobytes(), digest_size=8).hexdigest()
    file = f"{digest}.png"
    if not (assets / file).exists():
        cv2.imwrite(str(assets / file), picture[..., ::-1])
        spec.add_texture(name=digest, type=mujoco.mjtTexture.mjTEXTURE_2D, file=file)
    material = spec.add_material(name=name, rgba=[*color, 1.0], specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = digest
    return name


def _add_faces(spec: mujoco.MjSpec, name: str, mesh: Mesh, faces: Integers, uv: NDArray[Any], material: str) -> None:
    """Add some faces of a mesh as a geom that touches nothing."""
    corners = mesh.vertices[mesh.faces[faces]].reshape(-1, 3)
    rows = np.concatenate([corners, uv.reshape(-1, 2)], axis=1).astype(np.float32)
    if not mesh.smooth:  # no two faces share a normal
        rows = np.concatenate([rows, np.repeat(np.arange(len(faces), dtype=np.float32), 3)[:, None]], axis=1)
    points, index = np.unique(rows, axis=0, return_inverse=True)
    points = np.concatenate([points, points[:1].repeat(max(4 - len(points), 0), axis=0)])
    spec.add_mesh(
        name=f"shown {name}",
        uservert=points[:, :3].ravel(),
        usertexcoord=points[:, 3:5].ravel(),
        userface=index.astype(np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(
        name=f"shown {name}",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=f"shown {name}",
        material=material,
        contype=0,
        conaffinity=0,
        group=SHOWN_GROUP,
    )


def _xml(spec: mujoco.MjSpec, assets: Path) -> str:
    """Return the MJCF text; textures are files in the folder of assets."""
    spec.assets = {file.name: file.read_bytes() for file in assets.iterdir()}
    spec.compile()
    return str(spec.to_xml())


def _quaternion(turn: Floats) -> Floats:
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(turn).ravel())
    return quat
