"""Multi-way matching with cycle consistency (paper, section 3.2): detections of all views to people."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array
from mvpose.estimate import Matching
from mvpose.matching import admm
from mvpose.matching.clustering import cluster
from mvpose.matching.pairwise import assign
from mvpose.matching.rounding import number_people, round_to_people

__all__ = ["Matcher", "match", "objective"]

Method = Literal["admm", "clustering", "hungarian"]


@dataclass(frozen=True)
class Matcher:
    """How detections are matched; see :func:`match`."""

    method: Method = "admm"
    alpha: float = 0.5

    def __call__(self, affinity: NDArray[np.float64], view: NDArray[np.int64]) -> Matching:
        """Match; see :func:`match`."""
        return match(affinity, view, method=self.method, alpha=self.alpha)


def match(affinity: ArrayLike, view: ArrayLike, *, method: Method = "admm", alpha: float = 0.5) -> Matching:
    """Group the detections of all views into people.

    Every result is cycle-consistent: a person is a set of detections, at most one of a view. A detection that
    matches no other is left out (label -1) as a false detection (paper, section 3.2).

    Args:
        affinity: (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        method: ``"admm"`` is Algorithm 1 of the paper; ``"clustering"`` works on the integer problem that it relaxes
            and is much faster; ``"hungarian"`` matches each pair of views alone and breaks what is inconsistent at
            its weakest links: the baseline.
        alpha: a match must have more affinity than this to be worth making.

    Returns:
        The people; ``objective`` is :func:`objective` of the labels, so that methods can be compared.

    Raises:
        ValueError: a shape or method that does not fit, or an affinity that is not symmetric or outside 0..1.
    """
    view = as_array(view, ("m",), "view", np.int64)
    affinity = as_array(affinity, (len(view), len(view)), "affinity")
    if not ((affinity >= 0) & (affinity <= 1)).all() or not np.allclose(affinity, affinity.T, atol=1e-9):
        raise ValueError("affinity must be symmetric with values in 0..1")
    if method == "clustering":
        return _matching(number_people(cluster(affinity, view, alpha=alpha)), affinity, alpha)
    if method == "hungarian":
        return _matching(round_to_people(assign(affinity, view, alpha=alpha), view, threshold=alpha), affinity, alpha)
    if method != "admm":
        raise ValueError(f"method must be 'admm', 'clustering' or 'hungarian', got {method!r}")
    order = np.argsort(view, kind="stable")
    back = np.argsort(order, kind="stable")
    relaxed = admm.solve(affinity[np.ix_(order, order)], view[order], alpha=alpha)
    P = relaxed.P[np.ix_(back, back)]
    return replace(
        _matching(round_to_people(P, view), affinity, alpha),
        P=P,
        iterations=relaxed.iterations,
        residuals=relaxed.residuals,
        converged=relaxed.converged,
    )


def _matching(labels: NDArray[np.int64], affinity: NDArray[np.float64], alpha: float) -> Matching:
    return Matching(labels=labels, objective=objective(labels, affinity, alpha=alpha))


def objective(labels: NDArray[np.int64], affinity: NDArray[np.float64], *, alpha: float = 0.5) -> float:
    """``<alpha E - A, P>`` of a grouping, summed over unordered pairs: what every method minimises.

    The nuclear norm of a consistent P is m whatever the grouping, so the paper's second term is left out.
    """
    together = (labels[:, None] == labels[None, :]) & (labels[:, None] >= 0)
    return float(np.triu(together * (alpha - affinity), k=1).sum())
