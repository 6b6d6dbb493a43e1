"""Kernels of bundle adjustment: joints by robust triangulation, and their elimination from the normal equations.

Cameras are rows of 23 numbers: the 22 of :attr:`mvpose.Rig.packed` and the offset of the clock in seconds. Parameters
are described in :mod:`mvpose.calibration.normal_equations`.
"""

from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit

PARAMETERS = 11
"""Parameters of a camera: rotation 0 to 2, centre 3 to 5, focal length 6, principal point 7 and 8, k1 9, clock 10."""

_STEPS = 8  # of the reweighted triangulation
_MOST_VIEWS = 64


@njit(cache=True, borrows=True)
def _project(camera, X, pixel):
    """Write the pixel of a point (3,) and return its depth; nothing is written behind the camera."""
    dx, dy, dz = X[0] - camera[14], X[1] - camera[15], X[2] - camera[16]
    x = camera[5] * dx + camera[6] * dy + camera[7] * dz
    y = camera[8] * dx + camera[9] * dy + camera[10] * dz
    z = camera[11] * dx + camera[12] * dy + camera[13] * dz
    if z < 0.05:
        return z
    x, y = x / z, y / z
    k1, k2, p1, p2, k3 = camera[17], camera[18], camera[19], camera[20], camera[21]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    pixel[0] = camera[0] * u + camera[1] * v + camera[2]
    pixel[1] = camera[3] * v + camera[4]
    return z


@njit(cache=True, borrows=True)
def _derivatives(camera, X, by_point, by_camera):
    """Write the derivatives of the pixel by the point (2, 3) and by the parameters of the camera (2, 10)."""
    dx, dy, dz = X[0] - camera[14], X[1] - camera[15], X[2] - camera[16]
    x = camera[5] * dx + camera[6] * dy + camera[7] * dz
    y = camera[8] * dx + camera[9] * dy + camera[10] * dz
    z = camera[11] * dx + camera[12] * dy + camera[13] * dz
    a, b = x / z, y / z
    k1, k2, p1, p2, k3 = camera[17], camera[18], camera[19], camera[20], camera[21]
    r2 = a * a + b * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    uu = radial + a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a
    uv = a * b * slope + 2.0 * p1 * a + 2.0 * p2 * b
    vv = radial + b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a
    fx, skew, fy = camera[0], camera[1], camera[3]
    # By a and b, then by the point in the camera.
    ja0, ja1 = fx * uu + skew * uv, fx * uv + skew * vv
    jb0, jb1 = fy * uv, fy * vv
    for row in range(2):
        da, db = (ja0, ja1) if row == 0 else (jb0, jb1)
        cx, cy, cz = da / z, db / z, -(da * a + db * b) / z
        for c in range(3):
            by_point[row, c] = cx * camera[5 + c] + cy * camera[8 + c] + cz * camera[11 + c]
            by_camera[row, 3 + c] = -by_point[row, c]
        # d(exp(w) p) = w x p
        by_camera[row, 0] = -cy * z + cz * y
        by_camera[row, 1] = cx * z - cz * x
        by_camera[row, 2] = -cx * y + cy * x
        by_camera[row, 7], by_camera[row, 8] = 1.0 - row, 1.0 * row
    u = a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a)
    v = b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b
    by_camera[0, 6], by_camera[1, 6] = fx * u + skew * v, fy * v
    by_camera[0, 9], by_camera[1, 9] = (fx * a + skew * b) * r2, fy * b * r2


@njit(cache=True, borrows=True)
def _solve3(A, b, x):
    """Solve a symmetric positive definite system (3, 3); return whether it is one."""
    a, d, f = A[0, 0], A[1, 1], A[2, 2]
    c, e, h = A[0, 1], A[0, 2], A[1, 2]
    c00, c01, c02 = d * f - h * h, e * h - c * f, c * h - d * e
    det = a * c00 + c * c01 + e * c02
    if not det > 1e-12 * (a * d * f + 1e-300):
        return False
    c11, c12, c22 = a * f - e * e, c * e - a * h, a * d - c * c
    x[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / det
    x[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / det
    x[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det
    return True


@njit(cache=True)
def triangulate(all_cameras, start, block, view, pixels, velocity, sigma, scale, nu, first):
    """Solve for the joints by reweighted Gauss-Newton steps.

    Args:
        all_cameras: cameras in each block of time, (B, V, 23).
        start: first sighting of each of G joints, and k at the end, (G + 1,).
        block: block of time of each joint, (G,).
        view: view of each sighting, (k,).
        pixels: keypoints as detected, (k, 2).
        velocity: velocities of keypoints, pixels/s, (k, 2).
        sigma: standard deviations of keypoints, pixels, (k,).
        scale: standard deviation of keypoints relative to ``sigma``.
        nu: degrees of freedom of the Student distribution of keypoints.
        first: places from which the search starts, (G, 3), metres; NaN: the point nearest to the lines of sight.

    Returns:
        Joints (G, 3), NaN where there is none; residuals (k, 2), pixels; weights (k,); and for each joint the sum of
        squared residuals and its degrees of freedom, (G,).
    """
    count = len(start) - 1
    joints, residuals = np.full((count, 3), np.nan), np.full((len(view), 2), np.nan)
    weights, squared, freedom = np.zeros(len(view)), np.zeros(count), np.zeros(count)
    A, b, step, X, pixel = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), np.empty(2)
    taken = np.empty(pixels.shape)
    by_point, by_camera = np.empty((2, 3)), np.empty((2, PARAMETERS))
    for g in range(count):
        low, high, cameras = start[g], start[g + 1], all_cameras[block[g]]
        for k in range(low, high):
            clock = cameras[view[k], 22]
            taken[k, 0], taken[k, 1] = pixels[k, 0] - clock * velocity[k, 0], pixels[k, 1] - clock * velocity[k, 1]
        known = not np.isnan(first[g, 0])
        X[:] = first[g]
        if high - low < 2 or not (known or _linear(cameras, view[low:high], taken[low:high], sigma[low:high], A, b, X)):
            continue
        good = True
        for step_number in range(_STEPS):
            A[:], b[:] = 0.0, 0.0
            # Without a start, wrong keypoints lose their weight gradually.
            tempered = nu if known else nu * max(1.0, 16.0 / 4.0**step_number)
            for k in range(low, high):
                if not _project(cameras[view[k]], X, pixel) > 0.05:
                    weights[k] = 0.0
                    continue
                rx, ry = pixel[0] - taken[k, 0], pixel[1] - taken[k, 1]
                variance = (scale * sigma[k]) ** 2
                weights[k] = (tempered + 2.0) / (tempered + (rx * rx + ry * ry) / variance)
                residuals[k, 0], residuals[k, 1] = rx, ry
                _derivatives(cameras[view[k]], X, by_point, by_camera)
                w = weights[k] / variance
                for r in range(3):
                    b[r] -= w * (by_point[0, r] * rx + by_point[1, r] * ry)
                    for c in range(3):
                        A[r, c] += w * (by_point[0, r] * by_point[0, c] + by_point[1, r] * by_point[1, c])
            for r in range(3):
                A[r, r] += 1e-9 * (A[0, 0] + A[1, 1] + A[2, 2])
            good = _solve3(A, b, step)
            length = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
            if not good or not length < 5.0:
                good = False
                break
            X += step
            if length < 1e-4 and (known or step_number > 2):
                break
        seen = 0
        for k in range(low, high):
            if good and _project(cameras[view[k]], X, pixel) > 0.05:
                rx, ry = pixel[0] - taken[k, 0], pixel[1] - taken[k, 1]
                residuals[k, 0], residuals[k, 1] = rx, ry
                weights[k] = (nu + 2.0) / (nu + (rx * rx + ry * ry) / (scale * sigma[k]) ** 2)
                squared[g] += (rx * rx + ry * ry) / sigma[k] ** 2
                seen += 1
            else:
                weights[k] = 0.0
                residuals[k] = np.nan
        if good and seen > 1:
            joints[g] = X
            freedom[g] = 2.0 * seen - 3.0
    return joints, residuals, weights, squared, freedom


@njit(cache=True)
def _linear(cameras, view, pixels, sigma, A, b, X):
    """Write the point nearest to the viewing rays, weighted by their angular errors at unit depth."""
    A[:], b[:] = 0.0, 0.0
    d, point = np.empty(3), np.empty(2)
    for k in range(len(view)):
        camera = cameras[view[k]]
        v = (pixels[k, 1] - camera[4]) / camera[3]
        u = (pixels[k, 0] - camera[2] - camera[1] * v) / camera[0]
        point[0], point[1] = _unbent(u, v, camera)
        if np.isnan(point[0]):
            continue
        norm = np.sqrt(point[0] ** 2 + point[1] ** 2 + 1.0)
        for r in range(3):
            d[r] = (camera[5 + r] * point[0] + camera[8 + r] * point[1] + camera[11 + r]) / norm
        weight = (camera[0] / sigma[k]) ** 2
        for r in range(3):
            for c in range(3):
                entry = weight * ((1.0 if r == c else 0.0) - d[r] * d[c])
                A[r, c] += entry
                b[r] += entry * camera[14 + c]
    return _solve3(A, b, X)


@njit(cache=True, borrows=True)
def _unbent(u, v, camera):
    """Return undistorted coordinates by fixed-point iteration: a start for the triangulation needs no more."""
    x, y = u, v
    k1, k2, p1, p2, k3 = camera[17], camera[18], camera[19], camera[20], camera[21]
    if k1 == 0.0 and k2 == 0.0 and p1 == 0.0 and p2 == 0.0 and k3 == 0.0:
        return x, y
    for _ in range(10):
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        if not radial > 0.2:
            return np.nan, np.nan
        x, y = (
            (u - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial,
            (v - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial,
        )
    return x, y


class SightingArrays(NamedTuple):
    """Sightings of G joints by k keypoints, as kernels take them."""

    start: Integers
    """First sighting of each joint, and k, (G + 1,)."""
    block: Integers
    """Block of time of each joint, (G,)."""
    view: Integers
    """View of each sighting, (k,)."""
    velocity: Floats
    """Velocities of keypoints, pixels/s, (k, 2)."""
    sigma: Floats
    """Standard deviations of keypoints, pixels, (k,)."""


class TriangulatedJoints(NamedTuple):
    """Result of :func:`triangulate`."""

    joints: Floats
    """Places, (G, 3), metres; NaN for a joint that could not be placed."""
    residuals: Floats
    """Of the keypoints, (k, 2), pixels."""
    weights: Floats
    """Of the keypoints, (k,)."""


@njit(cache=True)
def accumulate(H, g, all_cameras, sightings, cluster, importance, found, scale):
    """Add the equations of each joint, without the joint: to the curvature of its block, and gradient of its cluster.

    Args:
        H: curvature of each block, (B, 11 V, 11 V), changed.
        g: gradient of each cluster, (clusters, 11 V), changed.
        all_cameras: cameras in each block of time, (B, V, 23).
        sightings: :class:`SightingArrays` of G joints.
        cluster: cluster of each joint, (G,).
        importance: weight of the evidence of each joint, (G,).
        found: :class:`TriangulatedJoints`.
        scale: standard deviation of keypoints relative to ``sigma``.
    """
    start, block, view, velocity, sigma = sightings
    joints, residuals, weights = found
    n = PARAMETERS
    by_point, by_camera = np.empty((_MOST_VIEWS, 2, 3)), np.zeros((_MOST_VIEWS, 2, n))
    cross, lines = np.empty((_MOST_VIEWS, n, 3)), np.empty((_MOST_VIEWS, n, 3))
    A, b, column, unit, inverse = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    rows = np.empty(_MOST_VIEWS, np.int64)
    for joint in range(len(start) - 1):
        if np.isnan(joints[joint, 0]):
            continue
        into, cameras, count = block[joint], all_cameras[block[joint]], 0
        of_cluster, share = g[cluster[joint]], importance[joint]
        A[:], b[:] = 0.0, 0.0
        for k in range(start[joint], start[joint + 1]):
            if not weights[k] > 0.0 or count == _MOST_VIEWS:
                continue
            points, own = by_point[count], by_camera[count]
            _derivatives(cameras[view[k]], joints[joint], points, own)
            own[0, 10], own[1, 10] = velocity[k, 0], velocity[k, 1]
            rows[count] = k
            count += 1
            w = share * weights[k] / (scale * sigma[k]) ** 2
            for r in range(3):
                b[r] += w * (points[0, r] * residuals[k, 0] + points[1, r] * residuals[k, 1])
                for c in range(3):
                    A[r, c] += w * (points[0, r] * points[0, c] + points[1, r] * points[1, c])
        good = count > 1
        for c in range(3):
            unit[:] = 0.0
            unit[c] = 1.0
            good = good and _solve3(A, unit, column)
            for r in range(3):
                inverse[r, c] = column[r]
        if not good:
            continue
        for m in range(count):
            k, points, own = rows[m], by_point[m], by_camera[m]
            w, row = share * weights[k] / (scale * sigma[k]) ** 2, view[k] * n
            for p in range(n):
                of_cluster[row + p] += w * (own[0, p] * residuals[k, 0] + own[1, p] * residuals[k, 1])
                for q in range(n):
                    H[into, row + p, row + q] += w * (own[0, p] * own[0, q] + own[1, p] * own[1, q])
                for c in range(3):
                    cross[m, p, c] = w * (own[0, p] * points[0, c] + own[1, p] * points[1, c])
                for c in range(3):
                    lines[m, p, c] = 0.0
                    for r in range(3):
                        lines[m, p, c] += cross[m, p, r] * inverse[r, c]
                    of_cluster[row + p] -= lines[m, p, c] * b[c]
        for m in range(count):
            for other in range(count):
                row, col = view[rows[m]] * n, view[rows[other]] * n
                for p in range(n):
                    for q in range(n):
                        value = 0.0
                        for c in range(3):
                            value += lines[m, p, c] * cross[other, q, c]
                        H[into, row + p, col + q] -= value
