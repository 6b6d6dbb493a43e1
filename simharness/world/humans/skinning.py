"""The kernels of bodies: blend shapes, linear blend skinning, volume; and skirts, which hang from two thighs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, fastmath=True)
def skin(
    vertices: NDArray[np.float32],
    bones: NDArray[np.uint8],
    weights: NDArray[np.float32],
    transforms: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Move ``vertices`` (n, 3) by the ``weights`` (n, w) of the ``transforms`` (B, 3, 4) of ``bones`` (n, w)."""
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
    """Add to ``mean`` (d,) the ``shares`` (C,) of ``deltas`` (C, d). A threaded BLAS would take ten times as long."""
    out[:] = mean
    for c in range(deltas.shape[0]):
        for i in range(out.shape[0]):
            out[i] += shares[c] * deltas[c, i]


@njit(cache=True, fastmath=True)
def enclosed(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> float:
    """Volume inside a closed surface of ``vertices`` (n, 3) and ``faces`` (k, 3)."""
    total = 0.0
    for a, b, c in faces:
        ax, ay, az = vertices[a]
        bx, by, bz = vertices[b]
        cx, cy, cz = vertices[c]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6


@dataclass(frozen=True)
class Skirt:
    """Vertices (s,) of a skirt: each lies where it looks, on the leg that reaches further there; (..., 3) in metres.

    Attributes:
        first: which vertex of the body is the skirt's first.
        anchors: where at rest it would lie on the pelvis, the left thigh and the right thigh, (s, 3, 3).
        centers: the middles of the left and the right thigh at its level, at rest, (s, 2, 3).
        looks: its direction at rest, of length one, (s, 3).
        held: share of the pelvis in where it lies, (s,).
        bones: indices of pelvis, left and right thigh.
    """

    first: int
    anchors: NDArray[np.float32]
    centers: NDArray[np.float32]
    looks: NDArray[np.float32]
    held: NDArray[np.float32]
    bones: tuple[int, int, int]

    def hang(self, transforms: NDArray[np.float32], out: NDArray[np.float32]) -> None:
        """Write its vertices into those of the body, ``out`` (n, 3), moved by bone transforms (B, 3, 4)."""
        own = out[self.first : self.first + len(self.held)]
        pelvis, left, right = (transforms[bone] for bone in self.bones)
        _hang(self.anchors, self.centers, self.looks, self.held, pelvis, left, right, own)


_SOFT = np.float32(0.05)  # metres by which one leg must reach further to have a vertex nearly for itself


@njit(cache=True, fastmath=True)
def _hang(
    anchors: NDArray[np.float32],
    centers: NDArray[np.float32],
    looks: NDArray[np.float32],
    held: NDArray[np.float32],
    pelvis: NDArray[np.float32],
    left: NDArray[np.float32],
    right: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    for i in range(held.shape[0]):
        further = np.float32(0.0)  # by how much the left thigh reaches further in the vertex's direction
        for row in range(3):
            look = np.float32(0.0)
            between = left[row, 3] - right[row, 3]
            for k in range(3):
                look += pelvis[row, k] * looks[i, k]
                between += left[row, k] * centers[i, 0, k] - right[row, k] * centers[i, 1, k]
            further += look * between
        share = np.float32(1.0) / (np.float32(1.0) + np.exp(-further / _SOFT))
        for row in range(3):
            on_pelvis, on_left, on_right = pelvis[row, 3], left[row, 3], right[row, 3]
            for k in range(3):
                on_pelvis += pelvis[row, k] * anchors[i, 0, k]
                on_left += left[row, k] * anchors[i, 1, k]
                on_right += right[row, k] * anchors[i, 2, k]
            on_legs = share * on_left + (np.float32(1.0) - share) * on_right
            out[i, row] = held[i] * on_pelvis + (np.float32(1.0) - held[i]) * on_legs
