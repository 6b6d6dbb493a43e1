"""Multi-way matching with cycle consistency (paper, section 3.2), which groups detections of all views into people."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array
from mvpose.estimate import Matching
from mvpose.kernels import njit
from mvpose.matching import admm
from mvpose.matching.assignment import match_view_pairs
from mvpose.matching.clustering import cluster, contract
from mvpose.matching.rounding import number_people, read_only, round_to_people
from mvpose.ordering import chosen_pairs, restored_pairs

__all__ = ["Matcher", "match", "objective"]

Method = Literal["admm", "clustering", "hungarian"]

_ASYMMETRY = 1e-6  # tolerance for rounding, also in single precision


@dataclass(frozen=True)
class Matcher:
    """Configured matching method; see :func:`match`.

    Raises:
        ValueError: an unknown method, or ``alpha`` outside 0..1.
    """

    method: Method = "admm"
    """``"admm"``, ``"clustering"`` or ``"hungarian"``."""
    alpha: float = 0.5
    """Least affinity of a match, 0 to 1."""

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise ValueError(f"method must be 'admm', 'clustering' or 'hungarian', got {self.method!r}")
        if not 0.0 <= self.alpha <= 1.0:
            raise ValueError(f"alpha must lie in 0..1, as affinities do, got {self.alpha}")

    def __call__(self, affinity: ArrayLike, view: ArrayLike) -> Matching:
        """Group detections into people; see :func:`match`."""
        affinity, view = _checked(affinity, view)
        if self.method == "clustering":
            return self._matching(number_people(cluster(affinity, view, alpha=self.alpha)), affinity)
        if self.method == "hungarian":
            matched = match_view_pairs(affinity, view, alpha=self.alpha)
            return self._matching(round_to_people(matched, view, threshold=self.alpha), affinity)
        order = np.argsort(view, kind="stable")
        parts = contract(affinity, view, alpha=self.alpha)
        relaxed = admm.solve(chosen_pairs(affinity, order), view[order], parts=parts[order], alpha=self.alpha)
        P = restored_pairs(relaxed.P, order, len(order))
        return self._matching(
            round_to_people(P, view),
            affinity,
            P=P,
            iterations=relaxed.iterations,
            residuals=relaxed.residuals,
            converged=relaxed.converged,
        )

    def _matching(self, labels: NDArray[np.int64], affinity: NDArray[np.float64], **solver: Any) -> Matching:
        return Matching(labels=labels, objective=_objective(labels, affinity, float(self.alpha)), **solver)


def match(affinity: ArrayLike, view: ArrayLike, *, method: Method = "admm", alpha: float = 0.5) -> Matching:
    """Group the detections of all views into people.

    Every result is cycle-consistent: a person is a set of detections with at most one per view. A detection that
    matches no other is treated as a false detection and gets label -1 (paper, section 3.2).

    Args:
        affinity: affinity matrix, (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        method: ``"admm"`` is Algorithm 1 of the paper; ``"clustering"`` solves the integer problem that it relaxes
            and is much faster; ``"hungarian"`` is the baseline, which matches each pair of views separately and
            resolves inconsistencies by dropping the weakest links.
        alpha: least affinity of a match, 0 to 1.

    Returns:
        The people; ``objective`` is :func:`objective` of the labels, so that methods can be compared.

    Raises:
        ValueError: a wrong shape, an unknown method, ``alpha`` outside 0..1, or an affinity that is not symmetric or
            outside 0..1.
    """
    return Matcher(method=method, alpha=alpha)(affinity, view)


def objective(labels: ArrayLike, affinity: ArrayLike, *, alpha: float = 0.5) -> float:
    """Return ``<alpha E - A, P>`` of a grouping, summed over unordered pairs, which every method minimises.

    The nuclear norm of a consistent P is m for every grouping, so the second term of the paper is left out.
    """
    return _objective(read_only(labels, np.int64), read_only(affinity, np.float64), float(alpha))


def _checked(affinity: ArrayLike, view: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return both as read-only arrays, with the affinity exactly symmetric."""
    if not (isinstance(view, np.ndarray) and view.ndim == 1 and view.dtype == np.int64):
        view = as_array(view, ("m",), "view", np.int64)
    shape = (len(view), len(view))
    if not (isinstance(affinity, np.ndarray) and affinity.shape == shape and affinity.dtype == np.float64):
        affinity = as_array(affinity, shape, "affinity")
    affinity = read_only(affinity, np.float64)
    asymmetry = _asymmetry(affinity)
    if not asymmetry <= _ASYMMETRY:
        got = "values outside 0..1 or NaN" if np.isinf(asymmetry) else f"an asymmetry of {asymmetry:.3g}"
        raise ValueError(f"affinity must be symmetric with values in 0..1, got {got}")
    if asymmetry > 0.0:
        affinity = read_only(0.5 * (affinity + affinity.T), np.float64)
    return affinity, read_only(view, np.int64)


@njit(cache=True)
def _asymmetry(affinity):
    """Return the greatest difference from the transpose; infinite if a value is outside 0..1 or NaN."""
    m, side, worst = len(affinity), 32, 0.0
    for top in range(0, m, side):  # square tiles, so that the matrix and its transpose both stay in the cache
        for left in range(top, m, side):
            for i in range(top, min(top + side, m)):
                for j in range(max(left, i), min(left + side, m)):
                    one, other = affinity[i, j], affinity[j, i]
                    if not (one >= 0.0 and one <= 1.0 and other >= 0.0 and other <= 1.0):
                        return np.inf
                    worst = max(worst, abs(one - other))
    return worst


@njit(cache=True)
def _objective(labels, affinity, alpha):
    total = 0.0
    for i in range(len(labels)):
        if labels[i] >= 0:
            for j in range(i + 1, len(labels)):
                if labels[j] == labels[i]:
                    total += alpha - affinity[i, j]
    return total
