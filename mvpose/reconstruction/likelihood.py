"""Likelihood of a joint position given the keypoints of all views (paper, section 3.3).

The likelihood of a view that detected the joint is ``p(I_v | X) = floor + score * exp(-score^2 e^2 / (2 sigma^2))``,
where e is the distance in metres from X to the viewing ray. A keypoint of half the score has twice the standard
deviation, as in a score-weighted DLT. The floor models a keypoint that is wrong; without it one wrong view would rule
out the true position. sigma is the standard deviation of a confident detection on the body, in metres, so it is the
same for every rig; the size of a pixel at the joint is added in quadrature, because it limits accuracy at a distance.
Where a view has several keypoints for one joint (the modes of a heat map), the best of them counts (a max-mixture:
Olson & Agarwal, IJRR 2013).

The kernels work on one joint of one person in n views with K modes each: origins (n, 3), directions (n, K, 3),
weights (n, K), 0 where a view has no such mode, and the angle of a pixel (n,). The responsibility of a keypoint is
the posterior probability that it is right, given the joint at the point.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from mvpose.arrays import Floats
from mvpose.checks import check_numbers, seal
from mvpose.kernels import njit
from mvpose.skeleton import Skeleton

_FASTMATH = {"contract", "arcp", "nsz"}  # NaN and infinity keep their meaning


@dataclass(frozen=True)
class Noise:
    """Error model of a keypoint.

    Raises:
        ValueError: ``floor`` not above 0, a negative ``area``, ``definition`` or ``pixels``, or ``area`` and
            ``definition`` both 0.
    """

    area: float = 0.70
    """Square root of the person's area as OKS uses it, in metres: an adult fills 53 % of a box of 1.7 m x 0.55 m
    (fraction from Ronchi & Perona 2017)."""
    definition: float = 0.02
    """Standard deviation between views of the point that a detector takes for the joint, metres."""
    pixels: float = 1.0
    """Least standard deviation of any detector, pixels."""
    floor: float = 0.01
    """Likelihood of a wrong keypoint at any place, as a fraction of the peak likelihood of a right one. One keypoint in
    ten is grossly wrong (rates of PoseFix) and lies anywhere in a square metre; the others lie within 0.05 m."""

    def __post_init__(self) -> None:
        check_numbers(self, "the noise model", positive=("floor",), not_negative=("area", "definition", "pixels"))
        if not self.area + self.definition:
            raise ValueError(
                "the noise model needs an area or a definition above 0, got 0 for both: no detector is exact"
            )

    def sigmas(self, skeleton: Skeleton) -> Floats:
        """Return the standard deviation across the ray of every joint at score 1, (J,), metres."""
        return _sigmas(self.area, self.definition, skeleton)


@cache
def _sigmas(area: float, definition: float, skeleton: Skeleton) -> Floats:
    sigmas = np.hypot(area * np.array(skeleton.sigmas), definition)
    seal(sigmas)
    return sigmas


@njit(cache=True, borrows=True, fastmath=_FASTMATH)
def log_likelihood(point, origins, directions, weights, pixel, sigma, floor):
    """Sum the log-likelihood over the views that detected the joint; a point behind a camera has the floor there."""
    total, product = 0.0, 1.0
    for v in range(weights.shape[0]):
        x, y, z = point[0] - origins[v, 0], point[1] - origins[v, 1], point[2] - origins[v, 2]
        best, seen = 0.0, False
        for k in range(weights.shape[1]):
            if weights[v, k] > 0.0:
                seen = True
                along = x * directions[v, k, 0] + y * directions[v, k, 1] + z * directions[v, k, 2]
                if along > 0.0:
                    breadth = pixel[v] * along
                    precision = weights[v, k] ** 2 / (sigma * sigma + breadth * breadth)
                    e2 = x * x + y * y + z * z - along * along
                    best = max(best, weights[v, k] * np.exp(-0.5 * e2 * precision))
        if seen:
            product *= floor + best  # one logarithm for several views, which is faster
            if product < 1e-200:
                total += np.log(product)
                product = 1.0
    return total + np.log(product)


NO_RAYS = (0.0,) * 9
"""Empty sums for :func:`add_ray`."""


@njit(cache=True, borrows=True, fastmath=_FASTMATH)
def add_ray(sums, weight, direction, origin):
    """Add ``weight * (I - d dᵀ)`` and its product with the origin to normal equations held in nine numbers.

    The numbers are the upper triangle by rows, then the right-hand side. They stay in registers; matrices would go
    through memory.
    """
    a00, a01, a02, a11, a12, a22, b0, b1, b2 = sums
    dx, dy, dz = direction[0], direction[1], direction[2]
    ox, oy, oz = origin[0], origin[1], origin[2]
    wx, wy, wz, ahead = weight * dx, weight * dy, weight * dz, dx * ox + dy * oy + dz * oz
    return (
        a00 + weight - wx * dx,
        a01 - wx * dy,
        a02 - wx * dz,
        a11 + weight - wy * dy,
        a12 - wy * dz,
        a22 + weight - wz * dz,
        b0 + weight * ox - wx * ahead,
        b1 + weight * oy - wy * ahead,
        b2 + weight * oz - wz * ahead,
    )


@njit(cache=True, borrows=True)
def add_sums(sums, A, b):
    """Add the sums of :func:`add_ray` to A (3, 3) and b (3,)."""
    k = 0
    for r in range(3):
        b[r] += sums[6 + r]
        for c in range(r, 3):
            A[r, c] += sums[k]
            if c > r:
                A[c, r] += sums[k]
            k += 1


@njit(cache=True, borrows=True, fastmath=_FASTMATH)
def accumulate(point, origins, directions, weights, pixel, sigma, floor, temper, A, b):
    """Add the rays of all views to the normal equations A (3, 3) and b (3,) of the step from the point to the joint.

    Steps instead of positions keep rounding errors small where the rays hardly determine the joint.

    Every keypoint is weighted by its responsibility over its variance. ``temper`` scales the variances in the
    responsibilities only: above 1, distant keypoints keep some weight.

    Returns:
        Support, the sum of score times responsibility; the sum of responsibilities; and the misfit, the sum of
        responsibility times squared error over variance.
    """
    sums = NO_RAYS
    support, responsibilities, misfit, cold = 0.0, 0.0, 0.0, -0.5 / temper
    for v in range(weights.shape[0]):
        x, y, z = point[0] - origins[v, 0], point[1] - origins[v, 1], point[2] - origins[v, 2]
        best, mode, precision, error = 0.0, -1, 1.0, 0.0
        for k in range(weights.shape[1]):
            if weights[v, k] > 0.0:
                along = x * directions[v, k, 0] + y * directions[v, k, 1] + z * directions[v, k, 2]
                if along > 0.0:
                    breadth = pixel[v] * along
                    sharpness = weights[v, k] ** 2 / (sigma * sigma + breadth * breadth)
                    e2 = max(x * x + y * y + z * z - along * along, 0.0)
                    value = weights[v, k] * np.exp(cold * e2 * sharpness)
                    if value > best:
                        best, mode, precision, error = value, k, sharpness, e2
        if mode < 0:
            continue
        responsibility = best / (best + floor)
        weight = responsibility * precision
        support += weights[v, mode] * responsibility
        responsibilities += responsibility
        misfit += weight * error
        sums = add_ray(sums, weight, directions[v, mode], (-x, -y, -z))
    add_sums(sums, A, b)
    return support, responsibilities, misfit


@njit(cache=True, borrows=True, fastmath=_FASTMATH)
def evaluate_strongest_modes(point, origins, directions, weights, pixel, sigma, floor):
    """Return the sums of :func:`accumulate` for the strongest modes only, and the greatest squared error, m^2."""
    support, responsibilities, misfit, worst = 0.0, 0.0, 0.0, 0.0
    for v in range(weights.shape[0]):
        weight = weights[v, 0]
        x, y, z = point[0] - origins[v, 0], point[1] - origins[v, 1], point[2] - origins[v, 2]
        along = x * directions[v, 0, 0] + y * directions[v, 0, 1] + z * directions[v, 0, 2]
        e2 = max(x * x + y * y + z * z - along * along, 0.0)
        if weight > 0.0:
            worst = max(worst, e2)
            if along > 0.0:
                breadth = pixel[v] * along
                sharpness = weight * weight / (sigma * sigma + breadth * breadth)
                value = weight * np.exp(-0.5 * e2 * sharpness)
                responsibility = value / (value + floor)
                support += weight * responsibility
                responsibilities += responsibility
                misfit += responsibility * e2 * sharpness
    return support, responsibilities, misfit, worst


ANCHOR = 1.0
"""Information, 1/m^2, that keeps a joint at its current position; it matters only where no view agrees."""


@njit(cache=True, borrows=True)
def anchor(A, b):
    """Start normal equations of a step with weak information that the step is zero."""
    for r in range(3):
        for c in range(3):
            A[r, c] = 0.0
        A[r, r] = ANCHOR
        b[r] = 0.0


@njit(cache=True, borrows=True)
def solve(A, b, inverse, point):
    """Write the inverse of a symmetric A (3, 3) and ``inverse @ b``; return False if A is numerically singular.

    Written out because a call of LAPACK costs more time than the arithmetic, and much more to compile.
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
