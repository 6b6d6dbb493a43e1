"""Meshes of simple shapes (quadrilaterals, boxes, bars, bodies of revolution, lofted skins).

Faces are counter-clockwise as seen from outside. Creases have separate vertices on both sides, so a smooth mesh may
have flat sides and sharp edges.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.solids import ObjectModel

# Corners of each side of a Box in the order of its corners, counter-clockwise from outside: -x, +x, -y, +y, -z, +z.
_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
TOP = 5  # index of the upper side of a box
_CREASE = np.cos(np.radians(40))  # a profile that bends more has a sharp edge


def quad_mesh(vertices: Floats, quads: NDArray[np.int_], colors: Floats) -> Mesh:
    """Return the triangle mesh of quadrilaterals (k, 4), counter-clockwise from outside, with colours (k, 3)."""
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)
    return Mesh(vertices.astype(np.float32), faces, np.repeat(np.clip(colors, 0, 1), 2, axis=0).astype(np.float32))


def outline(half: Floats, each: int) -> Floats:
    """Return the outline (n, 3) of a rectangle on the floor, counter-clockwise from above, ``each`` points a side."""
    corners = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]) * half
    share = np.arange(each)[:, None] / each
    sides = [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    return np.pad(np.concatenate(sides), ((0, 0), (0, 1)))


def ring_mesh(rings: Floats, colors: Floats) -> Mesh:
    """Return the mesh between closed rings (m, s, 3), from the inner to the outer one; ``colors`` ((m - 1) * s, 3)."""
    sides = rings.shape[1]
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    first = np.array([k, k + sides, after + sides, after]).T
    return quad_mesh(rings.reshape(-1, 3), np.concatenate([first + n * sides for n in range(len(rings) - 1)]), colors)


def box_mesh(boxes: Sequence[Box], colors: ArrayLike) -> Mesh:
    """Return one mesh of several boxes.

    Args:
        boxes: n boxes.
        colors: albedo 0..1 of each box (n, 3), or of each of its sides -x, +x, -y, +y, -z, +z (n, 6, 3).
    """
    colors = np.asarray(colors, float)
    if colors.ndim == 2:
        colors = np.repeat(colors[:, None], 6, axis=1)
    vertices = np.concatenate([box.corners[_QUADS].reshape(-1, 3) for box in boxes])
    return quad_mesh(vertices, np.arange(len(vertices)).reshape(-1, 4), colors.reshape(-1, 3))


def bar_mesh(start: ArrayLike, end: ArrayLike, radius: float, color: ArrayLike, *, sides: int = 14) -> Mesh:
    """Return the mesh of a round bar from one point to another, metres, with its ends."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(b - a))
    half, along = length / 2, (b - a) / length
    upright = lathe([(0.0, -half), (radius, -half), (radius, half), (0.0, half)], color, sides=sides)
    across = np.cross(along, [0.0, 1.0, 0.0] if abs(along[1]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    axes = np.stack([across, np.cross(along, across), along])
    return upright.moved(upright.vertices @ axes + (a + b) / 2)


def lathe(profile: ArrayLike, colors: ArrayLike, *, sides: int = 16, squash: float = 1.0) -> Mesh:
    """Return a body of revolution about the z axis, smooth except for edges where the profile bends sharply.

    Args:
        profile: radius and height of m points from bottom to top, (m, 2), metres; radius 0 closes an end.
        colors: albedo of the body (3,), or of each of the m - 1 bands (m - 1, 3).
        sides: number of sides of the circumference.
        squash: ratio of the extent in x to that in y.
    """
    profile = np.asarray(profile, float)
    bands = np.diff(profile, axis=0)
    colors = np.broadcast_to(np.asarray(colors, float), (len(bands), 3))
    unit = bands / np.linalg.norm(bands, axis=1, keepdims=True)
    turn = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([squash * np.cos(turn), np.sin(turn)])
    rings = np.concatenate(
        [profile[:, :1, None] * circle, np.broadcast_to(profile[:, 1, None, None], (len(profile), sides, 1))], axis=2
    )
    edges = [n for n in range(1, len(bands)) if unit[n] @ unit[n - 1] < _CREASE]
    return loft(rings, colors, edges=edges)


def loft(rings: ArrayLike, colors: ArrayLike, *, edges: Sequence[int] = ()) -> Mesh:
    """Return a smooth skin over closed outlines, each connected to the next.

    Args:
        rings: m outlines of s points, counter-clockwise as seen from the side of the last one, (m, s, 3), metres; an
            outline may be a single point.
        colors: albedo of the skin (3,), of each of the m - 1 bands (m - 1, 3), or of each quadrilateral (m - 1, s, 3).
        edges: indices of outlines at which the skin has a sharp edge.
    """
    rings = np.asarray(rings, float)
    count, sides = rings.shape[:2]
    colors = np.asarray(colors, float)
    colors = np.broadcast_to(colors[:, None] if colors.ndim == 2 else colors, (count - 1, sides, 3))
    k = np.arange(sides)
    after = (k + 1) % sides
    skin, quads = [rings[0]], []
    for n in range(1, count):
        if n - 1 in edges:
            skin.append(rings[n - 1])
        skin.append(rings[n])
        low, high = (len(skin) - 2) * sides, (len(skin) - 1) * sides
        quads.append(np.column_stack([low + k, low + after, high + after, high + k]))
    mesh = quad_mesh(np.concatenate(skin), np.concatenate(quads), colors.reshape(-1, 3))
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
    kept = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-10  # at a point, quadrilaterals are triangles
    return replace(mesh, faces=mesh.faces[kept], colors=mesh.colors[kept], smooth=True)


def joined(*meshes: Mesh) -> Mesh:
    """Return one mesh of several, smooth if any is; none may have a texture."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    vertices, colors = (np.concatenate([getattr(mesh, key) for mesh in meshes]) for key in ("vertices", "colors"))
    return Mesh(vertices, faces, colors, smooth=any(mesh.smooth for mesh in meshes))


def box_model(boxes: Sequence[Box], colors: ArrayLike) -> ObjectModel:
    """Return the object model of several boxes; ``colors`` as for :func:`box_mesh`."""
    return ObjectModel(box_mesh(boxes, colors), tuple(boxes))
