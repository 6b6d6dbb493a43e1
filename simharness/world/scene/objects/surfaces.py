"""Surfaces of one colour or picture as geoms of a MuJoCo model, for files that MuJoCo does not read."""

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats


def add_surface(
    spec: mujoco.MjSpec,
    name: str,
    points: Floats,
    faces: NDArray[np.integer],
    color: tuple[float, ...],
    *,
    places: Floats | None = None,
    picture: NDArray[np.uint8] | None = None,
) -> None:
    """Add a surface to a model; it need not be closed.

    Args:
        spec: the model.
        name: a name that no other surface of the model has.
        points: vertices, (n, 3), metres.
        faces: their indices, (k, 3).
        color: red, green and blue, 0 to 1, by which a picture is multiplied.
        places: texture coordinates of the vertices, (n, 2), v upwards; without them the picture is not used.
        picture: (h, w, 3), blue, green, red.
    """
    is_flat = np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-6) < 3
    points = np.concatenate([points, points[:1].repeat(max(4 - len(points), 0), axis=0)])  # MuJoCo wants four or more
    mesh = spec.add_mesh(
        name=name,
        uservert=points.ravel(),
        userface=faces.astype(np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    material = spec.add_material(name=name, rgba=[*color, 1.0])
    if places is not None and picture is not None:
        place = np.zeros((len(points), 2))
        place[: len(places)] = places * [1, -1] + [0, 1]
        mesh.usertexcoord = place.ravel()
        spec.assets[f"{name}.png"] = cv2.imencode(".png", picture)[1].tobytes()
        spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, file=f"{name}.png")
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    touches = {} if not is_flat else {"contype": 0, "conaffinity": 0}  # a flat mesh has no hull for contacts
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material.name, **touches
    )
