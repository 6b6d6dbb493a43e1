"""Boxes around people without pictures: the outermost points of each body part, skinned and projected.

A part's skin is nearly convex, so its extremes in a few directions, and the edges of their convex hull, have its
outline from wherever it is seen; where the image's border cuts a person the edges are cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from mvpose.arrays import Floats, Integers
from mvpose.camera import Camera
from mvpose.lens import distort
from simharness.capture.rendering.renderer import NEAR
from simharness.world.humans.body import Body
from simharness.world.humans.skinning import skin

_DIRECTIONS = 24  # in which the extremes of a part are taken
_SHARE = 0.2  # of a vertex's weight makes it the part's: neighbouring parts overlap, so that no gap is between them


@dataclass(frozen=True)
class Outline:
    """The outermost vertices of one body and how they hang together: a few hundred instead of ten thousand.

    Attributes:
        vertices: at rest, (n, 3) float32 metres.
        weight_bones, weights: their skinning, (n, w).
        edges: pairs of vertices, (e, 2).
    """

    vertices: NDArray[np.float32]
    weight_bones: NDArray[np.uint8]
    weights: NDArray[np.float32]
    edges: NDArray[np.int64]

    @classmethod
    def of(cls, body: Body) -> Outline:
        """Choose the outermost vertices of a body: of each bone's skin the extremes in directions all around."""
        directions = _around(_DIRECTIONS)
        share = np.zeros((len(body.vertices), len(body.bones)), np.float32)
        np.add.at(share, (np.arange(len(body.vertices))[:, None], body.weight_bones), body.weights)
        parts = []
        for mine in share.T > _SHARE:
            if mine.any():
                candidates = np.flatnonzero(mine)
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
        """The vertices (n, 3) in the world from bone transforms (B, 3, 4)."""
        moved = np.empty_like(self.vertices)
        skin(self.vertices, self.weight_bones, self.weights, transforms.astype(np.float32), moved)
        return moved


def _around(count: int) -> NDArray[np.float32]:
    """Unit vectors all around, (count, 3): a Fibonacci spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - height**2)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]).astype(np.float32)


def _hull(points: NDArray[np.float32]) -> NDArray[np.int64]:
    """Edges (e, 2) of the convex hull of points (n, 3); of points in a plane or fewer than five, all pairs."""
    n = len(points)
    if n > 4 and np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-4) == 3:
        triangles = ConvexHull(points).simplices
        return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    return np.column_stack(np.triu_indices(n, 1)).astype(np.int64)


NO_EDGES = np.zeros((0, 2), np.int64)
"""Of a skin so fine that its vertices tell where the border of an image cuts it."""


def boxes(bands: Sequence[Sequence[NDArray]], edges: Sequence[Integers], cameras: Sequence[Camera]) -> Floats:
    """Boxes x, y, width, height of the parts of people that fall on each image, (V, P, 4); zeros where nobody is.

    Args:
        bands: vertices of every person, (n, 3) metres, in the moments of the bands of rows from the top; one moment
            where all rows are taken at once.
        edges: of every person's outline, (e, 2).
        cameras: V.
    """
    table = np.stack([packed(camera) for camera in cameras])
    found = np.empty((len(bands), len(cameras), len(edges), 4))
    for k, people in enumerate(bands):
        rows = k / len(bands), (k + 1) / len(bands)
        for person, (vertices, lines) in enumerate(zip(people, edges, strict=True)):
            framed(vertices, lines, table, *rows, found[k, :, person])
    low, high = found[..., :2].min(axis=0), found[..., 2:].max(axis=0)
    there = (high >= low).all(axis=-1, keepdims=True)
    return np.where(there, np.concatenate([low, np.where(there, high - low, 0.0)], axis=-1), 0.0)


def packed(camera: Camera) -> Floats:
    """A camera for the kernel, (26,).

    fx, skew, cx, fy, cy; R by rows; t; distortion; size; the square of where the lens ends; 1 where it distorts, or 0.
    """
    K = camera.K
    bent = float(camera.distortion.any())
    intrinsics = (K[0, 0], K[0, 1], K[0, 2], K[1, 1], K[1, 2])
    return np.array([*intrinsics, *camera.R.ravel(), *camera.t, *camera.distortion, *camera.size, _end(camera), bent])


def _end(camera: Camera) -> float:
    """Squared distance from the axis, at unit depth, at which the radial polynomial of a lens folds over."""
    k1, k2, _, _, k3 = camera.distortion
    if k1 == k2 == k3 == 0:
        return np.inf
    roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    ends = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
    return float(ends.min(initial=np.inf))


@njit(cache=True)
def framed(points, edges, cameras, first_row, last_row, out):
    """Box the part of a person that falls on each image.

    Args:
        points: vertices of the outline in the world, (n, 3).
        edges: between them, (e, 2).
        cameras: as :func:`packed`, (V, 26).
        first_row: of the band of each image to look at, as a share of its height.
        last_row: the same of its end.
        out: left, top, right, bottom in pixels, (V, 4); left beyond right where nothing falls on the image.
    """
    n = len(points)
    local, pixel, state = np.empty((n, 3)), np.empty((n, 2)), np.empty(n, np.int8)
    box, image = np.empty(4), np.empty(4)
    for view in range(len(cameras)):
        c = cameras[view]
        image[:] = -0.5, first_row * c[23] - 0.5, c[22] - 0.5, last_row * c[23] - 0.5
        box[:] = np.inf, np.inf, -np.inf, -np.inf
        all_in = True
        for i in range(n):
            x, y, z = points[i, 0] + 0.0, points[i, 1] + 0.0, points[i, 2] + 0.0
            a = c[5] * x + c[6] * y + c[7] * z + c[14]
            b = c[8] * x + c[9] * y + c[10] * z + c[15]
            d = c[11] * x + c[12] * y + c[13] * z + c[16]
            local[i, 0], local[i, 1], local[i, 2] = a, b, d
            imaged, u, v = _project(a, b, d, c)
            pixel[i, 0], pixel[i, 1] = u, v
            if imaged == _IN_FRONT and image[0] <= u <= image[2] and image[1] <= v <= image[3]:
                imaged = _IN_IMAGE
                _widen(box, u, v)
            else:
                all_in = False
            state[i] = imaged
        if not all_in:
            for e in range(len(edges)):
                i, j = edges[e, 0], edges[e, 1]
                if state[i] + state[j] < 2 * _IN_IMAGE:
                    _cut(i, j, local, pixel, state, c, image, box)
        out[view] = box


_BEYOND, _BEHIND, _IN_FRONT, _IN_IMAGE = -1, 0, 1, 2  # beyond what the lens images; nearer than ``NEAR``


@njit(cache=True)
def _project(x, y, z, c):
    """Whether a point of the camera's frame is imaged, and its pixel."""
    if z < NEAR:
        return _BEHIND, 0.0, 0.0
    x, y = x / z, y / z
    if x * x + y * y >= c[24]:
        return _BEYOND, 0.0, 0.0
    if c[25] != 0.0:
        x, y = distort(x, y, c[17:22])
    return _IN_FRONT, c[0] * x + c[1] * y + c[2], c[3] * y + c[4]


@njit(cache=True)
def _widen(box, u, v):
    box[0], box[1] = min(box[0], u), min(box[1], v)
    box[2], box[3] = max(box[2], u), max(box[3], v)


@njit(cache=True)
def _cut(i, j, local, pixel, state, c, image, box):
    """Widen a box by what an edge has within the image: Liang and Barsky, ACM Trans. Graphics 3, 1984."""
    one, two = state[i], state[j]
    if one == _BEYOND or two == _BEYOND or (one == _BEHIND and two == _BEHIND):
        return
    u, v, to_u, to_v = pixel[i, 0], pixel[i, 1], pixel[j, 0], pixel[j, 1]
    if one == _BEHIND or two == _BEHIND:
        share = (NEAR - local[i, 2]) / (local[j, 2] - local[i, 2])
        x, y = (1 - share) * local[i, 0] + share * local[j, 0], (1 - share) * local[i, 1] + share * local[j, 1]
        imaged, new_u, new_v = _project(x, y, NEAR, c)
        if imaged != _IN_FRONT:
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
