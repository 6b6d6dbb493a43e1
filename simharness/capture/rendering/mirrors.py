"""Reflections in flat mirrors.

The scene is reflected at the plane of the glass, clipped at that plane and rendered with the same camera; its colours
replace those of the pixels that show the glass. Ids and depth stay those of the glass. This needs no support by the
renderer, so it works with all of them. Mirrors seen in mirrors are plain glass.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.capture.rendering.renderer import Image, Renderer
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.rigs.projection import viewing_rays

_NEAR_GLASS = 0.004  # metres: accuracy of depth from a picture; frames stand out farther
_REFLECTANCE = (0.87, 0.90, 0.89)  # glass is a little green; sRGB


def with_mirrors(
    renderer: Renderer,
    camera: Camera,
    meshes: Sequence[Mesh],
    mirrors: Mapping[int, Mirror],
    image: Image,
    **options: Any,
) -> NDArray[np.uint8]:
    """Add reflections to the mirrors of a picture.

    Args:
        renderer: renderer of the picture.
        camera: camera of the picture.
        meshes: meshes that were rendered.
        mirrors: glass of the meshes that are mirrors, by mesh index.
        image: picture with depth and ids.
        options: further arguments of ``renderer.render``; a ``lighting`` among them is reflected too.

    Returns:
        Colours, (h, w, 3); the same array if no mirror is visible.
    """
    rgb = image.rgb
    for index, mirror in mirrors.items():
        glass = _glass(camera, image, index, mirror)
        if not glass.any():
            continue
        behind = [reflected(mesh, mirror) for k, mesh in enumerate(meshes) if k != index]
        reflected_options = dict(options)
        if "lighting" in reflected_options:
            towards = np.asarray(options["lighting"].direction, float)
            turned = towards - 2 * (towards @ np.array(mirror.normal)) * np.array(mirror.normal)
            reflected_options["lighting"] = replace(
                options["lighting"], direction=tuple(turned.tolist()), mirror=mirror
            )
        other = renderer.render(camera, [mesh for mesh in behind if len(mesh.faces)], **reflected_options).rgb
        rgb = np.where(glass[..., None], np.round(other * np.array(_REFLECTANCE)).astype(np.uint8), rgb)
    return rgb


def _glass(camera: Camera, image: Image, index: int, mirror: Mirror) -> NDArray[np.bool_]:
    """Return the pixels (h, w) that show the reflecting side of the glass."""
    seen = image.ids == index
    if not seen.any() or mirror.in_front(camera.center) <= 0:
        return np.zeros_like(seen)
    row, column = np.nonzero(seen)
    rays = viewing_rays(camera, np.column_stack([column, row]))
    points = camera.center + rays * (image.depth[row, column] / (rays @ camera.R[2]))[:, None]
    seen[row, column] = mirror.on_glass(points) & (np.abs(mirror.in_front(points)) < _NEAR_GLASS)
    return seen


def reflected(mesh: Mesh, mirror: Mirror) -> Mesh:
    """Return the mirror image of a mesh: its part in front of the plane of the glass, reflected; may have no faces."""
    cut = _in_front(mesh, mirror)
    changed: dict[str, Any] = {"vertices": mirror.reflect(cut.vertices).astype(np.float32), "faces": cut.faces[:, ::-1]}
    changed["still"] = False  # a new mesh for every picture
    if cut.uv is not None:
        changed["uv"] = cut.uv[:, ::-1]
    return replace(cut, **changed)


def _in_front(mesh: Mesh, mirror: Mirror) -> Mesh:
    """Return the part of a mesh in front of the plane of a mirror; faces across the plane are cut."""
    height = mirror.in_front(mesh.vertices)[mesh.faces]
    count = (height > 0).sum(axis=1)
    if (count == 3).all():
        return mesh
    whole = np.flatnonzero(count == 3)
    source, weights = _pieces(height, count)
    corners = np.einsum("kij,kjc->kic", weights, mesh.vertices[mesh.faces[source]])
    cut_faces = len(mesh.vertices) + np.arange(3 * len(source)).reshape(-1, 3)  # pieces share no vertices
    kept = np.concatenate([whole, source])
    changed: dict[str, Any] = {}
    if mesh.uv is not None:
        changed["uv"] = np.concatenate([mesh.uv[whole], np.einsum("kij,kjc->kic", weights, mesh.uv[source])]).astype(
            np.float32
        )
    if mesh.parts is not None:
        changed["parts"] = mesh.parts[kept]
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, corners.reshape(-1, 3)]).astype(np.float32),
        faces=np.concatenate([mesh.faces[whole], cut_faces]).astype(np.int32),
        colors=mesh.colors[kept],
        **changed,
    )


def _pieces(height: Floats, count: NDArray[np.int_]) -> tuple[NDArray[np.int_], Floats]:
    """Cut faces at a plane and return the triangles above it.

    Args:
        height: heights of the corners of each face over the plane, (k, 3).
        count: number of corners above the plane, (k,).

    Returns:
        Face of each triangle, (p,), and its corners as weights of the corners of the face, (p, 3, 3).
    """
    sources, weights = [], []
    for above in (1, 2):
        cut = np.flatnonzero(count == above)
        lone = np.argmax((height[cut] > 0) == (above == 1), axis=1)  # the single corner on its side
        corner = np.eye(3)[(lone[:, None] + np.arange(3)) % 3]  # (c, 3, 3): the single one, then the two others
        h = np.einsum("kij,kj->ki", corner, height[cut])
        share = (h[:, :1] / (h[:, :1] - h[:, 1:]))[..., None]
        a, b, c = np.moveaxis(corner, 1, 0)
        ab, ac = a + share[:, 0] * (b - a), a + share[:, 1] * (c - a)
        pieces = [(a, ab, ac)] if above == 1 else [(ab, b, c), (ab, c, ac)]
        sources += [cut] * len(pieces)
        weights += [np.stack(piece, axis=1) for piece in pieces]
    return np.concatenate(sources), np.concatenate(weights)
