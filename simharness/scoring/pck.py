"""Percentage of correct keypoints (PCK) in 3D, over limits of the error (Mehta et al., 3DV 2017).

Every joint of every true person counts. One that was not placed, or whose person was missed, is wrong at any limit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats


def joint_errors(truth: ArrayLike, estimate: ArrayLike) -> Floats:
    """Distances of true joints from estimated ones, both (..., J, 3) and NaN where missing.

    Returns:
        (..., J): infinite where the estimate is missing, NaN where the truth is.
    """
    truth, estimate = np.asarray(truth, float), np.asarray(estimate, float)
    error = np.linalg.norm(estimate - truth, axis=-1)
    missing = np.isnan(error) & np.isfinite(truth).all(axis=-1)
    return np.where(missing, np.inf, error)


def pck(errors: ArrayLike, limits: ArrayLike) -> Floats:
    """The share of joints that are within each limit: the curve.

    Args:
        errors: :func:`joint_errors`, any shape. NaN is left out, infinite is wrong.
        limits: (n,), in the unit of the errors. An error at the limit is within it.

    Returns:
        Percent, (n,); NaN where no joint counts.
    """
    counted = _counted(errors)
    if not len(counted):
        return np.full(np.shape(limits), np.nan)
    within = np.searchsorted(np.sort(counted), np.asarray(limits, float), side="right")
    return 100.0 * within / len(counted)


def pck_area(errors: ArrayLike, limit: float) -> float:
    """The area under the curve from 0 to ``limit``, as a share of its width: the mean of :func:`pck`, percent.

    It is exact, where benchmarks take the mean at a few limits. NaN where no joint counts.
    """
    counted = _counted(errors)
    return 100.0 * float(np.clip(1.0 - counted / limit, 0.0, 1.0).mean()) if len(counted) else float("nan")


def _counted(errors: ArrayLike) -> Floats:
    errors = np.asarray(errors, float)
    return errors[~np.isnan(errors)]
