"""Exact Euclidean projection onto the set C of the paper (equations 1, 6, 7 and 8).

C is the set of symmetric matrices with identity blocks on the diagonal (a view against itself) whose other blocks are
non-negative with row and column sums of at most one. Blocks are independent, so each upper block is projected and
mirrored. For one block Y the dual of the projection has one price per row (u) and per column (v), and
``X = max(0, Y - u - v)``. With v fixed, the price u of each row is an exact one-dimensional solve, and vice versa.
Alternating between the two maximises a smooth concave dual, but converges slowly along chains of competing rows and
columns. So each round ends with a Newton step of v (the dual is piecewise quadratic), after which two to five rounds
reach full precision where hundreds were needed. The alternation decides when to stop, so a bad Newton step only costs
a round. The prices of the last call are an excellent start for the next.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.kernels import njit

TOLERANCE = 1e-10  # greatest change of a price in the last round
MOST_ROUNDS = 10_000
_MOST_NEWTON = 40  # rounds with a Newton step; later rounds only alternate, which cannot cycle
_SLACK = 1e-11  # tolerance of a row sum; well above rounding error for entries up to a thousand
_SINGULAR = 1e-9  # least pivot; pivots of a regular system are at least 1 over the number of rows


def project(matrix: ArrayLike, view: ArrayLike) -> NDArray[np.float64]:
    """Project a symmetric matrix onto C.

    Args:
        matrix: symmetric matrix, (m, m).
        view: camera of each row, (m,), sorted.

    Returns:
        Nearest matrix of C in the Frobenius norm, (m, m).

    Raises:
        ValueError: a wrong shape, or views that are not sorted.
    """
    result = np.array(matrix, dtype=np.float64, order="C")
    view = np.asarray(view, dtype=np.int64)
    if result.shape != (len(view), len(view)):
        raise ValueError(f"matrix must be ({len(view)}, {len(view)}), as view has {len(view)} rows, got {result.shape}")
    starts = block_starts(view)
    _project(result, starts)
    return result


@njit(cache=True)
def block_starts(view):
    """Return the first row of every view's block, followed by m; ``view`` must be sorted."""
    starts, blocks = np.empty(len(view) + 1, np.int64), 0
    for i in range(len(view)):
        if i == 0 or view[i] != view[i - 1]:
            if i > 0 and view[i] < view[i - 1]:
                raise ValueError("rows must be sorted by view: sort matrix and view by np.argsort(view, kind='stable')")
            starts[blocks] = i
            blocks += 1
    starts[blocks] = len(view)
    return starts[: blocks + 1].copy()


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
    transposed, workspace = np.empty((columns, rows)), np.empty((columns + 2, columns))
    for i in range(rows):
        for j in range(columns):
            transposed[j, i] = Y[i, j]
    for round_ in range(MOST_ROUNDS):
        change = _solve_rows(Y, u, v)
        change = max(change, _solve_rows(transposed, v, u))
        if change < TOLERANCE:
            break
        if round_ < _MOST_NEWTON:
            _newton_step(Y, u, v, workspace)
    for i in range(rows):
        for j in range(columns):
            Y[i, j] = max(0.0, Y[i, j] - u[i] - v[j])


@njit(cache=True, fastmath={"reassoc"})
def _excess(row, price, prices):
    """Return the sum of max(0, row - price - prices) minus one, and the number of positive entries."""
    total, above = -1.0, 0.0
    for j in range(len(row)):
        value = row[j] - prices[j] - price
        total += value if value > 0.0 else 0.0
        above += 1.0 if value > 0.0 else 0.0
    return total, above


@njit(cache=True, error_model="numpy")
def _solve_rows(Y, u, v):
    """Set every u_i to the least non-negative price at which row i of max(0, Y - u - v) sums to at most one.

    The sum is a convex, piecewise linear, decreasing function of the price. So a Newton step from a price that is too
    high ends at or below the root, and steps from below never overshoot and end after finitely many, because the set
    of entries above the price only shrinks. The greatest change of a price is returned.
    """
    change = 0.0
    for i in range(len(u)):
        row, price = Y[i], u[i]
        excess, above = _excess(row, price, v)
        if excess < 0.0 and price > 0.0:
            price = max(0.0, price + excess / above) if above > 0.0 else 0.0
            excess, above = _excess(row, price, v)
        while excess > _SLACK:  # false for NaN, so the loop ends
            price += excess / above
            excess, above = _excess(row, price, v)
        change = max(change, abs(price - u[i]))
        u[i] = price
    return change


@njit(cache=True, error_model="numpy")
def _newton_step(Y, u, v, workspace):
    """Take a Newton step of the positive column prices v, with the row prices eliminated (solved in the next round).

    The system is a Laplacian plus a non-negative diagonal, so Cholesky needs no pivoting. Where all constraints of a
    group of rows and columns are tight, its prices are determined only up to a constant: the last pivot vanishes and
    that price is kept.
    """
    H, step, tight, count = workspace, workspace[-1], workspace[-2], 0
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
