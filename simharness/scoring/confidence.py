"""Calibration of the confidence that a method reports: coverage of its ellipsoids, Brier score of its joint scores.

A method may be accurate and yet claim more or less than it knows. Coverage is the share of true joints inside of the
ellipsoid that should hold 90 % of them: below 90 % the covariances are too small, above it too large. The score of a
joint is read as the probability that the joint is right, that is within 100 mm; the Brier score is its mean squared
error against what happened (Brier, Monthly Weather Review 1950), 0 for certain and right, 0.25 for a constant 0.5. It
is a proper score: its expectation is least for the true probability (Gneiting & Raftery, JASA 2007).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.scoring.joint_errors import joint_errors
from simharness.scoring.score_registry import ScoreInfo, ScoreInput, finite_mean, score

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


def brier(probability: ArrayLike, happened: NDArray[np.bool_]) -> float | None:
    """Return the mean squared difference between probabilities and what happened, both (k,); None without any."""
    return finite_mean((np.asarray(probability, float) - happened) ** 2)


_COVERAGE = "true joints of the people found inside of the estimate's 90 % ellipsoid; the best value is 90"


@score(ScoreInfo("coverage_90", "Coverage", "%", _COVERAGE, "higher", 1, target=100.0 * SHARE, tolerance=1.0))
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


_BRIER = "mean squared error of joint scores as probabilities of an error within 100 mm; joints of ghosts are wrong"


@score(ScoreInfo("score_brier", "Brier score", "", _BRIER, "lower", 3, tolerance=0.005))
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
