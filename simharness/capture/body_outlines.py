"""Boxes around people without rendering: extreme vertices of each body part, skinned and projected.

The skin of a part is nearly convex, so its extreme vertices in a few directions and the edges of their convex hull give
its outline from every viewpoint. Edges are clipped at the image border.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera
from mvpose.kernels import njit
from simharness.capture.rendering.renderer import NEAR
from simharness.world.humans.body import Body
from simharness.world.humans.skinning import skin
from simharness.world.rigs.projection import bend, fold_radius2, is_imaged

_DIRECTIONS = 24  # in which the extreme vertices of a part are taken
_MIN_WEIGHT = 0.2  # least skinning weight of a vertex in a part: neighbouring parts overlap, which avoids gaps


@dataclass(frozen=True)
class Outline:
    """Outermost vertices and edges of one body: a few hundred vertices instead of ten thousand.

    Attributes:
        vertices: positions in the rest pose, (n, 3) float32, metres.
        weight_bones, weights: skinning bones and weights, (n, w).
        edges: pairs of vertices, (e, 2).
    """

    vertices: NDArray[np.float32]
    weight_bones: NDArray[np.uint8]
    weights: NDArray[np.float32]
    edges: NDArray[np.int64]

    @classmethod
    def from_body(cls, body: Body) -> "Outline":
        """Choose the outermost vertices of a body: the extreme vertices of the skin of each bone in all directions."""
        directions = even_directions(_DIRECTIONS)
        share = np.zeros((len(body.vertices), len(body.bones)), np.float32)
        np.add.at(share, (np.arange(len(body.vertices))[:, None], body.weight_bones), body.weights)
        parts = []
        for in_part in share.T > _MIN_WEIGHT:
            if in_part.any():
                candidates = np.flatnonzero(in_part)
                parts.append(np.unique(candidates[(body.vertices[candidates] @ directions.T).argmax(axis=0)]))
        chosen = np.unique(np.concatenate(parts))
        edges = np.concatenate([np.searchsorted(chosen, part)[_hull(body.vertices[part])] for part in parts])
        return cls(
            vertices=np.ascontiguousarray(body.vertices[chosen]),
            weight_bones=np.ascontiguousarray(body.weight_bones[chosen]),
            weights=np.ascontiguousarray(body.weights[chosen]),
            edges=np.unique(np.sort(edges, axis=1), axis=0),
        )

    def at(self, transforms: Floats) -> NDArray[np.float32]:
        """Return the vertices in the world, (n, 3), for bone transforms (B, 3, 4)."""
        moved = np.empty_like(self.vertices)
        skin(self.vertices, self.weight_bones, self.weights, transforms.astype(np.float32), moved)
        return moved


def even_directions(count: int) -> NDArray[np.float32]:
    """Return evenly spread unit vectors, (count, 3): a Fibonacci spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - height**2)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]).astype(np.float32)


def _hull(points: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return the edges (e, 2) of the convex hull of points (n, 3); all pairs of coplanar or fewer than five points."""
    n = len(points)
    if n > 4 and np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-4) == 3:
        triangles = ConvexHull(points).simplices
        return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    return np.column_stack(np.triu_indices(n, 1)).astype(np.int64)


NO_EDGES = np.zeros((0, 2), np.int64)
"""Edges for a mesh so fine that clipping its edges at the image border is not necessary."""


def boxes(
    bands: Sequence[Sequence[NDArray]],
    edges: Sequence[Integers],
    cameras: Sequence[Camera],
    table: Floats | None = None,
) -> Floats:
    """Return boxes x, y, width, height of the parts of people inside each image, (V, P, 4); zeros if none is inside.

    Args:
        bands: vertices of every person, (n, 3) metres, at the times of the bands of rows from the top; one time if all
            rows are exposed at once.
        edges: edges of the outline of every person, (e, 2).
        cameras: V cameras.
        table: their parameters if they are known, (V, 26), see :func:`packed`.
    """
    if table is None:
        table = np.stack([packed(camera) for camera in cameras])
    limits = np.empty((len(bands), len(cameras), len(edges), 4))
    for k, people in enumerate(bands):
        rows = k / len(bands), (k + 1) / len(bands)
        for person, (vertices, lines) in enumerate(zip(people, edges, strict=True)):
            bounding_box(vertices, lines, table, *rows, limits[k, :, person])
    low, high = limits[..., :2].min(axis=0), limits[..., 2:].max(axis=0)
    inside = (high >= low).all(axis=-1, keepdims=True)
    return np.where(inside, np.concatenate([low, np.where(inside, high - low, 0.0)], axis=-1), 0.0)


def packed(camera: Camera) -> Floats:
    """Return the parameters of a camera for the kernel, (26,).

    fx, skew, cx, fy, cy; R by rows; t; distortion; size; squared radius at which the lens folds over; 1 if the lens
    distorts, else 0.
    """
    K = camera.K
    bent = float(camera.distortion.any())
    intrinsics = (K[0, 0], K[0, 1], K[0, 2], K[1, 1], K[1, 2])
    lens = (fold_radius2(camera.distortion) if bent else np.inf, bent)
    return np.array([*intrinsics, *camera.R.ravel(), *camera.t, *camera.distortion, *camera.size, *lens])


@njit(cache=True)
def bounding_box(points, edges, cameras, first_row, last_row, out):
    """Compute the box of the part of a person inside each image.

    Args:
        points: vertices of the outline in the world, (n, 3).
        edges: edges of the outline, (e, 2).
        cameras: parameters of the cameras as returned by :func:`packed`, (V, 26).
        first_row: start of the band of rows, as a share of the height of the image.
        last_row: end of the band of rows, as a share of the height of the image.
        out: output, left, top, right, bottom in pixels, (V, 4); left > right if nothing is inside the image.
    """
    n = len(points)
    local, pixel, state = np.empty((n, 3)), np.empty((n, 2)), np.empty(n, np.int8)
    box, image = np.empty(4), np.empty(4)
    for view in range(len(cameras)):
        c = cameras[view]
        # One by one: an assignment of arrays or tuples takes seconds to compile, as it brings the text of an error.
        image[0], image[1], image[2], image[3] = -0.5, first_row * c[23] - 0.5, c[22] - 0.5, last_row * c[23] - 0.5
        box[0], box[1], box[2], box[3] = np.inf, np.inf, -np.inf, -np.inf
        all_in = True
        for i in range(n):
            x, y, z = points[i, 0] + 0.0, points[i, 1] + 0.0, points[i, 2] + 0.0
            a = c[5] * x + c[6] * y + c[7] * z + c[14]
            b = c[8] * x + c[9] * y + c[10] * z + c[15]
            d = c[11] * x + c[12] * y + c[13] * z + c[16]
            local[i, 0], local[i, 1], local[i, 2] = a, b, d
            imaged, u, v = project_vertex(a, b, d, c)
            pixel[i, 0], pixel[i, 1] = u, v
            if imaged == IN_FRONT and image[0] <= u <= image[2] and image[1] <= v <= image[3]:
                imaged = _IN_IMAGE
                _widen(box, u, v)
            else:
                all_in = False
            state[i] = imaged
        if not all_in:
            for e in range(len(edges)):
                i, j = edges[e, 0], edges[e, 1]
                if state[i] + state[j] < 2 * _IN_IMAGE:
                    _clip_edge(i, j, local, pixel, state, c, image, box)
        for k in range(4):
            out[view, k] = box[k]


_BEYOND, _BEHIND, IN_FRONT, _IN_IMAGE = -1, 0, 1, 2  # beyond the fold of the lens; depth below ``NEAR``


@njit(cache=True)
def project_vertex(x, y, z, c):
    """Return the state of a point in camera coordinates (``_BEYOND`` to ``IN_FRONT``) and its pixel."""
    if z < NEAR:
        return _BEHIND, 0.0, 0.0
    x, y = x / z, y / z
    if c[25] != 0.0:
        if not is_imaged(x, y, c[17:22], c[24]):
            return _BEYOND, 0.0, 0.0
        x, y = bend(x, y, c[17:22])
    return IN_FRONT, c[0] * x + c[1] * y + c[2], c[3] * y + c[4]


@njit(cache=True)
def _widen(box, u, v):
    box[0], box[1] = min(box[0], u), min(box[1], v)
    box[2], box[3] = max(box[2], u), max(box[3], v)


@njit(cache=True)
def _clip_edge(i, j, local, pixel, state, c, image, box):
    """Widen a box by the part of an edge inside the image (Liang and Barsky, ACM Trans. Graphics 3, 1984)."""
    one, two = state[i], state[j]
    if one == _BEYOND or two == _BEYOND or (one == _BEHIND and two == _BEHIND):
        return
    u, v, to_u, to_v = pixel[i, 0], pixel[i, 1], pixel[j, 0], pixel[j, 1]
    if one == _BEHIND or two == _BEHIND:
        share = (NEAR - local[i, 2]) / (local[j, 2] - local[i, 2])
        x, y = (1 - share) * local[i, 0] + share * local[j, 0], (1 - share) * local[i, 1] + share * local[j, 1]
        imaged, new_u, new_v = project_vertex(x, y, NEAR, c)
        if imaged != IN_FRONT:
            return
        if one == _BEHIND:
            u, v = new_u, new_v
        else:
            to_u, to_v = new_u, new_v
    if max(u, to_u) < image[0] or min(u, to_u) > image[2] or max(v, to_v) < image[1] or min(v, to_v) > image[3]:
        return
    low, high = 0.0, 1.0
    du, dv = to_u - u, to_v - v
    for step, room in ((-du, u - image[0]), (du, image[2] - u), (-dv, v - image[1]), (dv, image[3] - v)):
        if step == 0.0:
            if room < 0.0:
                return
        elif step < 0.0:
            low = max(low, room / step)
        else:
            high = min(high, room / step)
    if low <= high:
        _widen(box, u + low * du, v + low * dv)
        _widen(box, u + high * du, v + high * dv)
