"""Meshes of a bob and a ponytail, and the thickness of curly hair."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.added_mesh import AddedMesh, grid, hull, rigid
from simharness.world.humans.body import Body, FacePart
from simharness.world.humans.face_points import FacePoints

_BOB = (62.0, 298.0)  # bearings from the face around the head's axis, degrees: in front of one ear to the other
_CURLS = 0.006  # height of curls, metres


def bob(body: Body, *, volume: float) -> AddedMesh:
    """Make the mesh of hair cut at the chin: it covers the ears and the nape."""
    face = FacePoints.of(body)
    eyes, height = face.eye[2], face.crown - face.eye[2]
    center = np.array([0.5 * (face.scalp[:, 0].min() + face.scalp[:, 0].max()), 0.0])
    bearing = np.radians(np.linspace(*_BOB, 23))
    directions = np.column_stack([np.cos(bearing), np.sin(bearing)])
    points = np.concatenate([face.face, face.scalp])
    rows, fall = [], np.zeros(len(bearing))
    levels = np.linspace(eyes + 0.86 * height, eyes - 0.85 * height, 12)
    for k, z in enumerate(levels):
        slab = points[np.abs(points[:, 2] - z) < 0.012 * face.scale, :2] - center
        if z > eyes - 0.5 * height:
            fall = np.maximum(hull(slab, bearing), fall)
        fullness = float(np.clip((levels[0] - z) / height, 0, 1)) ** 0.7
        reach = fall - 0.006 + (0.013 + 0.006 * volume) * fullness  # from inside the hair on top outwards
        reach -= 0.008 if k == len(levels) - 1 else 0.0
        beside = slab[np.abs(slab[:, 0] + center[0] - face.ear[0]) > 0.025 * face.scale]  # the front edge lies on the
        reach[[0, -1]] = np.minimum(hull(beside, bearing[[0, -1]]) - 0.002, reach[[0, -1]])  # cheek before the ear
        rows.append(np.column_stack([center + directions * reach[:, None], np.full(len(bearing), z)]))
    sheet = np.concatenate(rows), grid(len(rows), len(bearing), closed=False)
    return rigid(body, "Head", [sheet], FacePart.SCALP)


def ponytail(body: Body, *, volume: float, low: bool = False) -> AddedMesh:
    """Make the mesh of a ponytail, from the back of the head or ``low`` from the nape to the shoulder blades."""
    face = FacePoints.of(body)
    eyes, height = face.eye[2], face.crown - face.eye[2]
    start = eyes + (-0.25 if low else 0.45) * height
    behind = float(face.scalp[np.abs(face.scalp[:, 2] - start) < 0.015, 0].min())
    share = np.linspace(0, 1, 10)[:, None]
    length = (0.17 if low else 0.24) * face.scale
    out = 0.045 * face.scale * np.sin(np.minimum(share * 1.9, 1.0) * np.pi / 2)
    line = np.column_stack([behind + 0.016 - out, np.zeros_like(share), start + 0.012 - length * share**1.35])
    radius = (
        (0.017 + 0.007 * volume) * np.sqrt(np.clip(share * 6, 0.25, 1.0)) * np.clip((1.02 - share) * 3, 0.05, 1) ** 0.6
    )
    around = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    sideways = np.array([0.0, 1.0, 0.0])
    across = np.cross(tangent, sideways)
    rings = line[:, None] + radius[:, None] * (
        np.cos(around)[:, None] * across[:, None] + np.sin(around)[:, None] * sideways
    )
    return rigid(body, "Head", [(rings.reshape(-1, 3), grid(10, 9, closed=True))], FacePart.SCALP)


def curls(vertices: Floats, level: Floats, *, volume: float) -> Floats:
    """Return the thickness of curly hair at vertices (v, 3) of the scalp of given levels (v,), metres, (v,)."""
    full = 0.012 + 0.022 * volume
    x, y, z = vertices.T
    bumps = np.sin(251 * x + 97 * z) + np.sin(223 * y - 131 * x) + np.sin(267 * z + 111 * y)
    dense = np.sqrt(np.clip(level * (2 - level), 0, 1))
    return dense * (full + _CURLS / 3 * bumps * np.clip(2 * level, 0, 1))
