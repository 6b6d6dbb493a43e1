"""Mirrors: pictures in which they reflect what stands before them.

A flat mirror shows the scene on its other side, turned over: so the reflected scene, cut off at the glass, is
rendered with the same camera, and its colours go where the glass is seen. Ids and depth stay those of the glass. It
is done with what every renderer can do, so every renderer can do it. Mirrors in mirrors are plain glass.
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

_NEAR_GLASS = 0.004  # metres: depth from a picture is as good as this; frames stand out farther
_REFLECTANCE = (0.87, 0.90, 0.89)  # glass is a little green; sRGB


def with_mirrors(
    renderer: Renderer,
    camera: Camera,
    meshes: Sequence[Mesh],
    mirrors: Mapping[int, Mirror],
    image: Image,
    **how: Any,
) -> NDArray[np.uint8]:
    """Let the mirrors of a picture reflect.

    Args:
        renderer: what made the picture.
        camera: whose picture it is.
        meshes: the scene that was rendered.
        mirrors: the glass of those meshes that are mirrors, by their index.
        image: the picture, with depth and ids.
        how: as ``renderer.render`` was called; a ``lighting`` among it is reflected too.

    Returns:
        The colours (h, w, 3), the same array where no mirror is seen.
    """
    rgb = image.rgb
    for index, mirror in mirrors.items():
        glass = _glass(camera, image, index, mirror)
        if not glass.any():
            continue
        behind = [reflected(mesh, mirror) for k, mesh in enumerate(meshes) if k != index]
        lit = dict(how)
        if "lighting" in lit:
            towards = np.asarray(lit["lighting"].direction, float)
            turned = towards - 2 * (towards @ np.array(mirror.normal)) * np.array(mirror.normal)
            lit["lighting"] = replace(lit["lighting"], direction=tuple(turned.tolist()))
        other = renderer.render(camera, [mesh for mesh in behind if len(mesh.faces)], **lit).rgb
        rgb = np.where(glass[..., None], np.round(other * np.array(_REFLECTANCE)).astype(np.uint8), rgb)
    return rgb


def _glass(camera: Camera, image: Image, index: int, mirror: Mirror) -> NDArray[np.bool_]:
    """Pixels (h, w) in which the glass is seen from its front."""
    seen = image.ids == index
    if not seen.any() or mirror.in_front(camera.center) <= 0:
        return np.zeros_like(seen)
    row, column = np.nonzero(seen)
    rays = camera.rays(np.column_stack([column, row]))
    points = camera.center + rays * (image.depth[row, column] / (rays @ camera.R[2]))[:, None]
    seen[row, column] = mirror.on_glass(points) & (np.abs(mirror.in_front(points)) < _NEAR_GLASS)
    return seen


def reflected(mesh: Mesh, mirror: Mirror) -> Mesh:
    """What a mirror shows of a mesh: the part in front of the glass's plane, turned over; perhaps without faces."""
    cut = _in_front(mesh, mirror)
    changed: dict[str, Any] = {"vertices": mirror.reflect(cut.vertices).astype(np.float32), "faces": cut.faces[:, ::-1]}
    if cut.uv is not None:
        changed["uv"] = cut.uv[:, ::-1]
    return replace(cut, **changed)


def _in_front(mesh: Mesh, mirror: Mirror) -> Mesh:
    """The part of a mesh in front of a mirror's plane; faces across it are cut."""
    height = mirror.in_front(mesh.vertices)[mesh.faces]
    count = (height > 0).sum(axis=1)
    if (count == 3).all():
        return mesh
    whole = np.flatnonzero(count == 3)
    source, weights = _pieces(height, count)
    corners = np.einsum("kij,kjc->kic", weights, mesh.vertices[mesh.faces[source]])
    own = len(mesh.vertices) + np.arange(3 * len(source)).reshape(-1, 3)  # each piece has corners of its own
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
        faces=np.concatenate([mesh.faces[whole], own]).astype(np.int32),
        colors=mesh.colors[kept],
        **changed,
    )


def _pieces(height: Floats, count: NDArray[np.int_]) -> tuple[NDArray[np.int_], Floats]:
    """What is left of the faces across a plane, from the heights of their corners (k, 3) over it.

    Args:
        height: of every face's corners.
        count: how many of them are above, (k,).

    Returns:
        For every piece its face (p,), and its corners as weights of the face's corners (p, 3, 3).
    """
    sources, weights = [], []
    for above in (1, 2):
        cut = np.flatnonzero(count == above)
        lone = np.argmax((height[cut] > 0) == (above == 1), axis=1)  # the corner that is alone on its side
        corner = np.eye(3)[(lone[:, None] + np.arange(3)) % 3]  # (c, 3, 3): the lone one, then the two others
        h = np.einsum("kij,kj->ki", corner, height[cut])
        share = (h[:, :1] / (h[:, :1] - h[:, 1:]))[..., None]
        a, b, c = np.moveaxis(corner, 1, 0)
        ab, ac = a + share[:, 0] * (b - a), a + share[:, 1] * (c - a)
        pieces = [(a, ab, ac)] if above == 1 else [(ab, b, c), (ab, c, ac)]
        sources += [cut] * len(pieces)
        weights += [np.stack(piece, axis=1) for piece in pieces]
    return np.concatenate(sources), np.concatenate(weights)
