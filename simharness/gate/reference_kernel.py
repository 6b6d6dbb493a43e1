"""Reference kernel: a fixed amount of work that is timed beside the method.

Times of the method are given as ratios to the time of the kernel, so that they can be compared between fast, slow and
busy machines. The kernel does the same kinds of work as the method, in similar shares: compiled loops (products of
small matrices, likelihoods of points in views, small linear systems), and calls of NumPy on small arrays, whose time is
that of the interpreter. The two suffer differently where other processes share a core and its caches: in units of
compiled loops alone, unchanged code took up to 1.6 times as long at another load, in these units 1.1 times.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mvpose.arrays import Floats
from mvpose.kernels import njit

_SIZE, _PRODUCTS = 40, 10  # size of the matrices, and number of products, as in a matching
_POINTS, _VIEWS = 2000, 5  # candidate positions of a joint, and views
_CALLS = 20  # small arrays


def reference_work() -> Callable[[], float]:
    """Return a function that does the work of one call of the kernel, compiled and run once."""
    rng = np.random.default_rng(0)
    matrix = rng.random((_SIZE, _SIZE)) / _SIZE
    points, rays = rng.random((_POINTS, 3)), rng.random((_VIEWS, 6))
    _work(matrix, points, rays)
    return lambda: float(_work(matrix, points, rays)) + _small_arrays(points[:_SIZE])


def _small_arrays(points: Floats) -> float:
    """Do the work of a call that is not compiled: centre, weigh, sort and solve for small arrays."""
    total = 0.0
    for call in range(_CALLS):
        centred = points - points.mean(axis=0)
        near = np.linalg.norm(centred, axis=1)
        order = np.argsort(near)[: 10 + call % 5]
        weights = np.exp(-near[order])
        normal = np.einsum("n,ni,nj->ij", weights, centred[order], centred[order])
        total += float(np.linalg.solve(normal + np.eye(3), centred[0])[0])
    return total


@njit(cache=True)
def _work(matrix: Floats, points: Floats, rays: Floats) -> float:
    """Do the work of one call; return a number that depends on all of it, so that no part is optimised away."""
    size = len(matrix)
    power, product = matrix.copy(), np.empty_like(matrix)
    for _ in range(_PRODUCTS):
        for i in range(size):
            for j in range(size):
                total = 0.0
                for k in range(size):
                    total += power[i, k] * matrix[k, j]
                product[i, j] = min(max(total, 0.0), 1.0)
        power, product = product, power
    best = -np.inf
    normal, side = np.zeros((3, 3)), np.zeros(3)
    for point in points:
        score = 0.0
        for ray in rays:
            x = ray[1] * (point[2] - ray[5]) - ray[2] * (point[1] - ray[4])
            y = ray[2] * (point[0] - ray[3]) - ray[0] * (point[2] - ray[5])
            z = ray[0] * (point[1] - ray[4]) - ray[1] * (point[0] - ray[3])
            miss = x * x + y * y + z * z
            score += np.log(0.05 + np.exp(-8.0 * miss) / (1.0 + np.sqrt(miss)))
        best = max(best, score)
        for i in range(3):
            side[i] += score * point[i]
            for j in range(3):
                normal[i, j] += point[i] * point[j]
    for k in range(3):  # elimination; the matrix is positive definite
        for i in range(k + 1, 3):
            share = normal[i, k] / normal[k, k]
            side[i] -= share * side[k]
            for j in range(3):
                normal[i, j] -= share * normal[k, j]
    return float(best + side[2] / normal[2, 2] + power[0, 0])
