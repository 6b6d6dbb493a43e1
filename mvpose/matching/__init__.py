"""Multi-way matching with cycle consistency (paper, section 3.2): detections of all views to people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array
from mvpose.estimate import Matching
from mvpose.matching import admm
from mvpose.matching.rounding import round_to_people

__all__ = ["Matcher", "match", "objective"]

Method = Literal["admm"]


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
        method: ``"admm"`` is Algorithm 1 of the paper.
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
    if method != "admm":
        raise ValueError(f"method must be 'admm', got {method!r}")
    order = np.argsort(view, kind="stable")
    back = np.argsort(order, kind="stable")
    relaxed = admm.solve(affinity[np.ix_(order, order)], view[order], alpha=alpha)
    P = relaxed.P[np.ix_(back, back)]
    labels = round_to_people(P, view)
    return Matching(
        labels=labels,
        P=P,
        iterations=relaxed.iterations,
        residuals=relaxed.residuals,
        objective=objective(labels, affinity, alpha=alpha),
        converged=relaxed.converged,
    )


def objective(labels: NDArray[np.int64], affinity: NDArray[np.float64], *, alpha: float = 0.5) -> float:
    """``<alpha E - A, P>`` of a grouping, summed over unordered pairs: what every method minimises.

    The nuclear norm of a consistent P is m whatever the grouping, so the paper's second term is left out.
    """
    together = (labels[:, None] == labels[None, :]) & (labels[:, None] >= 0)
    return float(np.triu(together * (alpha - affinity), k=1).sum())
