"""Each pair of views by itself: the baseline without cycle consistency (paper, section 3.2, figure 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment


def assign(affinity: NDArray[np.float64], view: NDArray[np.int64], *, alpha: float = 0.5) -> NDArray[np.float64]:
    """Match every pair of views by the Hungarian algorithm.

    Args:
        affinity: (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        alpha: pairs with less affinity than this are not matched.

    Returns:
        Affinities of the matched pairs and 0 elsewhere, (m, m), symmetric. Each block is a partial permutation; all
        together need not be cycle-consistent.
    """
    result = np.zeros_like(affinity)
    views = np.unique(view)
    for a, first in enumerate(views):
        for second in views[a + 1 :]:
            rows, columns = np.flatnonzero(view == first), np.flatnonzero(view == second)
            gain = np.maximum(affinity[np.ix_(rows, columns)] - alpha, 0.0)
            i, j = linear_sum_assignment(gain, maximize=True)
            matched = gain[i, j] > 0
            i, j = rows[i[matched]], columns[j[matched]]
            result[i, j] = result[j, i] = affinity[i, j]
    return result
