"""Errors of estimated joints: distance, bone length, jitter, and the percentage of correct keypoints (PCK).

Jitter: with the error e(t) = estimate - truth of a joint, its jitter at t is ``|e(t - 1) - 2 e(t) + e(t + 1)|``. The
motion of people, a constant offset and a uniform drift of the estimate cause no jitter. Independent noise of standard
deviation s along each axis makes each component s sqrt(6), and the mean norm s sqrt(6) x sqrt(8 / pi), about 3.9 s.

PCK in 3D is a function of the error limit (Mehta et al., 3DV 2017). Every joint of every true person counts. A joint
without an estimate, or of a missed person, is wrong at any limit.
"""

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17, Skeleton
from mvpose.arrays import Floats
from simharness.scoring.score_registry import ScoreInfo, ScoreInput, finite_mean, score


def joint_errors(truth: ArrayLike, estimate: ArrayLike) -> Floats:
    """Return the distances between true and estimated joints, both (..., J, 3) and NaN where missing.

    Returns:
        Distances, (..., J): infinite where the estimate is missing, NaN where the truth is.
    """
    truth, estimate = np.asarray(truth, float), np.asarray(estimate, float)
    error = np.linalg.norm(estimate - truth, axis=-1)
    missing = np.isnan(error) & np.isfinite(truth).all(axis=-1)
    return np.where(missing, np.inf, error)


def bone_errors(truth: ArrayLike, estimate: ArrayLike, *, skeleton: Skeleton = COCO17) -> Floats:
    """Return the estimated length minus the true length of every bone of the skeleton's tree.

    Args:
        truth: joints, (..., J, 3).
        estimate: joints, (..., J, 3), in the same unit.
        skeleton: skeleton of the J joints.

    Returns:
        Differences, (..., J - 1), in the order of ``skeleton.edges``; NaN where an end is missing in either.
    """
    return _bone_lengths(np.asarray(estimate, float), skeleton) - _bone_lengths(np.asarray(truth, float), skeleton)


def jitter(truth: ArrayLike, estimate: ArrayLike) -> Floats:
    """Return the jitter of joints over evenly spaced frames.

    Args:
        truth: positions, (T, ..., 3).
        estimate: positions, (T, ..., 3), in the same unit; NaN where missing.

    Returns:
        Jitter, (T - 2, ...), empty for fewer than three frames; NaN where one of the three positions is missing.
    """
    error = np.asarray(estimate, float) - np.asarray(truth, float)
    return np.linalg.norm(np.diff(error, n=2, axis=0), axis=-1)


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


@score(
    ScoreInfo("bone_mm", "Bone length", "mm", "mean absolute error of the bone lengths of the people found", "lower", 1)
)
def bone_length_score(given: ScoreInput) -> float | None:
    """Return the mean absolute error of the bone lengths, mm."""
    return finite_mean(1000.0 * np.abs(bone_errors(given.truth, given.paired)))


_JITTER = "mean second difference of the joint error over frames; grows with the time between frames"


@score(ScoreInfo("jitter_mm", "Jitter", "mm", _JITTER, "lower", 1))
def jitter_score(given: ScoreInput) -> float | None:
    """Return the mean jitter, mm."""
    return finite_mean(1000.0 * jitter(given.truth, given.paired))


def _bone_lengths(joints: Floats, skeleton: Skeleton) -> Floats:
    parents, children = np.array(skeleton.edges).T
    return np.linalg.norm(joints[..., children, :] - joints[..., parents, :], axis=-1)


def _counted(errors: ArrayLike) -> Floats:
    errors = np.asarray(errors, float)
    return errors[~np.isnan(errors)]
