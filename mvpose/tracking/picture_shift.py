"""How far the people in one camera's pictures lie from where the other cameras place them.

A camera that has turned or moved shows everybody beside their place. To first order the pictures are shifted, scaled
and turned as a whole: four numbers, which least squares find from all keypoints of a picture. They are angles and
ratios, in normalised image coordinates without distortion: a shift of 0.01 is 0.01 focal lengths in pixels, or 0.57
degrees.

A joint is placed by triangulation from the pictures of the other cameras alone. Where fewer than two of them saw it at
this time, its place is that which the past predicts.
"""

from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.kernels import njit
from mvpose.reconstruction.likelihood import solve

TERMS = 4
"""Shift along x and y of the image, change of scale, and rotation about the image centre (radians)."""

_GATE = 0.3  # metres: a ray that is further from the predicted joint is wrong, or another person's
_PRIOR = 0.02  # rays: weight of the predicted joint, so that rays that are nearly parallel still give a place
_FREEDOM = 4.0  # degrees of freedom of the t distribution of residuals, a common choice for heavy tails
_MEMORY = 10.0  # seconds that the mean residuals are over


class ExpectedPeople(NamedTuple):
    """People who are expected in the pictures of a frame."""

    groups: Integers
    """Group of each track in the matching, (n,), or -1."""
    reported: Bools
    """Whether each has been reported as a person, (n,)."""
    state: Floats
    """Predicted positions and velocities, (n, J, 6)."""


@njit(cache=True)
def measure_shifts(watched, normal, residual, since, trusted, people, rays, sigmas, cameras):
    """Add one picture of a camera to the least squares of its shift, in place.

    Args:
        watched: the camera.
        normal: normal equations, (4, 5): the upper triangle of the matrix, and the right-hand side.
        residual: sums over the latest seconds, (3,): weights, distances in pixels, distances over their standard
            deviation.
        since: time since the previous look at this camera, seconds.
        trusted: whether the calibration of each camera is believed, (V,).
        people: :class:`ExpectedPeople`.
        rays: :class:`mvpose.tracking.pose_update.MatchedRays` of the m detections.
        sigmas: standard deviation of a confident keypoint, (J,), metres.
        cameras: :attr:`mvpose.camera.Rig.packed`, (V, 22).

    Returns:
        Number of keypoints that were added.
    """
    groups, reported, state = people
    labels, view, origins, directions, weights, pixel, lead = rays
    count, camera, point = 0, cameras[watched], np.empty(3)
    keep = np.exp(-since / _MEMORY)
    for k in range(3):
        residual[k] *= keep
    work = np.empty((8, 3))
    for t in range(len(groups)):
        if groups[t] < 0 or not reported[t]:
            continue
        here = -1
        for d in range(len(labels)):
            if labels[d] == groups[t] and view[d] == watched:
                here = d
        if here < 0:
            continue
        for j in range(weights.shape[1]):
            if not weights[here, j] > 0.0 or np.isnan(state[t, j, 0]):
                continue
            _place(point, groups[t], watched, state[t, j], j, trusted, rays, work)
            px, py, pz, ox, oy, oz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for r in range(3):
                offset = point[r] + lead[here] * state[t, j, 3 + r] - origins[here, r]
                px += camera[5 + r] * offset
                py += camera[8 + r] * offset
                pz += camera[11 + r] * offset
                ox += camera[5 + r] * directions[here, j, r]
                oy += camera[8 + r] * directions[here, j, r]
                oz += camera[11 + r] * directions[here, j, r]
            if not pz > 0.1 or not oz > 0.1:
                continue
            x, y = px / pz, py / pz
            dx, dy = ox / oz - x, oy / oz - y
            variance = (sigmas[j] / (pz * weights[here, j])) ** 2 + pixel[here] ** 2
            square = (dx * dx + dy * dy) / variance
            sure = 1.0 / (1.0 + square / _FREEDOM)
            residual[0] += sure
            residual[1] += sure * np.sqrt(dx * dx + dy * dy) * camera[0]
            residual[2] += sure * np.sqrt(square)
            _add(normal, x, y, dx, dy, sure / variance)
            count += 1
    return count


@njit(cache=True, borrows=True)
def _place(point, group, watched, state, j, trusted, rays, work):
    """Write the place of one joint at the time of its state, from the pictures of the trusted cameras but one."""
    labels, view, origins, directions, weights, _, lead = rays
    A, inverse, b, origin = work[:3], work[3:6], work[6], work[7]
    count = 0
    for r in range(3):
        b[r] = _PRIOR * state[r]
        for c in range(3):
            A[r, c] = _PRIOR if r == c else 0.0
    for d in range(len(labels)):
        weight = weights[d, j]
        if labels[d] != group or view[d] == watched or not trusted[view[d]] or not weight > 0.0:
            continue
        along, square = 0.0, 0.0
        for r in range(3):
            origin[r] = origins[d, r] - lead[d] * state[3 + r]
            along += (state[r] - origin[r]) * directions[d, j, r]
            square += (state[r] - origin[r]) ** 2
        if square - along * along > _GATE * _GATE:
            continue
        count += 1
        toward = 0.0
        for r in range(3):
            toward += directions[d, j, r] * origin[r]
        for r in range(3):
            b[r] += weight * (origin[r] - toward * directions[d, j, r])
            A[r, r] += weight
            for c in range(3):
                A[r, c] -= weight * directions[d, j, r] * directions[d, j, c]
    if count < 2 or not solve(A, b, inverse, point):
        for r in range(3):
            point[r] = state[r]


@njit(cache=True, borrows=True)
def _add(normal, x, y, dx, dy, weight):
    """Add a keypoint at (x, y) that was found (dx, dy) beside it; rows [1, 0, x, -y] and [0, 1, y, x]."""
    normal[0, 0] += weight
    normal[0, 2] += weight * x
    normal[0, 3] -= weight * y
    normal[0, 4] += weight * dx
    normal[1, 1] += weight
    normal[1, 2] += weight * y
    normal[1, 3] += weight * x
    normal[1, 4] += weight * dy
    normal[2, 2] += weight * (x * x + y * y)
    normal[2, 4] += weight * (x * dx + y * dy)
    normal[3, 3] += weight * (x * x + y * y)
    normal[3, 4] += weight * (x * dy - y * dx)


@njit(cache=True)
def solve_shift(shift, variance, normal, prior):
    """Write the shift (4,) and its variances (4,) if keypoints were independent, from normal equations.

    Args:
        shift: output, (4,).
        variance: output, (4,).
        normal: normal equations, (4, 5): the upper triangle of the matrix, and the right-hand side.
        prior: standard deviation of each number before anything is seen.
    """
    A = np.zeros((TERMS, 2 * TERMS))  # Gauss-Jordan without pivots: the matrix is positive definite
    for r in range(TERMS):
        for c in range(TERMS):
            A[r, c] = normal[min(r, c), max(r, c)]
        A[r, r] += 1.0 / (prior * prior)
        A[r, TERMS + r] = 1.0
    for k in range(TERMS):
        pivot = A[k, k]
        for c in range(2 * TERMS):
            A[k, c] /= pivot
        for r in range(TERMS):
            factor = A[r, k]
            for c in range(2 * TERMS):
                A[r, c] -= factor * A[k, c] if r != k else 0.0
    for r in range(TERMS):
        shift[r], variance[r] = 0.0, A[r, TERMS + r]
        for c in range(TERMS):
            shift[r] += A[r, TERMS + c] * normal[c, TERMS]
