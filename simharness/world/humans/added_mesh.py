"""Meshes that are added to the mesh of a body, and the outlines that they are fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.world.humans.body import Body, FacePart


@dataclass(frozen=True)
class AddedMesh:
    """Mesh to add to a body; for its fields see :class:`simharness.world.humans.body.Body`."""

    vertices: Floats
    faces: NDArray[np.int32]
    part: FacePart
    level: Floats
    weight_bones: NDArray[np.uint8]
    weights: NDArray[np.float32]


def add_mesh(body: Body, mesh: AddedMesh) -> Body:
    """Append a mesh to a body."""
    return replace(
        body,
        vertices=np.concatenate([body.vertices, mesh.vertices.astype(np.float32)]),
        faces=np.concatenate([body.faces, mesh.faces + np.int32(len(body.vertices))]),
        part=np.append(body.part, np.full(len(mesh.faces), mesh.part, np.int8)),
        level=np.append(body.level, mesh.level),
        weight_bones=np.concatenate([body.weight_bones, mesh.weight_bones]),
        weights=np.concatenate([body.weights, mesh.weights]),
    )


def rigid(body: Body, bone: str, sheets: Sequence[tuple[Floats, NDArray[np.int32]]], part: FacePart) -> AddedMesh:
    """Join sheets, pairs of vertices (n, 3) and faces (k, 3), to one mesh that moves with a bone."""
    vertices, faces = _joined(sheets)
    bones = np.full((len(vertices), 4), body.index(bone), np.uint8)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(vertices), 1))
    return AddedMesh(vertices, faces, part, np.ones(len(faces)), bones, weights)


def attached(
    body: Body, sheets: Sequence[tuple[Floats, NDArray[np.int32]]], part: FacePart, *, to: NDArray[np.int64]
) -> AddedMesh:
    """Join sheets to one mesh whose vertices move as the nearest of the body's vertices ``to`` (v,) do."""
    vertices, faces = _joined(sheets)
    apart = np.linalg.norm(vertices[:, None] - body.vertices[to].astype(float), axis=2)
    nearest = to[apart.argmin(axis=1)]
    return AddedMesh(vertices, faces, part, np.ones(len(faces)), body.weight_bones[nearest], body.weights[nearest])


def _joined(sheets: Sequence[tuple[Floats, NDArray[np.int32]]]) -> tuple[Floats, NDArray[np.int32]]:
    first = np.cumsum([0, *(len(vertices) for vertices, _ in sheets)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(sheets, first[:-1], strict=True)])
    return np.concatenate([vertices for vertices, _ in sheets]), faces.astype(np.int32)


def grid(rows: int, columns: int, *, closed: bool) -> NDArray[np.int32]:
    """Return the faces of a grid of vertices: columns counter-clockwise seen from above, rows downwards."""
    across = np.arange(columns if closed else columns - 1)
    a = (np.arange(rows - 1)[:, None] * columns + across).ravel()
    b = (np.arange(rows - 1)[:, None] * columns + (across + 1) % columns).ravel()
    c, d = a + columns, b + columns
    return np.concatenate([np.column_stack([a, c, d]), np.column_stack([a, d, b])]).astype(np.int32)


def hull(points: Floats, bearing: Floats) -> Floats:
    """Return the distance from the origin to the convex hull of points (n, 2) at bearings (c,), metres."""
    return hull_reach(points, np.column_stack([np.cos(bearing), np.sin(bearing)]))


def hull_reach(points: Floats, directions: Floats) -> Floats:
    """Return the distance from the origin to the convex hull of points (n, d) in unit directions (c, d), metres.

    The hull is that of the half spaces whose normals are the directions themselves.
    """
    support = (points @ directions.T).max(0)
    cosine = directions @ directions.T
    return np.where(cosine > 0.2, support[None, :] / np.maximum(cosine, 0.2), np.inf).min(1)
