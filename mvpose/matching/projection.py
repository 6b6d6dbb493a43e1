"""The exact Euclidean projection onto the paper's set C (equations 1, 6, 7 and 8).

C holds the symmetric matrices with identity blocks on the diagonal (a view against itself) whose other blocks are
non-negative with row and column sums at most one. Blocks are independent, so each upper block is projected and
mirrored. For one block Y the dual of the projection has one multiplier a row (u) and one a column (v), and
``X = max(0, Y - u - v)``; with v held, each row's u is an exact one-dimensional solve, and the other way round.
Alternating the two climbs a smooth concave dual to its maximum, and the multipliers of the last call are an
excellent start for the next, so inside ADMM one or two sweeps suffice.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

TOLERANCE = 1e-10  # change of the multipliers
MOST_SWEEPS = 10_000
_SLACK = 1e-11  # of a row's sum; well above rounding for entries up to a thousand


def project(matrix: ArrayLike, view: ArrayLike) -> NDArray[np.float64]:
    """Project a symmetric matrix onto C.

    Args:
        matrix: (m, m), symmetric.
        view: camera of each row, (m,), sorted so that a view's rows are together.

    Returns:
        The nearest matrix of C in the Frobenius norm, (m, m).

    Raises:
        ValueError: a shape that does not fit, or views that are not sorted.
    """
    result = np.array(matrix, dtype=np.float64)
    view = np.asarray(view, dtype=np.int64)
    if result.shape != (len(view), len(view)):
        raise ValueError(f"matrix must be ({len(view)}, {len(view)}) for {len(view)} views of rows, got {result.shape}")
    starts = block_starts(view)
    project_in_place(result, starts, np.zeros_like(result[: len(starts)]))
    return result


def block_starts(view: NDArray[np.int64]) -> NDArray[np.int64]:
    """First row of every view's block, then m; ``view`` must be sorted."""
    if (np.diff(view) < 0).any():
        raise ValueError("rows must be sorted by view")
    return np.concatenate([[0], np.flatnonzero(np.diff(view)) + 1, [len(view)]]) if len(view) else np.zeros(1, np.int64)


@njit(cache=True)
def project_in_place(X, starts, multipliers):  # type: ignore[no-untyped-def]
    """Project symmetric ``X`` (m, m) onto C in place; ``multipliers`` (>= blocks, m) hold the warm start.

    ``multipliers[block, row]`` is the price of that row within its block against ``block``.
    """
    blocks = len(starts) - 1
    for i in range(blocks):
        a0, a1 = starts[i], starts[i + 1]
        X[a0:a1, a0:a1] = 0.0
        for k in range(a0, a1):
            X[k, k] = 1.0
        for j in range(i + 1, blocks):
            b0, b1 = starts[j], starts[j + 1]
            u, v = multipliers[j, a0:a1], multipliers[i, b0:b1]
            for _ in range(MOST_SWEEPS):
                change = _solve_rows(X[a0:a1, b0:b1], u, v)
                change = max(change, _solve_rows(X[a0:a1, b0:b1].T, v, u))
                if change < TOLERANCE:
                    break
            for k in range(a0, a1):
                for n in range(b0, b1):
                    X[k, n] = X[n, k] = max(0.0, X[k, n] - u[k - a0] - v[n - b0])


@njit(cache=True)
def _solve_rows(Y, u, v):  # type: ignore[no-untyped-def]
    """Set every u_i to the least non-negative price at which row i of max(0, Y - u - v) sums to at most one.

    The sum falls with the price along a convex polygon, so Newton's steps from the left (price 0) never overshoot
    and end after finitely many: the set of entries above the price only shrinks.
    """
    rows, columns = Y.shape
    change = 0.0
    for i in range(rows):
        price = 0.0
        while True:
            excess, above = -1.0, 0
            for j in range(columns):
                value = Y[i, j] - v[j] - price
                if value > 0.0:
                    excess += value
                    above += 1
            if not excess > _SLACK:  # also ends on NaN
                break
            price += excess / above
        change = max(change, abs(price - u[i]))
        u[i] = price
    return change
