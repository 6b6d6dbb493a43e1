"""The exact Euclidean projection onto the paper's set C (equations 1, 6, 7 and 8).

C holds the symmetric matrices with identity blocks on the diagonal (a view against itself) whose other blocks are
non-negative with row and column sums at most one. Blocks are independent, so each upper block is projected and
mirrored. For one block Y the dual of the projection has one price a row (u) and one a column (v), and
``X = max(0, Y - u - v)``; with v held, each row's u is an exact one-dimensional solve, and the other way round.
Alternating the two climbs a smooth concave dual to its maximum, but slowly along chains of rows and columns that
compete; so each round ends in a Newton step of v (the dual is piecewise quadratic), and two to five rounds reach the
last digits where hundreds were needed. The alternation decides when to stop, so a bad Newton step only costs a round.
Prices of the last call are an excellent start for the next.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

TOLERANCE = 1e-10  # change of the prices
MOST_ROUNDS = 10_000
_MOST_NEWTON = 40  # rounds; after them plain alternation, which cannot cycle
_SLACK = 1e-11  # of a row's sum; well above rounding for entries up to a thousand
_SINGULAR = 1e-9  # a pivot; those of a regular system are at least 1 over the number of rows


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
    result = np.array(matrix, dtype=np.float64, order="C")
    view = np.asarray(view, dtype=np.int64)
    if result.shape != (len(view), len(view)):
        raise ValueError(f"matrix must be ({len(view)}, {len(view)}) for {len(view)} views of rows, got {result.shape}")
    starts = block_starts(view)
    _project(result, starts)
    return result


def block_starts(view: NDArray[np.int64]) -> NDArray[np.int64]:
    """First row of every view's block, then m; ``view`` must be sorted."""
    if (np.diff(view) < 0).any():
        raise ValueError("rows must be sorted by view")
    return np.concatenate([[0], np.flatnonzero(np.diff(view)) + 1, [len(view)]]) if len(view) else np.zeros(1, np.int64)


@njit(cache=True)
def _project(X, starts):
    """Project symmetric ``X`` (m, m) onto C in place."""
    blocks, prices = len(starts) - 1, np.empty(len(X))
    for i in range(blocks):
        a0, a1 = starts[i], starts[i + 1]
        for k in range(a0, a1):
            for n in range(a0, a1):
                X[k, n] = 1.0 if n == k else 0.0
        for j in range(i + 1, blocks):
            b0, b1 = starts[j], starts[j + 1]
            Y = np.empty((a1 - a0, b1 - b0))
            for k in range(a0, a1):
                for n in range(b0, b1):
                    Y[k - a0, n - b0] = X[k, n]
            prices[:] = 0.0
            project_block(Y, prices[a0:a1], prices[b0:b1])
            for k in range(a0, a1):
                for n in range(b0, b1):
                    X[k, n] = X[n, k] = Y[k - a0, n - b0]


@njit(cache=True)
def project_block(Y, u, v):
    """Project ``Y``, C-contiguous, onto the doubly substochastic matrices in place, from prices ``u`` and ``v``."""
    rows, columns = Y.shape
    turned, room = np.empty((columns, rows)), np.empty((columns + 2, columns))
    for i in range(rows):
        for j in range(columns):
            turned[j, i] = Y[i, j]
    for round_ in range(MOST_ROUNDS):
        change = _solve_rows(Y, u, v)
        change = max(change, _solve_rows(turned, v, u))
        if change < TOLERANCE:
            break
        if round_ < _MOST_NEWTON:
            _newton_step(Y, u, v, room)
    for i in range(rows):
        for j in range(columns):
            Y[i, j] = max(0.0, Y[i, j] - u[i] - v[j])


@njit(cache=True, fastmath={"reassoc"})
def _excess(row, price, prices):
    """What max(0, row - price - prices) sums to above one, and how many entries are positive."""
    total, above = -1.0, 0.0
    for j in range(len(row)):
        value = row[j] - prices[j] - price
        total += value if value > 0.0 else 0.0
        above += 1.0 if value > 0.0 else 0.0
    return total, above


@njit(cache=True, error_model="numpy")
def _solve_rows(Y, u, v):
    """Set every u_i to the least non-negative price at which row i of max(0, Y - u - v) sums to at most one.

    The sum falls with the price along a convex polygon. So Newton's step from a price that is too high ends at or
    below the root, and from below the steps never overshoot and end after finitely many: the set of entries above the
    price only shrinks. The greatest change is returned.
    """
    change = 0.0
    for i in range(len(u)):
        row, price = Y[i], u[i]
        excess, above = _excess(row, price, v)
        if excess < 0.0 and price > 0.0:
            price = max(0.0, price + excess / above) if above > 0.0 else 0.0
            excess, above = _excess(row, price, v)
        while excess > _SLACK:  # also ends on NaN
            price += excess / above
            excess, above = _excess(row, price, v)
        change = max(change, abs(price - u[i]))
        u[i] = price
    return change


@njit(cache=True, error_model="numpy")
def _newton_step(Y, u, v, room):
    """Newton's step of the positive prices v, with those of the rows eliminated: the next rows' solve follows them.

    The system is a Laplacian plus a non-negative diagonal, so Cholesky needs no pivoting; where a group of rows and
    columns is tight all over, its prices are determined but for a constant, the last pivot vanishes, and that price
    stays.
    """
    H, step, tight, count = room, room[-1], room[-2], 0
    for j in range(len(v)):
        if v[j] > 0.0:
            tight[count] = j
            step[count] = 0.0
            for b in range(count + 1):
                H[count, b] = 0.0
            count += 1
    for i in range(len(u)):
        excess, above = _excess(Y[i], u[i], v)
        for a in range(count):
            j = int(tight[a])
            if Y[i, j] - u[i] - v[j] > 0.0:
                H[a, a] += 1.0
                if u[i] > 0.0:
                    step[a] -= excess / above
                    for b in range(a + 1):
                        k = int(tight[b])
                        if Y[i, k] - u[i] - v[k] > 0.0:
                            H[a, b] -= 1.0 / above
    for a in range(count):
        for b in range(a + 1):
            rest = H[a, b]
            for k in range(b):
                rest -= H[a, k] * H[b, k]
            if a == b:
                H[a, a] = np.sqrt(rest) if rest > _SINGULAR else 0.0
            else:
                H[a, b] = rest / H[b, b] if H[b, b] > 0.0 else 0.0
        for k in range(a):
            step[a] -= H[a, k] * step[k]
        step[a] = step[a] / H[a, a] if H[a, a] > 0.0 else 0.0
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
            step[a] -= H[k, a] * step[k]
        step[a] = step[a] / H[a, a] if H[a, a] > 0.0 else 0.0
        j = int(tight[a])
        v[j] = max(0.0, v[j] + step[a])
