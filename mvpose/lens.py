"""The lens: Brown's distortion of normalised image coordinates and its inverse, as OpenCV writes it.

Terms are k1, k2, p1, p2, k3. The kernels take one point, so that every stage can use them inside its own loops.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_MOST_STEPS = 30
_TOLERANCE2 = 1e-24  # of the residual squared, in units of the focal length
_MOST_CAREFUL_STEPS = 250  # as far as 79 degrees from the axis
_LONGEST_STEP = 0.02  # focal lengths; what folds and unfolds within it can pass for straight
_LEAST_STRIDE = 1.0 / 64.0  # of Newton's step; where less of it still leads nowhere, the lens ends


@njit(cache=True)
def distort(x, y, terms):
    """Where the lens images the direction (x, y, 1)."""
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


@njit(cache=True)
def undistort(u, v, terms):
    """The direction (x, y, 1) that the lens images at (u, v); NaN where none is.

    Newton's method from the centre of the image outwards. A polynomial lens folds over beyond some radius: what
    lies there, or where no direction is imaged at all, is no point of the real lens and gives NaN.
    """
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    if k1 == 0.0 and k2 == 0.0 and p1 == 0.0 and p2 == 0.0 and k3 == 0.0:
        return u, v
    # A ray far outside any image: the polynomial would overflow before it said so.
    if not u * u + v * v < 100.0:
        return np.nan, np.nan
    x, y = 0.0, 0.0
    for _ in range(_MOST_STEPS):
        fx, fy, xx, xy, yy = _linearised(x, y, terms)
        fx, fy = fx - u, fy - v
        determinant = xx * yy - xy * xy
        if not (determinant > 1e-9 and xx + yy > 0.0):
            break
        if fx * fx + fy * fy < _TOLERANCE2:
            # Newton may have leapt over a fold to a branch beyond. Between here and the centre there is none if the
            # slope of the radius stays positive even without the terms that raise it.
            r2 = x * x + y * y
            bend = 3.0 * min(k1, 0.0) + r2 * (5.0 * min(k2, 0.0) + r2 * 7.0 * min(k3, 0.0))
            if 1.0 + r2 * bend > 6.0 * np.sqrt(r2 * (p1 * p1 + p2 * p2)):
                return x, y
            break
        x -= (yy * fx - xy * fy) / determinant
        y -= (xx * fy - xy * fx) / determinant
    return _undistort_carefully(u, v, terms)


@njit(cache=True)
def _linearised(x, y, terms):
    """:func:`distort` and its derivatives: of the first by x, of either by the other, of the second by y."""
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # of radial, over x or y
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    )


@njit(cache=True)
def _undistort_carefully(u, v, terms):
    """Newton's method in short, damped steps that never leave the branch of the lens through the centre."""
    x, y = 0.0, 0.0
    fx, fy, xx, xy, yy = _linearised(x, y, terms)
    for _ in range(_MOST_CAREFUL_STEPS):
        dx, dy = u - fx, v - fy
        residual2 = dx * dx + dy * dy
        if residual2 < _TOLERANCE2:
            return x, y
        determinant = xx * yy - xy * xy
        dx, dy = (yy * dx - xy * dy) / determinant, (xx * dy - xy * dx) / determinant
        stride = min(1.0, _LONGEST_STEP / np.sqrt(dx * dx + dy * dy))
        least = stride * _LEAST_STRIDE
        while True:
            fx, fy, xx, xy, yy = _linearised(x + stride * dx, y + stride * dy, terms)
            away2 = (u - fx) * (u - fx) + (v - fy) * (v - fy)
            # Orientation flips where the lens folds.
            if xx * yy - xy * xy > 1e-9 and xx + yy > 0.0 and away2 < (1.0 - 0.5 * stride) * residual2:
                break
            stride *= 0.5
            if stride < least:
                return np.nan, np.nan
        x, y = x + stride * dx, y + stride * dy
    return np.nan, np.nan
