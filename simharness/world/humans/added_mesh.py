"""Meshes that are added to the mesh of a body, and the outlines that they are fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from simharness.types.sequence import LANDMARKS
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


def unit(vectors: Floats) -> Floats:
    """Return vectors (..., d) with unit length; a vector without length stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def rounded(value: Floats, power: float) -> Floats:
    """Return sines or cosines raised to a power, with their signs: coordinates of superellipses."""
    return np.sign(value) * np.abs(value) ** power


def hull(points: Floats, bearing: Floats) -> Floats:
    """Return the distance from the origin to the convex hull of points (n, 2) at bearings (c,), metres."""
    return hull_reach(points, directions_at(bearing))


def directions_at(bearing: Floats) -> Floats:
    """Return the unit vectors (c, 2) at bearings (c,) in radians."""
    return np.column_stack([np.cos(bearing), np.sin(bearing)])


def hull_reach(points: Floats, directions: Floats) -> Floats:
    """Return the distance from the origin to the convex hull of points (n, d) in unit directions (c, d), metres.

    The hull is that of the half spaces whose normals are the directions themselves.
    """
    support = (points @ directions.T).max(0)
    cosine = directions @ directions.T
    return np.where(cosine > 0.2, support[None, :] / np.maximum(cosine, 0.2), np.inf).min(1)


@dataclass(frozen=True)
class FacePoints:
    """Places on a head at rest, metres in the world; the face looks to +x.

    Attributes:
        eye, ear, nose: left eye, left ear and nose, (3,); the right side is mirrored at y = 0.
        crown: height of the top of the bare head.
        scale: height of the crown over the eyes relative to an adult's, about 0.8 to 1.1.
        face: vertices of skin, lips and brows of the head, (n, 3).
        scalp: vertices of the hair, with those of long hair, (s, 3).
    """

    eye: Floats
    ear: Floats
    nose: Floats
    crown: float
    scale: float
    face: Floats
    scalp: Floats

    @classmethod
    def of_body(cls, body: Body) -> "FacePoints":
        """Find the places on a dressed or bare body."""
        at = {name: body.keypoints[LANDMARKS.index(name), :, :3].sum(axis=0) for name in _NAMES}
        crown = float(at["head_top"][2])
        vertices = body.vertices.astype(float)
        face, scalp = (vertices[np.unique(body.faces[np.isin(body.part, parts)])] for parts in (_FACE, _SCALP))
        # Means of a left point and the mirrored right one.
        eye, ear = (0.5 * (at[f"left_{name}"] + at[f"right_{name}"] * [1, -1, 1]) for name in ("eye", "ear"))
        scale = (crown - float(at["left_eye"][2])) / _EYES_TO_CROWN
        face = face[face[:, 2] > at["nose"][2] - 1.2 * (crown - at["nose"][2])]
        return cls(eye, ear, at["nose"], crown, scale, face, scalp)


_NAMES = ("left_eye", "right_eye", "left_ear", "right_ear", "nose", "head_top")
_FACE = [FacePart.SKIN, FacePart.LIPS, FacePart.BROW]
_SCALP = [FacePart.SCALP]
_EYES_TO_CROWN = 0.107  # of an adult, metres
