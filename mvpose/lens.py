"""Brown lens distortion of normalised image coordinates and its inverse, in the convention of OpenCV.

The terms are k1, k2, p1, p2, k3. The kernels take one point, so other kernels can call them in their loops.
"""

import numpy as np

from mvpose.kernels import njit

_MOST_STEPS = 30
_TOLERANCE2 = 1e-24  # squared residual, in squared focal lengths
_MOST_DAMPED_STEPS = 250  # reach 79 degrees from the axis
_LONGEST_STEP = 0.02  # focal lengths; shorter than any fold of a real lens
_LEAST_STRIDE = 1.0 / 64.0  # fraction of Newton's step; if a shorter step still makes no progress, the lens ends here


@njit(cache=True, borrows=True)
def distort(x, y, terms):
    """Return the normalised image point of the direction (x, y, 1)."""
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


@njit(cache=True, borrows=True)
def undistort(u, v, terms):
    """Return x, y of the direction (x, y, 1) that the lens images at (u, v); NaN if there is none.

    Newton's method starts at the centre of the image. A polynomial lens folds over beyond some radius; the result is
    NaN for a solution beyond the fold and where no direction is imaged at all.
    """
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    if k1 == 0.0 and k2 == 0.0 and p1 == 0.0 and p2 == 0.0 and k3 == 0.0:
        return u, v
    # The point is far outside any image, where the polynomial would overflow.
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
            # Newton's method may have jumped over a fold. There is no fold between this point and the centre if the
            # slope of the radius stays positive even without the terms that increase it.
            r2 = x * x + y * y
            bend = 3.0 * min(k1, 0.0) + r2 * (5.0 * min(k2, 0.0) + r2 * 7.0 * min(k3, 0.0))
            if 1.0 + r2 * bend > 6.0 * np.sqrt(r2 * (p1 * p1 + p2 * p2)):
                return x, y
            break
        x -= (yy * fx - xy * fy) / determinant
        y -= (xx * fy - xy * fx) / determinant
    return _undistort_damped(u, v, terms)


@njit(cache=True, borrows=True)
def _linearised(x, y, terms):
    """Return :func:`distort` (u, v) and its derivatives du/dx, du/dy = dv/dx, dv/dy."""
    k1, k2, p1, p2, k3 = terms[0], terms[1], terms[2], terms[3], terms[4]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # derivative of radial by x over x, or by y over y
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    )


@njit(cache=True, borrows=True)
def _undistort_damped(u, v, terms):
    """Run Newton's method in short, damped steps that stay on the branch of the lens through the centre."""
    x, y = 0.0, 0.0
    fx, fy, xx, xy, yy = _linearised(x, y, terms)
    for _ in range(_MOST_DAMPED_STEPS):
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
            next_residual2 = (u - fx) * (u - fx) + (v - fy) * (v - fy)
            # The determinant changes sign where the lens folds.
            if xx * yy - xy * xy > 1e-9 and xx + yy > 0.0 and next_residual2 < (1.0 - 0.5 * stride) * residual2:
                break
            stride *= 0.5
            if stride < least:
                return np.nan, np.nan
        x, y = x + stride * dx, y + stride * dy
    return np.nan, np.nan
