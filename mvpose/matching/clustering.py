"""Multi-way matching as constrained correlation clustering: the integer problem itself, fast.

Where P is consistent its nuclear norm is m whatever the grouping, so in the limit of a large lambda the paper's problem
is to partition the detections, at most one of a view in a part, so that the affinities less alpha within parts sum to
the most. Greedy edge contraction (Keuper et al., "Efficient decomposition of image and mesh graphs by lifted
multicuts", ICCV 2015) joins the best two parts while that gains. Then one view after another is taken out and put back
by the best assignment of its detections to the parts of the others (a detection that gains nowhere is split off), and
parts are joined, until nothing gains; with two views this is the Hungarian algorithm.

Everything takes time m^2: a contraction costs one row, because parts remember their best partner, and an assignment is
solved only for a view that has a detection which would rather be elsewhere.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.matching.assignment import best_assignment
from mvpose.matching.rounding import rank_views, read_only

_LEAST_GAIN = 1e-9  # less is rounding, and could go round in circles
_MOST_ROUNDS = 50


def cluster(affinity: NDArray[np.float64], view: NDArray[np.int64], *, alpha: float = 0.5) -> NDArray[np.int64]:
    """Partition the detections.

    Args:
        affinity: (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        alpha: what a match must earn.

    Returns:
        A part for every detection, (m,): arbitrary names below m, at most one detection of a view in a part.
    """
    order = np.argsort(view, kind="stable")  # the search goes from view to view: in the same order however listed
    part = np.empty(len(order), np.int64)
    part[order] = _cluster(affinity[order[:, None], order], view[order], alpha)
    return part


def _cluster(affinity: NDArray[np.float64], view: NDArray[np.int64], alpha: float) -> NDArray[np.int64]:
    """As :func:`cluster`, of detections in the order of their views."""
    affinity, alpha = read_only(affinity, np.float64), float(alpha)
    rank, views = rank_views(read_only(view, np.int64))
    gains = _pair_gains(affinity, alpha, rank)
    part = _contract(gains)
    parts, size, order, start = _member_gains(affinity, alpha, rank, views, part, gains)
    for _ in range(_MOST_ROUNDS):
        parts = _put_back_views(affinity, alpha, rank, order, start, part, parts, size, gains)
        if not _join_parts(rank, views, part, parts, size, gains):
            break
    return part


def contract(affinity: NDArray[np.float64], view: NDArray[np.int64], *, alpha: float = 0.5) -> NDArray[np.int64]:
    """Partition the detections by greedy contraction alone: what :func:`cluster` starts from; see there."""
    affinity, alpha = read_only(affinity, np.float64), float(alpha)
    rank, _ = rank_views(read_only(view, np.int64))
    return _contract(_pair_gains(affinity, alpha, rank))


@njit(cache=True)
def _pair_gains(affinity, alpha, rank):
    m = len(rank)
    gain = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            gain[i, j] = affinity[i, j] - alpha if rank[i] != rank[j] else -np.inf
    return gain


@njit(cache=True)
def _contract(gain):
    """Join the two parts with the greatest positive gain until there are none; the part that each ends in, (n,).

    ``gain`` (n, n), symmetric, -inf where two may not be joined, is used up. Only the row of the part that grows is
    brought up to date, so the gain of two parts stands in the row of the one that grew last. Each part remembers its
    best partner and their gain. When a join takes the partner away or makes it worse, that gain is still an upper
    bound, and a new partner is sought only if the bound is the greatest of all.
    """
    n = len(gain)
    part, alive = np.arange(n), np.arange(n)
    partner, grown = np.full(n, -1, np.int64), np.zeros(n, np.int64)
    bound, stale = np.empty(n), np.zeros(n, np.bool_)
    for i in range(n):
        bound[i] = _LEAST_GAIN
        for j in range(n):
            if gain[i, j] > bound[i] and i != j:
                bound[i], partner[i] = gain[i, j], j
    left = n
    while left > 1:
        most, keep = _LEAST_GAIN, -1
        for a in range(left):
            if bound[alive[a]] > most:
                most, keep = bound[alive[a]], alive[a]
        if keep < 0:
            break
        gone = partner[keep]
        join = not stale[keep]
        bound[keep], partner[keep], stale[keep] = _LEAST_GAIN, -1, False
        place = -1
        for a in range(left):
            k = alive[a]
            if k == keep:
                continue
            g = gain[k, keep] if grown[k] > grown[keep] else gain[keep, k]
            if join:
                if k == gone:
                    place = a
                    continue
                g += gain[k, gone] if grown[k] > grown[gone] else gain[gone, k]
                gain[keep, k] = g
                if g >= bound[k] and g > _LEAST_GAIN:
                    bound[k], partner[k], stale[k] = g, keep, False
                elif partner[k] == keep or partner[k] == gone:
                    stale[k] = True
            if g > bound[keep]:
                bound[keep], partner[keep] = g, k
        if join:
            left -= 1
            grown[keep] = n - left
            part[gone] = keep
            alive[place] = alive[left]
    for i in range(n):
        while part[part[i]] != part[i]:
            part[i] = part[part[i]]
    return part


@njit(cache=True)
def _member_gains(affinity, alpha, rank, views, part, gains):
    """Overwrite ``gains`` (m, m): row i, column p is what detection i gains beside the members of other views in p.

    Parts are renamed 0, 1, ... in place; there are never more than detections.

    Returns:
        How many parts there are, the size of each, the detections view by view, and where each view's begin.
    """
    m = len(part)
    size, name, parts = np.zeros(m, np.int64), np.empty(m, np.int64), 0
    for i in range(m):
        if part[i] == i:  # a part goes by the name of one of its members
            name[i] = parts
            parts += 1
    for i in range(m):
        part[i] = name[part[i]]
        size[part[i]] += 1
    for i in range(m):
        for p in range(parts):
            gains[i, p] = 0.0
        for j in range(m):
            if rank[i] != rank[j]:
                gains[i, part[j]] += affinity[i, j] - alpha
    order, start, filled = np.empty(m, np.int64), np.zeros(views + 1, np.int64), 0
    for r in range(views):
        for i in range(m):
            if rank[i] == r:
                order[filled] = i
                filled += 1
        start[r + 1] = filled
    return parts, size, order, start


@njit(cache=True)
def _put_back_views(affinity, alpha, rank, order, start, part, parts, size, gains):
    """Put back view by view until every view in turn has stayed as it was; how many parts there are then."""
    views, quiet, r = len(start) - 1, 0, 0
    for _ in range(_MOST_ROUNDS * views):
        if quiet == views:
            break
        mine = order[start[r] : start[r + 1]]
        quiet += 1
        if _would_rather_move(mine, part, parts, gains):
            wanted, gained = _best_parts(mine, part, parts, gains)
            if gained > _LEAST_GAIN:
                quiet = 0
                for a in range(len(mine)):
                    parts = _move(mine[a], wanted[a], affinity, alpha, rank, part, parts, size, gains)
        r = r + 1 if r + 1 < views else 0
    return parts


@njit(cache=True)
def _would_rather_move(mine, part, parts, gains):
    """Whether a detection would gain more elsewhere or alone. If none would, the assignment is the best there is."""
    for i in mine:
        own = gains[i, part[i]] + _LEAST_GAIN
        if own < 0.0:
            return True
        for p in range(parts):
            if gains[i, p] > own:
                return True
    return False


@njit(cache=True)
def _best_parts(mine, part, parts, gains):
    """Best assignment of one view's detections to parts: the part of each, -1 for alone, and what that gains."""
    choices, count = np.empty(parts, np.int64), 0
    for p in range(parts):
        for i in mine:
            if gains[i, p] > 0.0:
                choices[count] = p
                count += 1
                break
    value = np.empty((len(mine), count))
    gained = 0.0
    for a in range(len(mine)):
        gained -= gains[mine[a], part[mine[a]]]
        for b in range(count):
            value[a, b] = gains[mine[a], choices[b]]
    wanted = best_assignment(value)
    for a in range(len(mine)):
        if wanted[a] >= 0:
            gained += value[a, wanted[a]]
            wanted[a] = choices[wanted[a]]
    return wanted, gained


@njit(cache=True)
def _move(i, to, affinity, alpha, rank, part, parts, size, gains):
    """Move detection i into part ``to``, or alone where that is -1; the number of parts, empty ones included."""
    if to == part[i] or (to < 0 and size[part[i]] == 1):
        return parts
    if to < 0:
        to = 0
        while to < parts and size[to] > 0:
            to += 1
        for j in range(len(part)):
            gains[j, to] = 0.0
        parts = max(parts, to + 1)
    for j in range(len(part)):
        if rank[j] != rank[i]:
            gain = affinity[i, j] - alpha
            gains[j, part[i]] -= gain
            gains[j, to] += gain
    size[part[i]] -= 1
    size[to] += 1
    part[i] = to
    return parts


@njit(cache=True)
def _join_parts(rank, views, part, parts, size, gains):
    """Contract whole parts while that gains; whether any were joined."""
    seen, between = np.zeros((parts, views), np.bool_), np.zeros((parts, parts))
    for i in range(len(part)):
        seen[part[i], rank[i]] = True
    for i in range(len(part)):
        for p in range(parts):
            between[part[i], p] += -np.inf if seen[p, rank[i]] else gains[i, p]
    name = _contract(between)
    joined = False
    for p in range(parts):
        if name[p] != p:
            joined = True
            for i in range(len(part)):
                gains[i, name[p]] += gains[i, p]
                gains[i, p] = 0.0
            size[name[p]] += size[p]
            size[p] = 0
    for i in range(len(part)):
        part[i] = name[part[i]]
    return joined
