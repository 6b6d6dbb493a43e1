"""Multi-way matching by convex optimisation: Algorithm 1 of the paper.

Minimise ``<alpha E - A, P> + lambda ||P||_*`` over P in C by ADMM, which alternates between a spectral step (singular
value thresholding; the matrix is symmetric, so its eigenvalues are used) and the exact projection onto C. E marks the
pairs of different views: a match reduces the objective only if its affinity exceeds alpha.

On C the trace is m, so ``||P||_* = m + 2 (sum of the magnitudes of negative eigenvalues)``: lambda penalises only the
part that is not positive semidefinite, that is, not cycle-consistent. So the dual variable is kept as
``Y = lambda I - S``, and the spectral step of ``P + Y / rho`` keeps the positive eigenvalues of ``Z = P - S / rho`` and
raises those below ``-2 lambda / rho`` by that amount. The latter hardly ever occur, and there is about one positive
eigenvalue per person, so only the top of the spectrum is computed.

The solver may start from a grouping: P is its permutation matrix and S a Laplacian with the gains (affinity minus
alpha) within its parts as weights. If no gain within parts is negative and none between parts is positive, any
fraction of the whole Laplacian proves the grouping optimal: S P = 0 and the eigenvalues of S lie in 0 to 2 lambda, so
Q = P; and P + (S + gain) / rho is at least 1 within parts and at most 0 between them, so its projection is P. The first
iteration then changes nothing, and its residuals stop the solver. Positive gains between parts make the proof harder;
the fractions of both kinds with which S starts (`_WITHIN`, `_BETWEEN`) took the fewest iterations on synthetic crowds.
The optimum of the convex problem does not depend on the start.
"""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.matching.projection import block_starts, project_block
from mvpose.matching.rounding import read_only
from mvpose.threads import one_thread

_BALANCE = 10.0  # ratio of residuals beyond which rho changes (Boyd et al. 2011, section 3.4.1)
_BALANCE_EVERY = 10  # iterations; a step size that changes more often can cycle
_RELAXATION = 1.6  # over-relaxation (Boyd et al. 2011, section 3.4.3), off once P is at rest to avoid oscillation
_AT_REST = 0.1  # movement of P as a fraction of the primal residual
_WITHIN, _BETWEEN = 0.3, 0.5  # initial S as fractions of the gains within and between parts
_SPARE = 4  # extra eigenvalues beyond the expected positive ones; one that is not positive proves completeness
_FEW = 6  # computing part of the spectrum pays off if it is less than the whole divided by this
_SINGLE = 1e-5  # least tolerance for which single precision suffices; its rounding is 1e-6 of the greatest entry


@dataclass(frozen=True)
class Relaxation:
    """Solution of the relaxed problem."""

    P: Floats
    """Relaxed permutation matrix, (m, m), in C."""
    Y: Floats
    """Dual variable, (m, m); its spectral norm is lambda up to the residuals."""
    iterations: int
    """Number of iterations."""
    residuals: tuple[float, float]
    """Primal ``||P - Q||`` and dual ``rho ||P - P_before||`` (with over-relaxation, the distance of Y from the
    subgradient of ``lambda ||Q||_*``), Frobenius norms over m."""
    converged: bool
    """Whether both residuals fell below the tolerance."""
    gain: Floats
    """``A - alpha E``, (m, m)."""
    weight: float
    """Lambda."""

    @property
    def objective(self) -> float:
        """Value of ``<alpha E - A, P> + lambda ||P||_*``."""
        return float(self.weight * np.abs(np.linalg.eigvalsh(self.P)).sum() - (self.gain * self.P).sum())


def solve(
    affinity: Floats,
    view: Integers,
    *,
    parts: Integers | None = None,
    alpha: float = 0.5,
    weight: float = 50.0,
    rho: float = 1.0,
    tolerance: float = 5e-4,
    most_iterations: int = 500,
) -> Relaxation:
    """Solve the relaxed matching problem (paper, equation 9).

    Args:
        affinity: affinity matrix A, (m, m), symmetric, 0 to 1.
        view: camera of each row, (m,), sorted.
        parts: initial grouping, (m,), with at most one row per view in a part; by default every row is a part.
        alpha: least affinity of a match.
        weight: lambda, the penalty on cycle inconsistency.
        rho: initial step size; later adapted to balance the residuals.
        tolerance: limit below which both residuals over m must fall.
        most_iterations: limit of iterations.

    Returns:
        The relaxed P, and the state of the solver at the end.
    """
    view = read_only(view, np.int64)
    parts = np.arange(len(view)) if parts is None else parts
    starts = block_starts(view)
    gain, P, S, held = _start(read_only(affinity, np.float64), view, read_only(parts, np.int64), float(alpha))
    if len(view) == 0:
        return Relaxation(P, S, 0, (0.0, 0.0), True, gain, weight)
    np.fill_diagonal(S, held.sum(axis=1))
    with one_thread():
        iterations, primal, dual = _iterate(P, S, gain, held, starts, weight, rho, tolerance, most_iterations)
    Y = np.subtract(0.0, S, out=S)
    Y.ravel()[:: len(view) + 1] += weight
    _fill_lower(P)
    _fill_lower(Y)
    return Relaxation(P, Y, iterations, (primal, dual), primal < tolerance and dual < tolerance, gain, weight)


@njit(cache=True)
def _start(affinity, view, parts, alpha):
    """Return the gains, the initial P, the initial S without its diagonal, and its gains within parts, (m, m) each."""
    m = len(view)
    gain, P, S, held = np.empty((m, m)), np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    for i in range(m):
        for j in range(m):
            within = parts[i] == parts[j]
            gain[i, j] = affinity[i, j] - alpha if view[i] != view[j] else 0.0
            edge = gain[i, j] if gain[i, j] > 0.0 else 0.0
            P[i, j] = 1.0 if within else 0.0
            S[i, j] = 0.0 - (_WITHIN if within else _BETWEEN) * edge
            held[i, j] = _WITHIN * edge if within else 0.0
    return gain, P, S, held


@njit(cache=True, borrows=True)
def _fill_lower(matrix):
    """Copy the upper triangle of a matrix to the lower one, in place."""
    for i in range(len(matrix)):
        for j in range(i):
            matrix[i, j] = matrix[j, i]


def _iterate(
    P: Floats,
    S: Floats,
    gain: Floats,
    Z: Floats,
    starts: Integers,
    weight: float,
    rho: float,
    tolerance: float,
    most_iterations: int,
) -> tuple[int, float, float]:
    """Run Algorithm 1 on the upper triangles of P and S, in place; return the iterations and both residuals.

    Z, (m, m), is working memory: to fill pages that are new to the process takes longer than the arithmetic on them.
    """
    prices = np.zeros((len(starts), len(P)))
    primal, dual, moved, iteration, positive = np.inf, np.inf, np.inf, 0, 0
    while iteration < most_iterations and (primal >= tolerance or dual >= tolerance):
        iteration += 1
        lowest = _set_target(P, S, rho, Z)
        if lowest >= -2.0 * weight / rho:
            Q, positive = _positive_part(Z, positive, single=tolerance > _SINGLE)
        else:
            Q, positive = _threshold(Z, 2.0 * weight / rho)
        relaxation = _RELAXATION if moved > _AT_REST * primal else 1.0
        primal, dual, moved = _project_and_ascend(Q, P, S, gain, rho, relaxation, starts, prices)
        if iteration % _BALANCE_EVERY == 0:
            factor = 2.0 if primal > _BALANCE * moved else 0.5 if moved > _BALANCE * primal else 1.0
            rho *= factor
            prices /= factor  # prices scale with the step, because the target of P is Q - (Y - gain) / rho
    return iteration, primal, dual


def _positive_part(Z: Floats, expected: int, *, single: bool) -> tuple[Floats, int]:
    """Return ``Z`` (m, m), given by its upper triangle, with negative eigenvalues set to 0, and the positive count."""
    from scipy.linalg import lapack

    m, kind = len(Z), np.float32 if single else np.float64
    solve_part, solve_all = (lapack.ssyevr, lapack.ssyevd) if single else (lapack.dsyevr, lapack.dsyevd)
    requested, complete = expected + max(_SPARE, expected // 8), False
    while expected and not complete and _FEW * requested < m:
        copy = Z.T.astype(kind)
        values, vectors, found, _, info = solve_part(
            copy, range="I", il=m - requested + 1, iu=m, lower=1, overwrite_a=1
        )
        values, complete, requested = values[:found], info == 0 and values[0] <= 0.0, 2 * requested
    if not complete:
        values, vectors, info = solve_all(Z.T.astype(kind), lower=1, overwrite_a=1)
        if info:
            values, vectors = np.linalg.eigh(Z, UPLO="U")
    positive = int(np.count_nonzero(values > 0.0))
    root = vectors[:, len(values) - positive : len(values)] * np.sqrt(values[len(values) - positive :])
    return (root @ root.T).astype(np.float64, copy=False), positive


def _threshold(Z: Floats, gap: float) -> tuple[Floats, int]:
    """Return :func:`_positive_part`, but with eigenvalues below ``-gap`` raised by ``gap`` instead of set to 0."""
    values, vectors = np.linalg.eigh(Z, UPLO="U")
    shrunk = np.maximum(values, 0.0) + np.minimum(values + gap, 0.0)
    return (vectors * shrunk) @ vectors.T, int((values > 0.0).sum())


@njit(cache=True, error_model="numpy")
def _set_target(P, S, rho, Z):
    """Set Z to P - S / rho (upper triangles) and return Gershgorin's lower bound of its eigenvalues."""
    m = len(P)
    reach = np.zeros(m)
    for i in range(m):
        row_sum = 0.0
        for j in range(i + 1, m):
            Z[i, j] = P[i, j] - S[i, j] / rho
            row_sum += abs(Z[i, j])
            reach[j] += abs(Z[i, j])
        reach[i] += row_sum
    lowest = np.inf
    for i in range(m):
        Z[i, i] = P[i, i] - S[i, i] / rho
        lowest = min(lowest, Z[i, i] - reach[i])
    return lowest


@njit(cache=True, error_model="numpy")
def _project_and_ascend(Q, P, S, gain, rho, relaxation, starts, prices):
    """Project P onto C and update the dual S, upper triangles in place; return both residuals and rho times P's step.

    ``prices[block, row]`` is the dual price of the row sum in the block against ``block``, from the last call.
    """
    blocks = len(starts) - 1
    primal, dual, moved = 0.0, 0.0, 0.0
    for i in range(blocks):
        a0, a1 = starts[i], starts[i + 1]
        for k in range(a0, a1):  # P is the identity here
            for n in range(k, a1):
                gap = P[k, n] - Q[k, n]
                S[k, n] -= rho * relaxation * gap
                primal += gap * gap * (1.0 if n == k else 2.0)
                dual += ((relaxation - 1.0) * gap) ** 2 * (1.0 if n == k else 2.0)
        for j in range(i + 1, blocks):
            b0, b1 = starts[j], starts[j + 1]
            Y = np.empty((a1 - a0, b1 - b0))
            for k in range(a0, a1):
                for n in range(b0, b1):
                    mix = relaxation * Q[k, n] + (1.0 - relaxation) * P[k, n]
                    Y[k - a0, n - b0] = mix + (S[k, n] + gain[k, n]) / rho
            project_block(Y, prices[j, a0:a1], prices[i, b0:b1])
            for k in range(a0, a1):
                for n in range(b0, b1):
                    y, q, p = Y[k - a0, n - b0], Q[k, n], P[k, n]
                    step = y - relaxation * q - (1.0 - relaxation) * p
                    primal += 2.0 * (y - q) ** 2
                    dual += 2.0 * (step - p + q) ** 2
                    moved += 2.0 * (y - p) ** 2
                    S[k, n] -= rho * step
                    P[k, n] = y
    return np.sqrt(primal) / len(P), rho * np.sqrt(dual) / len(P), rho * np.sqrt(moved) / len(P)
