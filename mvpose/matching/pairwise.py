"""Each pair of views by itself: the baseline without cycle consistency (paper, section 3.2, figure 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mvpose.matching.assignment import best_assignment


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
    rows_of = [np.flatnonzero(view == one) for one in np.unique(view)]
    for a, rows in enumerate(rows_of):
        for columns in rows_of[a + 1 :]:
            matched = best_assignment(affinity[rows[:, None], columns] - alpha)
            i, j = rows[matched >= 0], columns[matched[matched >= 0]]
            result[i, j] = result[j, i] = affinity[i, j]
    return result
