"""What the affinities share: the protocol, the sigmoid, and the pairs of views that their kernels run over."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numba import njit

from mvpose.arrays import Floats
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.rays import Rays

LANES = 8  # kernels pad the joints to full vector registers, so that no loop has a scalar remainder
FASTMATH = {"reassoc", "contract", "arcp", "nsz"}  # sums may be vectorised; NaN and infinity keep their meaning


class Affinity(Protocol):
    """How likely two detections of different views are one person."""

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Affinity matrix, (m, m), 0 to 1, symmetric; 0 for two detections of one view and on the diagonal.

        Args:
            rig: V cameras.
            detections: m poses of their views.
            rays: the same m poses as viewing rays.
        """
        ...


def sigmoid(distance: Floats, *, midpoint: float, slope: float) -> Floats:
    """Map distances to affinities in (0, 1), 1/2 at ``midpoint``, falling; 0 for an infinite distance."""
    return 1.0 / (1.0 + np.exp(np.clip((distance - midpoint) / slope, -700.0, 700.0))) * np.isfinite(distance)


@njit(cache=True)
def falling(distance, midpoint, slope):
    """:func:`sigmoid` of one finite distance."""
    return 1.0 / (1.0 + math.exp((distance - midpoint) / slope))


@njit(cache=True)
def by_view(view):
    """Detections in the order of their views, (m,), and where each view that has any starts and the last ends."""
    m = len(view)
    order = np.arange(m)
    for i in range(1, m):  # insertion: nearly always in order already
        k = i
        while k > 0 and view[order[k - 1]] > view[i]:
            order[k] = order[k - 1]
            k -= 1
        order[k] = i
    start = np.zeros(m + 1, np.int64)
    groups = 0
    for i in range(m):
        if i == 0 or view[order[i]] != view[order[i - 1]]:
            start[groups] = i
            groups += 1
    start[groups] = m
    return order, start[: groups + 1]


@njit(cache=True)
def lay_out(directions, weights, order, channels):
    """Poses for the kernels, (m, channels, J and zeros up to full registers): x, y, z, weight, and room for more.

    A joint without a weight or without a direction is missing: all zeros.
    """
    m, joints = weights.shape
    pose = np.zeros((m, channels, (joints + LANES - 1) // LANES * LANES))
    for i in range(m):
        for j in range(joints):
            x, y, z = directions[order[i], j, 0], directions[order[i], j, 1], directions[order[i], j, 2]
            if weights[order[i], j] > 0.0 and x * x + y * y + z * z > 0.5:  # false of NaN
                pose[i, 0, j], pose[i, 1, j], pose[i, 2, j], pose[i, 3, j] = x, y, z, weights[order[i], j]
    return pose


@njit(cache=True, fastmath=FASTMATH)
def in_common(one, other):
    """Sum of the products of two poses' weights, (J,) each, and how many joints both have."""
    mass, count = 0.0, 0
    for j in range(len(one)):
        weight = one[j] * other[j]
        mass += weight
        count += weight > 0.0
    return mass, count
