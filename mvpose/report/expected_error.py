"""Error that covariances lead one to expect, without any truth.

A covariance states the mean squared error, and rare gross errors have a large part in it: half of the joints are better
than a Gaussian of this covariance says. So the errors are taken to be a multivariate t, with the degrees of freedom
that the estimate states, and else with the three that a joint's error has before any residual
(:data:`mvpose.reconstruction.error_scale.PRIOR_FREEDOM`). ``python -m benchmarks.expected_error`` puts the result
beside real errors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.reconstruction.error_scale import PRIOR_FREEDOM
from mvpose.recording import People

_DRAWS = 30_000  # of errors in all; the median of so many is right to a percent
_LEAST_DRAWS, _MOST_JOINTS = 8, 6000  # draws of each joint, and joints drawn for
_SEED = 0  # the same numbers for the same people


def expected_median(covariance: Floats, freedom: ArrayLike = PRIOR_FREEDOM) -> float:
    """Return the distance that half of the errors of some joints are expected to be below, metres.

    It is the median over all joints together, not that of their medians, found from random errors.

    Args:
        covariance: (..., 3, 3), square metres; those with NaN are left out.
        freedom: degrees of freedom of each error, of a shape that fits to (...); above 2, infinite for a Gaussian, NaN
            where it is not known.

    Returns:
        The median, right to a percent; NaN without any joint.
    """
    freedoms = np.broadcast_to(np.asarray(freedom, float), covariance.shape[:-2]).ravel()
    matrices = covariance.reshape(-1, 3, 3)
    known = np.flatnonzero(np.isfinite(matrices).all(axis=(1, 2)))
    if not len(known):
        return np.nan
    chosen = known[:: -(-len(known) // _MOST_JOINTS)]
    freedoms = np.nan_to_num(freedoms[chosen], nan=PRIOR_FREEDOM, posinf=1e9)[:, None]
    values, vectors = np.linalg.eigh(matrices[chosen])
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    rng, count = np.random.default_rng(_SEED), max(_LEAST_DRAWS, _DRAWS // len(chosen))
    lengths = np.linalg.norm(rng.normal(size=(len(roots), count, 3)) @ np.swapaxes(roots, 1, 2), axis=2)
    return float(np.median(lengths * np.sqrt((freedoms - 2.0) / rng.chisquare(freedoms, lengths.shape))))


def expected_error(people: People, person: int | None = None, joints: ArrayLike | None = None) -> float:
    """Return the expected median error of people, metres; NaN without covariances.

    Args:
        people: the people.
        person: row of one person; None for all.
        joints: mask (J,) of some joints; None for all.
    """
    if people.covariance is None:
        return np.nan
    rows = slice(None) if person is None else slice(person, person + 1)
    columns = np.ones(len(people.skeleton), bool) if joints is None else np.asarray(joints, bool)
    freedom = PRIOR_FREEDOM if people.freedom is None else people.freedom[:, rows][:, :, columns]
    return expected_median(people.covariance[:, rows][:, :, columns], freedom)
