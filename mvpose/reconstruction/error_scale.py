"""Error scales of keypoints, estimated from the residuals of one person, and the distribution of the joints' errors.

The error model gives the variance for a typical detector and a perfect calibration. The detector in use may be three
times more accurate, errors on a distant or unusually dressed person may be larger, and calibration and clocks may be
off. So errors are modelled in levels, each estimated from residuals and shrunk towards the level above:

1. The variance of a person's keypoints is that of the error model times a relative scale, plus an absolute variance,
   the same for all joints: detectors err in proportion to the size of the joint, errors of calibration do not
   (:func:`fit_variances`).
2. The scale of a joint is inverse-gamma around that of the person. A keypoint whose view dissents counts with the
   squared error at which it is taken for wrong, because it may be the other views that are wrong.
3. Given its scale a joint is Gaussian, so that over the distribution of scales it is a multivariate t, with as many
   degrees of freedom as the prior and the residuals have together (Gelman et al., Bayesian Data Analysis, section 3.6).

No residual shows an error that all views share. The place that detectors take for a joint is off by 30 to 50 mm for
hips and knees and by 1 to 15 mm for ankles (Needham et al., Scientific Reports 2021), hence :data:`SHARED`.

The freedoms of the priors and the value within the published range were chosen on simulated scenes of other rigs,
detectors and seeds than those of the suite ``ci``.
"""

import numpy as np

from mvpose.kernels import njit
from mvpose.reconstruction.likelihood import ANCHOR

# Errors are weighted by the responsibility of the keypoint, which truncates the tail of even a perfect Gaussian: with
# the floor at a hundredth of the peak, a tenth of the variance is lost (an integral over the two densities).
_OBSERVED_VARIANCE = 0.9
_MODEL_FREEDOM = 3.0  # residuals that the prior scale of the error model counts for, where it decides what is wrong
_LEAST, _MOST = 0.1, 4.0  # range of a person's scale there; detectors do not differ from the model by more

_FIT_FREEDOM = 1.0  # residuals that the error model counts for in the variances of a person
_FIT_SIGMA = 0.05  # metres; standard deviation of the joint that this residual belongs to
_FIT_LEAST, _FIT_MOST = 0.05, 9.0  # range of the relative scale
_FIT_STEPS = 3

PRIOR_FREEDOM = 3.0
"""Degrees of freedom of a joint's error before any residual: the least number of whole degrees with a covariance."""

SHARED = 0.15
"""Standard deviation along each axis of the error that all views share, over that of a keypoint across its ray."""


@njit(cache=True, borrows=True)
def degrees_of_freedom(views):
    """Return the degrees of freedom of a joint's residuals: two per view, minus three for the position."""
    return _OBSERVED_VARIANCE * max(2.0 * views - 3.0, 0.0)


@njit(cache=True, borrows=True)
def person_scale(misfit, responsibilities):
    """Return the ratio of a person's squared keypoint errors to those of the error model.

    The prior is inverse-gamma around 1, so many residuals outweigh it and few do not.

    Args:
        misfit: sum over views of responsibility times squared error over variance, (J,).
        responsibilities: sum over views of the responsibilities, (J,).
    """
    total, freedom = _MODEL_FREEDOM, _MODEL_FREEDOM
    for j in range(len(misfit)):
        if responsibilities[j] > 1.5:
            total += misfit[j]
            freedom += degrees_of_freedom(responsibilities[j])
    return min(max(total / freedom, _LEAST), _MOST)


@njit(cache=True)
def fit_variances(misfit, responsibilities, support, sigmas):
    """Fit the variances of a person's keypoints: ``relative`` times that of the error model plus ``absolute``.

    Weighted least squares with both at least 0. The mean squared residual of a joint over the variance of the model has
    expectation ``relative + absolute / variance`` and a variance of twice its square over the degrees of freedom.

    Args:
        misfit: sum over views of responsibility times squared error over variance, (J,).
        responsibilities: sum over views of the responsibilities, (J,).
        support: sum over views of responsibility times score, (J,).
        sigmas: standard deviation of a keypoint with score 1, (J,), metres.

    Returns:
        ``relative``, and ``absolute`` in square metres.
    """
    relative, absolute = 1.0, 0.0
    freedom, precision, square = np.empty((3, len(misfit) + 1))
    freedom[0], precision[0], square[0] = _FIT_FREEDOM, 1.0 / _FIT_SIGMA**2, 1.0  # the prior
    count = 1
    for j in range(len(misfit)):
        if responsibilities[j] > 1.5:
            freedom[count] = degrees_of_freedom(responsibilities[j])
            precision[count] = (support[j] / (responsibilities[j] * sigmas[j])) ** 2
            square[count] = misfit[j] / freedom[count]
            count += 1
    for step in range(_FIT_STEPS + 1):
        ones, first, second, value, product = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(count):
            expected = relative + absolute * precision[k] if step > 0 else 1.0
            weight = freedom[k] / (expected * expected)
            sharp = weight * precision[k]
            ones += weight
            first += sharp
            second += sharp * precision[k]
            value += weight * square[k]
            product += sharp * square[k]
        relative, absolute = value / ones, 0.0
        determinant = ones * second - first * first
        if step > 0 and determinant > 1e-9 * ones * second:
            slope = (ones * product - first * value) / determinant
            if slope > 0.0:
                relative, absolute = (second * value - first * product) / determinant, slope
        if relative < _FIT_LEAST:
            relative, absolute = _FIT_LEAST, max((product - _FIT_LEAST * first) / second, 0.0)
    return min(relative, _FIT_MOST), absolute


@njit(cache=True, borrows=True)
def observe(point, view, relative, absolute, information):
    """Write the observed information of one joint's keypoints at its estimated position, at the scale of their misfit.

    The observed information is that of the keypoints weighted by their responsibilities, minus what is missing because
    it is not known which of them are right (Louis, Journal of the Royal Statistical Society B 1982). It is never less
    than nothing in any direction and view.

    Args:
        point: the joint, (3,).
        view: origins, directions, weights and angles of a pixel as in :mod:`mvpose.reconstruction.likelihood`, the
            standard deviation of the joint in the error model, and the floor.
        relative: factor on the variances of the error model.
        absolute: variance to add, square metres.
        information: output, (3, 3), 1/m^2, with that of the anchor.

    Returns:
        Degrees of freedom of the joint's error, above 2; and the share of ``absolute`` in the variances.
    """
    origins, directions, weights, pixel, sigma, floor = view
    wrong = -2.0 * np.log(floor)  # squared error over variance at which a keypoint is as likely wrong as right
    misfit, total, alike, views = 0.0, 0.0, 0.0, 0
    a00, a01, a02, a11, a12, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # in registers, as in likelihood.add_ray
    for v in range(weights.shape[0]):
        x, y, z = point[0] - origins[v, 0], point[1] - origins[v, 1], point[2] - origins[v, 2]
        reach2 = x * x + y * y + z * z
        best, mode, precision, along, error2, seen = 0.0, -1, 1.0, 0.0, 0.0, False
        for k in range(weights.shape[1]):
            if weights[v, k] > 0.0:
                seen = True
                ahead = x * directions[v, k, 0] + y * directions[v, k, 1] + z * directions[v, k, 2]
                if ahead > 0.0:
                    breadth, square = pixel[v] * ahead, weights[v, k] * weights[v, k]
                    sharpness = square / (relative * (sigma * sigma + breadth * breadth) + absolute * square)
                    e2 = max(reach2 - ahead * ahead, 0.0)
                    value = weights[v, k] * np.exp(-0.5 * e2 * sharpness)
                    if value > best:
                        best, mode, precision, along, error2 = value, k, sharpness, ahead, e2
        if not seen:
            continue
        views += 1
        if mode < 0:
            misfit += wrong
            continue
        responsibility = best / (best + floor)
        weight = responsibility * precision
        misfit += weight * error2 + (1.0 - responsibility) * wrong
        total, alike = total + weight, alike + weight * absolute * precision
        missing = (1.0 - responsibility) * precision
        missing = weight * missing if missing * error2 < 1.0 else weight / error2
        dx, dy, dz = directions[v, mode, 0], directions[v, mode, 1], directions[v, mode, 2]
        x, y, z = x - along * dx, y - along * dy, z - along * dz
        wx, wy, wz, mx, my, mz = weight * dx, weight * dy, weight * dz, missing * x, missing * y, missing * z
        a00 += weight - wx * dx - mx * x
        a01 -= wx * dy + mx * y
        a02 -= wx * dz + mx * z
        a11 += weight - wy * dy - my * y
        a12 -= wy * dz + my * z
        a22 += weight - wz * dz - mz * z
    factor, freedom, share = 1.0, PRIOR_FREEDOM, 0.0  # a single keypoint has no residual
    if views > 1:
        freedom += degrees_of_freedom(views)
        factor = (freedom - 2.0) / (PRIOR_FREEDOM - 2.0 + misfit)
        share = alike / max(total, 1e-18)
    information[0, 0] = factor * a00 + ANCHOR
    information[1, 1] = factor * a11 + ANCHOR
    information[2, 2] = factor * a22 + ANCHOR
    information[0, 1] = information[1, 0] = factor * a01
    information[0, 2] = information[2, 0] = factor * a02
    information[1, 2] = information[2, 1] = factor * a12
    return freedom, share


@njit(cache=True, borrows=True)
def add_shared(covariance, sigma):
    """Add the variance of the error that all views share to the covariance of a joint (3, 3), in place."""
    for r in range(3):
        covariance[r, r] += (SHARED * sigma) ** 2
