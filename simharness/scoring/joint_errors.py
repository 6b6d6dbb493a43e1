"""Errors of estimated joints: distance, bone length, jitter, and the percentage of correct keypoints (PCK).

Jitter: with the error e(t) = estimate - truth of a joint, its jitter at t is ``|e(t - 1) - 2 e(t) + e(t + 1)|``. The
motion of people, a constant offset and a uniform drift of the estimate cause no jitter. Independent noise of standard
deviation s along each axis makes each component s sqrt(6), and the mean norm s sqrt(6) x sqrt(8 / pi), about 3.9 s.

PCK in 3D is a function of the error limit (Mehta et al., 3DV 2017). Every joint of every true person counts. A joint
without an estimate, or of a missed person, is wrong at any limit.

How well the reported confidence says the errors is scored by the coverage of ellipsoids and the Brier score.
"""

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.skeleton import COCO17
from simharness.scoring.score_registry import ScoreInput, finite_mean, score, shipped_scores


def joint_errors(truth: ArrayLike, estimate: ArrayLike) -> Floats:
    """Return the distances between true and estimated joints, both (..., J, 3) and NaN where missing.

    Returns:
        Distances, (..., J): infinite where the estimate is missing, NaN where the truth is.
    """
    truth, estimate = np.asarray(truth, float), np.asarray(estimate, float)
    error = np.linalg.norm(estimate - truth, axis=-1)
    missing = np.isnan(error) & np.isfinite(truth).all(axis=-1)
    return np.where(missing, np.inf, error)


def bone_errors(truth: ArrayLike, estimate: ArrayLike) -> Floats:
    """Return the estimated length minus the true length of every bone of COCO-17's tree.

    Args:
        truth: joints, (..., J, 3).
        estimate: joints, (..., J, 3), in the same unit.

    Returns:
        Differences, (..., J - 1), in the order of the edges of the skeleton; NaN where an end is missing in either.
    """
    return _bone_lengths(np.asarray(estimate, float)) - _bone_lengths(np.asarray(truth, float))


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


@score(shipped_scores()["bone_mm"])
def bone_length_score(given: ScoreInput) -> float | None:
    """Return the mean absolute error of the bone lengths, mm."""
    return finite_mean(1000.0 * np.abs(bone_errors(given.truth, given.paired)))


@score(shipped_scores()["jitter_mm"])
def jitter_score(given: ScoreInput) -> float | None:
    """Return the mean jitter, mm."""
    return finite_mean(1000.0 * jitter(given.truth, given.paired))


def _bone_lengths(joints: Floats) -> Floats:
    parents, children = np.array(COCO17.edges).T
    return np.linalg.norm(joints[..., children, :] - joints[..., parents, :], axis=-1)


def _counted(errors: ArrayLike) -> Floats:
    errors = np.asarray(errors, float)
    return errors[~np.isnan(errors)]


SHARE = 0.9
"""Share of joints that the ellipsoids of ``coverage_90`` should hold."""

RIGHT = 0.1
"""Greatest error of a joint that is right, metres."""


def inside(truth: ArrayLike, estimate: ArrayLike, ellipsoid: ArrayLike) -> Floats:
    """Return 1 where the true joint is inside of the ellipsoid around the estimated one, 0 where not, (...).

    Args:
        truth: true joints, (..., 3), metres.
        estimate: estimated joints, (..., 3), metres.
        ellipsoid: matrices E of the ellipsoids ``d' inv(E) d <= 1`` around them, (..., 3, 3), square metres. One that
            is singular holds no joint.

    Returns:
        0 or 1; NaN where the truth, the joint or its ellipsoid is missing.
    """
    off = np.asarray(truth, float) - np.asarray(estimate, float)
    ellipsoid = np.asarray(ellipsoid, float)
    known = np.isfinite(off).all(axis=-1) & np.isfinite(ellipsoid).all(axis=(-1, -2))
    matrices = np.where(known[..., None, None], ellipsoid, np.eye(3))
    singular = np.linalg.matrix_rank(matrices, hermitian=True) < 3
    matrices[singular] = np.eye(3)
    distance = np.einsum("...i,...i->...", off, np.linalg.solve(matrices, off[..., None])[..., 0])
    return np.where(known, (distance <= 1.0) & ~singular, np.nan)


def brier(probability: ArrayLike, happened: Bools) -> float | None:
    """Return the mean squared difference between probabilities and what happened, both (k,); None without any."""
    return finite_mean((np.asarray(probability, float) - happened) ** 2)


@score(shipped_scores()["coverage_90"])
def coverage_score(given: ScoreInput) -> float | None:
    """Return the share of placed joints inside of their ellipsoids, percent; None without ellipsoids."""
    shares = []
    for estimate, partner, truth in zip(given.estimates, given.partner, given.truth, strict=True):
        ellipsoids = estimate.ellipsoids(SHARE)
        if ellipsoids is not None:
            found = partner >= 0
            shares.append(inside(truth[found], estimate.joints[partner[found]], ellipsoids[partner[found]]).ravel())
    share = finite_mean(np.concatenate(shares)) if shares else None
    return None if share is None else 100.0 * share


@score(shipped_scores()["score_brier"])
def brier_score(given: ScoreInput) -> float | None:
    """Return the Brier score of the placed joints of all estimates; None without any."""
    scores, right = [], []
    for estimate, partner, truth in zip(given.estimates, given.partner, given.truth, strict=True):
        error = np.full(estimate.scores.shape, np.inf)
        found = partner >= 0
        error[partner[found]] = joint_errors(truth[found], estimate.joints[partner[found]])
        counted = np.isfinite(estimate.joints).all(axis=-1) & ~np.isnan(error)
        scores.append(estimate.scores[counted])
        right.append(error[counted] <= RIGHT)
    return brier(np.concatenate(scores), np.concatenate(right))
