"""The lens: Brown's distortion of normalised image coordinates and its inverse, as OpenCV writes it.

Terms are k1, k2, p1, p2, k3. The kernels take one point, so that every stage can use them inside its own loops.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_MOST_STEPS = 30
_TOLERANCE2 = 1e-24  # of the residual squared, in units of the focal length


@njit(cache=True)
def distort(x, y, terms):  # type: ignore[no-untyped-def]
    """Where the lens images the direction (x, y, 1)."""
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


@njit(cache=True)
def undistort(u, v, terms):  # type: ignore[no-untyped-def]
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
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # of radial, over x or y
        fx = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) - u
        fy = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y - v
        xx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
        yy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
        xy = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y
        determinant = xx * yy - xy * xy
        # Where orientation flips, the lens has folded: the branch through the centre ends there.
        if not (determinant > 1e-9 and xx + yy > 0.0):
            return np.nan, np.nan
        if fx * fx + fy * fy < _TOLERANCE2:
            return x, y
        x -= (yy * fx - xy * fy) / determinant
        y -= (xx * fy - xy * fx) / determinant
    return np.nan, np.nan
