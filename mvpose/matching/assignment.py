"""Assignment problem as a numba kernel, and the baseline that matches each pair of views by it.

SciPy's solver cannot be called from numba, and one call of it costs more than all local moves of a frame.
"""

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit


@njit(cache=True)
def best_assignment(value):
    """Assign rows to different columns with the greatest sum of values; pairs without positive value stay unassigned.

    The method is shortest augmenting paths with prices (Jonker and Volgenant 1987; Crouse 2016). The cost of a pair is
    its negative value; one extra column of cost 0 per row takes rows that are better left unassigned. Rows whose best
    column is free take it at once, so only contested rows need a path.

    Args:
        value: value of each pair, (rows, columns), finite.

    Returns:
        Column of each row, -1 for none, (rows,).
    """
    rows, real = value.shape
    columns = real + rows
    row_price, column_price = np.zeros(rows), np.zeros(columns)
    column_of, row_of = np.full(rows, -1, np.int64), np.full(columns, -1, np.int64)
    for i in range(rows):
        best_value, favourite = 0.0, real + i
        for j in range(real):
            if value[i, j] > best_value:
                best_value, favourite = value[i, j], j
        row_price[i] = -best_value
        if row_of[favourite] < 0:
            row_of[favourite], column_of[i] = i, favourite
    distance, previous = np.empty(columns), np.empty(columns, np.int64)
    settled = np.empty(columns, np.bool_)
    for start in range(rows):
        if column_of[start] >= 0:
            continue
        for j in range(columns):
            distance[j], settled[j] = np.inf, False
        i, reach, end = start, 0.0, -1
        while end < 0:  # Dijkstra's algorithm from the free row to the nearest free column, over costs minus prices
            nearest, base = -1, reach - row_price[i]
            for j in range(columns):
                if settled[j]:
                    continue
                cost = -value[i, j] if j < real and value[i, j] > 0.0 else 0.0
                length = base + cost - column_price[j]
                if length < distance[j]:
                    distance[j], previous[j] = length, i
                if nearest < 0 or distance[j] < distance[nearest]:
                    nearest = j
            reach = distance[nearest]
            if row_of[nearest] < 0:
                end = nearest
            else:
                settled[nearest] = True
                i = row_of[nearest]
        row_price[start] += reach
        for j in range(columns):
            if settled[j]:
                row_price[row_of[j]] += reach - distance[j]
                column_price[j] -= reach - distance[j]
        while True:  # shift the assignments along the path
            i = previous[end]
            row_of[end] = i
            column_of[i], end = end, column_of[i]
            if i == start:
                break
    for i in range(rows):
        if column_of[i] >= real or value[i, column_of[i]] <= 0.0:
            column_of[i] = -1
    return column_of


def match_view_pairs(affinity: Floats, view: Integers, *, alpha: float = 0.5) -> Floats:
    """Match every pair of views separately: the baseline without cycle consistency (paper, section 3.2, figure 3).

    Args:
        affinity: affinity matrix, (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        alpha: least affinity of a match.

    Returns:
        Affinities of the matched pairs and 0 elsewhere, (m, m), symmetric. Each block is a partial permutation; all
        blocks together need not be cycle-consistent.
    """
    result = np.zeros_like(affinity)
    rows_of = [np.flatnonzero(view == one) for one in np.unique(view)]
    for a, rows in enumerate(rows_of):
        for columns in rows_of[a + 1 :]:
            matched = best_assignment(affinity[rows[:, None], columns] - alpha)
            i, j = rows[matched >= 0], columns[matched[matched >= 0]]
            result[i, j] = result[j, i] = affinity[i, j]
    return result
