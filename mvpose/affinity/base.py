"""Shared parts of the affinities: protocol, sigmoid, and grouping of detections by view for the kernels."""

import math
from typing import Protocol

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.kernels import njit
from mvpose.ordering import rank_views
from mvpose.rays import Rays

LANES = 8  # joints are padded to full vector registers, so no loop has a scalar remainder
FASTMATH = {"reassoc", "contract", "arcp", "nsz"}  # allows vectorised sums; keeps the semantics of NaN and infinity


class Affinity(Protocol):
    """Likelihood that two detections of different views show the same person."""

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Return the affinity matrix, (m, m), 0 to 1, symmetric; 0 for detections of one view and on the diagonal.

        Args:
            rig: V cameras.
            detections: m detections.
            rays: viewing rays of the same m detections.
        """
        ...


def sigmoid(distance: Floats, *, midpoint: float, slope: float) -> Floats:
    """Map distances to affinities in (0, 1) by a decreasing sigmoid, 1/2 at ``midpoint``; 0 for infinite distance."""
    return 1.0 / (1.0 + np.exp(np.clip((distance - midpoint) / slope, -700.0, 700.0))) * np.isfinite(distance)


@njit(cache=True)
def scalar_sigmoid(distance, midpoint, slope):
    """Return the :func:`sigmoid` of one finite distance."""
    return 1.0 / (1.0 + math.exp((distance - midpoint) / slope))


@njit(cache=True)
def group_by_view(view):
    """Return the detections grouped by view, (m,), the start of each view that has any, and the end of the last.

    The views come in the order of their first detections, so that their numbers do not matter.
    """
    view, _ = rank_views(view)
    m = len(view)
    order = np.arange(m)
    for i in range(1, m):  # insertion sort, because detections are nearly always sorted already
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
def pack_poses(directions, weights, order, channels):
    """Return poses as (m, channels, J padded with zeros to full registers): x, y, z, weight, and unused channels.

    A joint without a weight or without a direction is missing and all zeros.
    """
    m, joints = weights.shape
    pose = np.zeros((m, channels, (joints + LANES - 1) // LANES * LANES))
    for i in range(m):
        for j in range(joints):
            x, y, z = directions[order[i], j, 0], directions[order[i], j, 1], directions[order[i], j, 2]
            if weights[order[i], j] > 0.0 and x * x + y * y + z * z > 0.5:  # false for NaN
                pose[i, 0, j], pose[i, 1, j], pose[i, 2, j], pose[i, 3, j] = x, y, z, weights[order[i], j]
    return pose


@njit(cache=True, fastmath=FASTMATH)
def shared_joints(one, other):
    """Return the sum of the products of the weights of two poses, (J,) each, and the number of joints both have."""
    mass, count = 0.0, 0
    for j in range(len(one)):
        weight = one[j] * other[j]
        mass += weight
        count += weight > 0.0
    return mass, count
