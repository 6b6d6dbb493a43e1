"""Compiled kernels of the body model: blend shapes, linear blend skinning, volume, and the motion of skirts."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit


@njit(cache=True, fastmath=True)
def skin(
    vertices: NDArray[np.float32],
    bones: NDArray[np.uint8],
    weights: NDArray[np.float32],
    transforms: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the vertices ``out`` (n, 3) of linear blend skinning; transforms (B, 3, 4), bones and weights (n, w)."""
    for i in range(vertices.shape[0]):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        new_x, new_y, new_z = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for k in range(bones.shape[1]):
            weight = weights[i, k]
            if weight > 0.0:
                t = transforms[bones[i, k]]
                new_x += weight * (t[0, 0] * x + t[0, 1] * y + t[0, 2] * z + t[0, 3])
                new_y += weight * (t[1, 0] * x + t[1, 1] * y + t[1, 2] * z + t[1, 3])
                new_z += weight * (t[2, 0] * x + t[2, 1] * y + t[2, 2] * z + t[2, 3])
        out[i, 0], out[i, 1], out[i, 2] = new_x, new_y, new_z


@njit(cache=True, fastmath=True)
def mix(
    mean: NDArray[np.float64], deltas: NDArray[np.int16], shares: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Write ``mean`` (d,) plus the ``deltas`` (C, d) weighted by ``shares`` (C,) to ``out`` (d,).

    A threaded BLAS would take ten times as long.
    """
    for i in range(out.shape[0]):  # an assignment of arrays would take two seconds to compile
        out[i] = mean[i]
    for c in range(deltas.shape[0]):
        for i in range(out.shape[0]):
            out[i] += shares[c] * deltas[c, i]


@njit(cache=True, fastmath=True)
def enclosed(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> float:
    """Return the volume inside a closed surface of ``vertices`` (n, 3) and ``faces`` (k, 3)."""
    total = 0.0
    for a, b, c in faces:
        ax, ay, az = vertices[a]
        bx, by, bz = vertices[b]
        cx, cy, cz = vertices[c]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6


@dataclass(frozen=True)
class Skirt:
    """Motion of the s vertices of a skirt.

    Every vertex has a direction outwards. It follows the pelvis and the thigh that extends further in that direction,
    with a smooth transition between the two thighs.
    """

    first: int
    """Index of the skirt's first vertex in the body."""
    anchors: NDArray[np.float32]
    """Rest positions of the vertices on the pelvis, the left thigh and the right thigh, (s, 3, 3) metres."""
    centers: NDArray[np.float32]
    """Centres of the left and the right thigh at the level of the vertices, at rest, (s, 2, 3) metres."""
    directions: NDArray[np.float32]
    """Outward unit vectors of the vertices at rest, (s, 3)."""
    pelvis_share: NDArray[np.float32]
    """Weight of the pelvis in the position of the vertices, 0 to 1, (s,)."""
    bones: tuple[int, int, int]
    """Indices of the bones of pelvis, left and right thigh."""

    def hang(self, transforms: NDArray[np.float32], out: NDArray[np.float32]) -> None:
        """Write the skirt's vertices, posed by bone transforms (B, 3, 4), into the body's vertices ``out`` (n, 3)."""
        rows = out[self.first : self.first + len(self.pelvis_share)]
        pelvis, left, right = (transforms[bone] for bone in self.bones)
        _hang(self.anchors, self.centers, self.directions, self.pelvis_share, pelvis, left, right, rows)


_SOFT = np.float32(0.05)  # width of the transition between the thighs, metres of difference in reach


@njit(cache=True, fastmath=True)
def _hang(
    anchors: NDArray[np.float32],
    centers: NDArray[np.float32],
    directions: NDArray[np.float32],
    pelvis_share: NDArray[np.float32],
    pelvis: NDArray[np.float32],
    left: NDArray[np.float32],
    right: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the posed vertices ``out`` (s, 3) of a :class:`Skirt` from the transforms (3, 4) of its three bones."""
    for i in range(pelvis_share.shape[0]):
        lead = np.float32(0.0)  # distance by which the left thigh extends further in the vertex's direction
        for row in range(3):
            direction = np.float32(0.0)
            between = left[row, 3] - right[row, 3]
            for k in range(3):
                direction += pelvis[row, k] * directions[i, k]
                between += left[row, k] * centers[i, 0, k] - right[row, k] * centers[i, 1, k]
            lead += direction * between
        share = np.float32(1.0) / (np.float32(1.0) + np.exp(-lead / _SOFT))
        for row in range(3):
            on_pelvis, on_left, on_right = pelvis[row, 3], left[row, 3], right[row, 3]
            for k in range(3):
                on_pelvis += pelvis[row, k] * anchors[i, 0, k]
                on_left += left[row, k] * anchors[i, 1, k]
                on_right += right[row, k] * anchors[i, 2, k]
            on_legs = share * on_left + (np.float32(1.0) - share) * on_right
            out[i, row] = pelvis_share[i] * on_pelvis + (np.float32(1.0) - pelvis_share[i]) * on_legs
