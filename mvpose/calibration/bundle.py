"""Normal equations of a bundle adjustment, with the joints eliminated by the Schur complement.

Cameras have ten parameters each, in this order: rotation vector about the optical centre (world axes, rad), shift of
the centre (m), offset of the clock (s), logarithm of the focal length, shift of the principal point (2, pixels).

A residual is the difference between the projected joint and the keypoint in standard deviations. A keypoint is right or
grossly wrong: the likelihood of a residual is ``exp(-r²/2) + floor``. For given cameras, each joint is solved for by
reweighted Gauss-Newton steps; so the cameras are the only state, and the normal equations are those of the problem in
which every joint follows the cameras (variable projection).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats, Integers
from mvpose.calibration.sightings import Sightings
from mvpose.calibration.tracklets import frame_times
from mvpose.camera import Camera, Rig
from mvpose.kernels import njit

PARAMETERS = 10
"""Parameters of a camera."""

ROTATION, TRANSLATION, CLOCK, FOCAL, CENTER = slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 8), slice(8, 10)
"""Places of the parameters of a camera."""

FLOOR = 0.01
"""Likelihood of a wrong keypoint as a fraction of the peak likelihood of a right one (Noise.floor)."""

_NEAREST = 0.2  # metres: joints closer to a camera, or behind it, do not fit
_INNER = 4  # reweighted steps for each joint
_HALF = 0.5  # pixels, for the derivative of the lens


def changed(camera: Camera, parameters: Floats) -> Camera:
    """Return a camera changed by its ten parameters; the same one where all are 0, whatever its clock."""
    if not np.delete(parameters, CLOCK).any():
        return camera
    R = camera.R @ Rotation.from_rotvec(parameters[ROTATION]).as_matrix().T
    K = camera.K.copy()
    K[:2, :2] *= np.exp(parameters[FOCAL])
    K[:2, 2] += parameters[CENTER]
    return replace(camera, K=K, R=R, t=-R @ (camera.center + parameters[TRANSLATION]))


def difference(given: Camera, other: Camera) -> Floats:
    """Return the parameters that change a camera into another one, (10,), with 0 for the clock."""
    result = np.zeros(PARAMETERS)
    result[ROTATION] = Rotation.from_matrix((given.R.T @ other.R).T).as_rotvec()
    result[TRANSLATION] = other.center - given.center
    result[FOCAL] = np.log(other.K[0, 0] / given.K[0, 0])
    result[CENTER] = other.K[:2, 2] - given.K[:2, 2]
    return result


@dataclass(frozen=True)
class Observations:
    """Sightings of points that two or more views see, sorted by point.

    Attributes:
        view: (k,).
        start: first sighting of each point, and k, (p + 1,).
        row: row of each sighting in the sightings from which they were taken, (k,).
        pixels: as detected, (k, 2).
        velocity: pixels/s, (k, 2).
        late: time of the picture after the time of the frame, seconds, (k,).
        scale: pixels of a focal length over the standard deviation, (k,), of the believed rig.
        joint: index in the skeleton, (k,).
        importance: weight of each point, (p,).
    """

    view: Integers
    start: Integers
    row: Integers
    pixels: Floats
    velocity: Floats
    late: Floats
    scale: Floats
    joint: Integers
    importance: Floats

    def __len__(self) -> int:
        """Number of sightings."""
        return len(self.view)

    @property
    def point(self) -> Integers:
        """Point of each sighting, (k,)."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))


def observations(rig: Rig, sightings: Sightings) -> Observations:
    """Return the sightings of points that two or more views see, sorted by point; the rig is the believed one."""
    index, _ = sightings.points
    rows = np.flatnonzero(sightings.shared)
    rows = rows[np.lexsort((sightings.view[rows], index[rows]))]
    _, start = np.unique(index[rows], return_index=True)
    reference = frame_times(sightings.times)
    frame, view = sightings.frame[rows], sightings.view[rows]
    focal = np.array([np.sqrt(camera.K[0, 0] * camera.K[1, 1]) for camera in rig])
    assert sightings.velocity is not None
    return Observations(
        view,
        np.append(start, len(rows)).astype(np.int64),
        rows,
        sightings.pixels[rows],
        sightings.velocity[rows],
        sightings.times[frame, view] - reference[frame],
        focal[view] / sightings.sigma[rows],
        sightings.joint[rows],
        np.ones(len(start)),
    )


def normalised(rig: Rig, offsets: Floats, seen: Observations) -> tuple[Floats, Floats, Floats]:
    """Return the image points of the lines of sight and their derivatives.

    Returns:
        Normalised image points without distortion, (k, 2), at the time of the frame; minus their derivatives by clock,
        focal length and principal point, (k, 2, 4); and the scale of residuals, (k,), 0 where the lens has no ray.
    """
    points, slopes = np.full((len(seen), 2), np.nan), np.zeros((len(seen), 2, 4))
    scale = seen.scale.copy()
    for view, camera in enumerate(rig):
        which = seen.view == view
        inverse = np.linalg.inv(camera.K[:2, :2])
        velocity = seen.velocity[which]
        pixels = seen.pixels[which] - velocity * (seen.late[which] + offsets[view])[:, None]
        points[which] = (camera.undistort(pixels) - camera.K[:2, 2]) @ inverse.T
        by_pixel = np.broadcast_to(inverse, (len(pixels), 2, 2))
        if camera.distortion.any():
            steps = _HALF * np.eye(2)
            ahead, back = (
                np.stack([camera.undistort(pixels + sign * each) for each in steps], axis=-1) for sign in (1.0, -1.0)
            )
            by_pixel = inverse @ (ahead - back) / (2.0 * _HALF)
        slopes[which, :, 0] = np.einsum("kab,kb->ka", by_pixel, velocity)
        slopes[which, :, 1] = np.einsum("kab,kb->ka", by_pixel, pixels - camera.K[:2, 2])
        slopes[which, :, 2:] = by_pixel
    lost = ~(np.isfinite(points).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)))
    points[lost], slopes[lost], scale[lost] = 0.0, 0.0, 0.0
    return points, slopes, scale


@dataclass(frozen=True)
class Reduced:
    """Normal equations of the cameras, and what the joints left.

    Attributes:
        information: (10 V, 10 V).
        gradients: of half the squared residuals, by cluster, (clusters, 10 V).
        cost: minus the logarithm of the likelihood.
        points: joints, (p, 3), metres.
        residuals: in standard deviations, (k, 2).
        weights: probability that each keypoint is right, (k,).
    """

    information: Floats
    gradients: Floats
    cost: float
    points: Floats
    residuals: Floats
    weights: Floats


def reduce(
    rig: Rig, offsets: Floats, seen: Observations, *, clusters: Integers | None = None, points: Floats | None = None
) -> Reduced:
    """Solve for the joints and return the normal equations of the cameras.

    Args:
        rig: cameras.
        offsets: of the clocks, (V,), seconds.
        seen: the sightings.
        clusters: cluster of each sighting, (k,); one for all by default.
        points: where the search for the joints starts; by default they are triangulated.
    """
    clusters = np.zeros(len(seen), np.int64) if clusters is None else clusters
    image, slopes, scale = normalised(rig, offsets, seen)
    R = np.stack([camera.R for camera in rig])
    warm = points is not None
    if points is None:
        points = _triangulated(seen.view, seen.start, image, scale, R, rig.centers)
    return Reduced(
        *_reduce(seen.view, seen.start, image, slopes, scale, R, rig.centers, points.copy(), warm,
                 seen.importance, clusters, int(clusters.max(initial=0)) + 1)
    )  # fmt: skip


@njit(cache=True)
def _triangulated(view, start, image, scale, R, centers):
    """Return the points nearest to the lines of sight, (p, 3)."""
    points = np.zeros((len(start) - 1, 3))
    for p in range(len(points)):
        left, right = 1e-12 * np.eye(3), np.zeros(3)
        for k in range(start[p], start[p + 1]):
            if scale[k] > 0.0:
                v = view[k]
                ray = R[v].T @ np.array([image[k, 0], image[k, 1], 1.0])
                ray /= np.sqrt((ray * ray).sum())
                across = np.eye(3) - np.outer(ray, ray)
                left += across
                right += across @ centers[v]
        points[p] = np.linalg.solve(left, right)
    return points


@njit(cache=True)
def _solve3(a, b):
    """Solve a symmetric 3 x 3 system by its adjugate."""
    c00, c01, c02 = a[1, 1] * a[2, 2] - a[1, 2] ** 2, a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2], 0.0
    c02 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    c11, c12 = a[0, 0] * a[2, 2] - a[0, 2] ** 2, a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2]
    c22 = a[0, 0] * a[1, 1] - a[0, 1] ** 2
    determinant = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    x0 = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / determinant
    x1 = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / determinant
    x2 = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / determinant
    return x0, x1, x2


@njit(cache=True)
def _reduce(view, start, image, slopes, scale, R, centers, points, warm, importance, clusters, count):  # noqa: PLR0915
    """Return the fields of :class:`Reduced`; ``points`` is overwritten."""
    views, size = len(R), PARAMETERS * len(R)
    information, gradients = np.zeros((size, size)), np.zeros((count, size))
    residuals, weights = np.zeros((len(view), 2)), np.zeros(len(view))
    cost = 0.0
    by_point = np.zeros((len(view), 2, 3))
    hessian, right = np.zeros((3, 3)), np.zeros(3)
    by_camera = np.zeros((views, 2, PARAMETERS))
    mixed = np.zeros((views, PARAMETERS, 3))
    solved = np.zeros((views, PARAMETERS, 3))
    y = np.zeros(3)
    for p in range(len(start) - 1):
        low, high = start[p], start[p + 1]
        for turn in range(_INNER + 1):
            hessian[:], right[:] = 0.0, 0.0
            worth = 0.0
            for k in range(low, high):
                v = view[k]
                d0, d1, d2 = points[p, 0] - centers[v, 0], points[p, 1] - centers[v, 1], points[p, 2] - centers[v, 2]
                for r in range(3):
                    y[r] = R[v, r, 0] * d0 + R[v, r, 1] * d1 + R[v, r, 2] * d2
                if not (y[2] > _NEAREST and scale[k] > 0.0):
                    weights[k] = 0.0
                    residuals[k, 0] = residuals[k, 1] = 0.0
                    worth -= np.log(FLOOR)
                    continue
                a, b = y[0] / y[2], y[1] / y[2]
                residuals[k, 0], residuals[k, 1] = scale[k] * (a - image[k, 0]), scale[k] * (b - image[k, 1])
                square = residuals[k, 0] ** 2 + residuals[k, 1] ** 2
                right_one = np.exp(-0.5 * square)
                worth -= np.log(right_one + FLOOR)
                # Wide at first, so that the joint is found although the cameras are off.
                if turn == 0 and not warm:
                    weights[k] = 1.0 / (1.0 + square / 25.0)
                else:
                    weights[k] = right_one / (right_one + FLOOR)
                for c in range(3):
                    by_point[k, 0, c] = scale[k] * (R[v, 0, c] - a * R[v, 2, c]) / y[2]
                    by_point[k, 1, c] = scale[k] * (R[v, 1, c] - b * R[v, 2, c]) / y[2]
                for c in range(3):
                    right[c] -= weights[k] * (by_point[k, 0, c] * residuals[k, 0] + by_point[k, 1, c] * residuals[k, 1])
                    for d in range(3):
                        hessian[c, d] += weights[k] * (
                            by_point[k, 0, c] * by_point[k, 0, d] + by_point[k, 1, c] * by_point[k, 1, d]
                        )
            ridge = 1e-6 * (hessian[0, 0] + hessian[1, 1] + hessian[2, 2]) + 1e-9
            for c in range(3):
                hessian[c, c] += ridge
            if turn < _INNER:
                x0, x1, x2 = _solve3(hessian, right)
                far = np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
                step = min(1.0, 1.0 / max(far, 1e-12))  # at most a metre
                points[p, 0] += step * x0
                points[p, 1] += step * x1
                points[p, 2] += step * x2
            else:
                cost += importance[p] * worth
        for k in range(low, high):
            if weights[k] <= 0.0:
                continue
            v = view[k]
            d0, d1, d2 = points[p, 0] - centers[v, 0], points[p, 1] - centers[v, 1], points[p, 2] - centers[v, 2]
            for r in range(2):
                # The projection moves with the joint relative to the centre: against a shift of the centre, and by
                # d x rotation when the camera turns.
                g0, g1, g2 = by_point[k, r, 0], by_point[k, r, 1], by_point[k, r, 2]
                by_camera[v, r, 0] = g1 * d2 - g2 * d1
                by_camera[v, r, 1] = g2 * d0 - g0 * d2
                by_camera[v, r, 2] = g0 * d1 - g1 * d0
                by_camera[v, r, 3], by_camera[v, r, 4], by_camera[v, r, 5] = -g0, -g1, -g2
                for c in range(4):
                    by_camera[v, r, 6 + c] = scale[k] * slopes[k, r, c]
            for c in range(PARAMETERS):
                for d in range(3):
                    mixed[v, c, d] = weights[k] * (
                        by_camera[v, 0, c] * by_point[k, 0, d] + by_camera[v, 1, c] * by_point[k, 1, d]
                    )
                solved[v, c, 0], solved[v, c, 1], solved[v, c, 2] = _solve3(hessian, mixed[v, c])
        for k in range(low, high):
            if weights[k] <= 0.0:
                continue
            v = view[k]
            for c in range(PARAMETERS):
                value = weights[k] * (by_camera[v, 0, c] * residuals[k, 0] + by_camera[v, 1, c] * residuals[k, 1])
                gradients[clusters[k], PARAMETERS * v + c] += importance[p] * value
                for e in range(PARAMETERS):
                    information[PARAMETERS * v + c, PARAMETERS * v + e] += (
                        importance[p]
                        * weights[k]
                        * (by_camera[v, 0, c] * by_camera[v, 0, e] + by_camera[v, 1, c] * by_camera[v, 1, e])
                    )
            pull = weights[k] * (by_point[k, 0] * residuals[k, 0] + by_point[k, 1] * residuals[k, 1])
            for other in range(low, high):
                if weights[other] <= 0.0:
                    continue
                w = view[other]
                for c in range(PARAMETERS):  # the joint follows, and with it what other views see
                    gradients[clusters[k], PARAMETERS * w + c] -= importance[p] * (
                        solved[w, c, 0] * pull[0] + solved[w, c, 1] * pull[1] + solved[w, c, 2] * pull[2]
                    )
                for c in range(PARAMETERS):
                    for e in range(PARAMETERS):
                        information[PARAMETERS * v + c, PARAMETERS * w + e] -= importance[p] * (
                            solved[v, c, 0] * mixed[w, e, 0]
                            + solved[v, c, 1] * mixed[w, e, 1]
                            + solved[v, c, 2] * mixed[w, e, 2]
                        )
    return information, gradients, cost, points, residuals, weights
