"""Percentage of correct keypoints (PCK) in 3D as a function of the error limit (Mehta et al., 3DV 2017).

Every joint of every true person counts. A joint without an estimate, or of a missed person, is wrong at any limit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats


def pck(errors: ArrayLike, limits: ArrayLike) -> Floats:
    """Return the share of joints within each limit, percent (n,): the PCK curve; NaN where no joint counts.

    Args:
        errors: :func:`simharness.scoring.joint_errors.joint_errors`, any shape. NaN is ignored, infinite is wrong.
        limits: limits of the error, (n,), in the unit of the errors. An error equal to the limit is within it.
    """
    counted = _counted(errors)
    if not len(counted):
        return np.full(np.shape(limits), np.nan)
    within = np.searchsorted(np.sort(counted), np.asarray(limits, float), side="right")
    return 100.0 * within / len(counted)


def pck_area(errors: ArrayLike, limit: float) -> float:
    """Return the area under the PCK curve from 0 to ``limit`` divided by ``limit``: the mean of :func:`pck`, percent.

    It is exact, while benchmarks average PCK at a few limits. NaN where no joint counts.
    """
    counted = _counted(errors)
    return 100.0 * float(np.clip(1.0 - counted / limit, 0.0, 1.0).mean()) if len(counted) else float("nan")


def _counted(errors: ArrayLike) -> Floats:
    errors = np.asarray(errors, float)
    return errors[~np.isnan(errors)]
