"""How well a point in space explains what the views saw: the likelihood term of the paper's section 3.3.

Each view that detected a joint says ``p(I_v | X) = floor + score * exp(-e^2 / (2 sigma^2))``, where e is the
distance in metres from X to the viewing ray. The floor models a keypoint that is simply wrong; without it one bad
view would veto the truth. sigma is the scatter of a detector across the body, in metres and so the same for every
rig, with the angle of a pixel added: far away, pixels are what limits it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.skeleton import Skeleton

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """The error model of a keypoint.

    Attributes:
        area: what OKS calls the square root of the person's area, in metres: an adult fills 53 % of a box of
            1.7 m x 0.55 m (Ronchi & Perona 2017 give the share).
        definition: deviation of what detectors mean by a joint from view to view, metres.
        pixels: deviation in pixels that no detector goes below.
        floor: likelihood of a keypoint anywhere, as a share of the peak of a right one. One keypoint in ten is
            grossly wrong (PoseFix's rates) and lies anywhere in a square metre; the others within 0.05 m.
    """

    area: float = 0.70
    definition: float = 0.02
    pixels: float = 1.0
    floor: float = 0.01

    def sigmas(self, skeleton: Skeleton) -> Floats:
        """Standard deviation of every joint across the ray, (J,), metres."""
        return np.hypot(self.area * np.asarray(skeleton.sigmas), self.definition)


@njit(cache=True)
def view_terms(point, origin, direction, weight, pixel, sigma, floor):  # type: ignore[no-untyped-def]
    """One view's ``(responsibility, variance, likelihood)`` at a point.

    The responsibility is the posterior that this keypoint is right given that the joint is at the point; a point
    behind the camera gets the floor alone.
    """
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    along = x * direction[0] + y * direction[1] + z * direction[2]
    variance = sigma * sigma + (pixel * along) ** 2
    if along <= 0.0:
        return 0.0, variance, floor
    e2 = max(x * x + y * y + z * z - along * along, 0.0)
    right = weight * np.exp(-0.5 * e2 / variance)
    return right / (right + floor), variance, right + floor


@njit(cache=True)
def log_likelihood(point, origins, directions, weights, pixel, sigma, floor):  # type: ignore[no-untyped-def]
    """Sum over the views that detected the joint: origins and directions (n, 3), weights and pixel (n,)."""
    total = 0.0
    for k in range(len(weights)):
        if weights[k] > 0.0:
            total += np.log(view_terms(point, origins[k], directions[k], weights[k], pixel[k], sigma, floor)[2])
    return total


@njit(cache=True)
def add_ray(A, b, origin, direction, information):  # type: ignore[no-untyped-def]
    """Add ``information * (I - d dᵀ)`` to A (3, 3) and its product with the origin to b (3,)."""
    for r in range(3):
        for c in range(3):
            entry = information * ((1.0 if r == c else 0.0) - direction[r] * direction[c])
            A[r, c] += entry
            b[r] += entry * origin[c]


@njit(cache=True)
def solve(A, b, inverse, point):  # type: ignore[no-untyped-def]
    """Write the inverse of a symmetric A (3, 3) and ``inverse @ b``; False where A is singular in practice.

    Written out: a call into LAPACK costs more than the work, and much more to compile.
    """
    c00 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c01 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c02 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    determinant = A[0, 0] * c00 + A[0, 1] * c01 + A[0, 2] * c02
    scale = (A[0, 0] + A[1, 1] + A[2, 2]) / 3.0
    if not determinant > 1e-12 * scale * scale * scale:
        return False
    inverse[0, 0] = c00 / determinant
    inverse[0, 1] = inverse[1, 0] = c01 / determinant
    inverse[0, 2] = inverse[2, 0] = c02 / determinant
    inverse[1, 1] = (A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]) / determinant
    inverse[1, 2] = inverse[2, 1] = (A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]) / determinant
    inverse[2, 2] = (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]) / determinant
    for r in range(3):
        point[r] = inverse[r, 0] * b[0] + inverse[r, 1] * b[1] + inverse[r, 2] * b[2]
    return True
