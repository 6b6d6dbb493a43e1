"""Multi-way matching by convex optimisation: Algorithm 1 of the paper.

Minimise ``<alpha E - A, P> + lambda ||P||_*`` over P in C, by ADMM between the spectral step (singular value
thresholding, here of a symmetric matrix, so by its eigenvalues) and the exact projection onto C. E marks the pairs
of different views: a match must earn more than alpha to be worth making.

On C the trace is m, so ``||P||_* = m + 2 (sum of the magnitudes of negative eigenvalues)``: lambda charges only for
what is not positive semidefinite, that is, not cycle-consistent. Hence the dual variable starts at ``lambda I``, the
value it must reach on the positive eigenvectors, rather than at 0; the optimum is the paper's, reached sooner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.matching.projection import block_starts, project_in_place

Floats = NDArray[np.float64]

_BALANCE = 10.0  # residuals further apart than this change rho (Boyd et al. 2011, section 3.4.1)
_BALANCE_EVERY = 10  # iterations; a step size that changes more often can cycle


@dataclass(frozen=True)
class Relaxation:
    """The relaxed solution.

    Attributes:
        P: (m, m), in C.
        iterations: how many were taken.
        residuals: primal ``||P - Q||`` and dual ``rho ||Q - Q_before||``, Frobenius norms over m.
        objective: ``<alpha E - A, P> + lambda ||P||_*`` at P.
        converged: whether both residuals fell below the tolerance.
    """

    P: Floats
    iterations: int
    residuals: tuple[float, float]
    objective: float
    converged: bool


def solve(
    affinity: Floats,
    view: NDArray[np.int64],
    *,
    alpha: float = 0.5,
    weight: float = 50.0,
    rho: float = 1.0,
    tolerance: float = 5e-4,
    most_iterations: int = 500,
) -> Relaxation:
    """Solve the relaxed matching problem (paper, equation 9).

    Args:
        affinity: A, (m, m), symmetric, 0 to 1.
        view: camera of each row, (m,), sorted.
        alpha: what a match must earn.
        weight: lambda, the price of cycle inconsistency.
        rho: the first step size; balanced against the residuals afterwards.
        tolerance: both residuals over m must fall below this.
        most_iterations: give up after as many.

    Returns:
        The relaxed P and how the solver stopped.
    """
    m = len(view)
    if m == 0:
        return Relaxation(np.zeros((0, 0)), 0, (0.0, 0.0), 0.0, True)
    starts = block_starts(view)
    gain = np.where(view[:, None] == view[None, :], 0.0, affinity - alpha)
    P, iterations, primal, dual = _iterate(gain, starts, weight, rho, tolerance, most_iterations)
    objective = float(-(gain * P).sum() + weight * np.abs(np.linalg.eigvalsh(P)).sum())
    return Relaxation(P, iterations, (primal, dual), objective, primal < tolerance and dual < tolerance)


def _iterate(
    gain: Floats, starts: NDArray[np.int64], weight: float, rho: float, tolerance: float, most_iterations: int
) -> tuple[Floats, int, float, float]:
    m = len(gain)
    P = np.maximum(gain, 0.0)
    multipliers = np.zeros((len(starts), m))
    project_in_place(P, starts, multipliers)
    Q, Y = P.copy(), weight * np.eye(m)
    primal, dual, iteration = np.inf, np.inf, 0
    while iteration < most_iterations and (primal >= tolerance or dual >= tolerance):
        iteration += 1
        values, vectors = np.linalg.eigh(P + Y / rho)
        shrunk = np.sign(values) * np.maximum(np.abs(values) - weight / rho, 0.0)
        before, Q = Q, (vectors * shrunk) @ vectors.T
        moved, gap = _project_and_ascend(Q, before, Y, gain, rho, P, starts, multipliers)
        primal, dual = np.sqrt(gap) / m, rho * np.sqrt(moved) / m
        if iteration % _BALANCE_EVERY == 0:
            factor = 2.0 if primal > _BALANCE * dual else 0.5 if dual > _BALANCE * primal else 1.0
            rho *= factor
            multipliers /= factor  # prices are per step: P's target is Q - (Y - gain) / rho
    return P, iteration, float(primal), float(dual)


@njit(cache=True)
def _project_and_ascend(Q, before, Y, gain, rho, P, starts, multipliers):  # type: ignore[no-untyped-def]
    """P onto C, Y up the dual, both in place; ``||Q - before||^2`` and ``||P - Q||^2``."""
    m = len(Q)
    for i in range(m):
        for j in range(i, m):
            target = 0.5 * (Q[i, j] + Q[j, i] - (Y[i, j] + Y[j, i] - gain[i, j] - gain[j, i]) / rho)
            P[i, j] = P[j, i] = target
    project_in_place(P, starts, multipliers)
    moved, gap = 0.0, 0.0
    for i in range(m):
        for j in range(m):
            moved += (Q[i, j] - before[i, j]) ** 2
            gap += (P[i, j] - Q[i, j]) ** 2
            Y[i, j] += rho * (P[i, j] - Q[i, j])
    return moved, gap
