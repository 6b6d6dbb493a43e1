"""Multi-way matching as constrained correlation clustering: a fast heuristic for the integer problem.

The nuclear norm of a consistent P is m for every grouping. So in the limit of a large lambda the problem of the paper
is to partition the detections, with at most one per view in a part, so that the sum of affinity minus alpha within
parts is greatest. Greedy edge contraction (Keuper et al., "Efficient decomposition of image and mesh graphs by lifted
multicuts", ICCV 2015) joins the best two parts as long as the sum grows. Then one view after another is removed and its
detections are put back by the best assignment to the parts of the other views (a detection without gain becomes a part
alone), and parts are joined, until the sum no longer grows. With two views this is the Hungarian algorithm.

All steps take time m^2: a contraction costs one row, because parts store their best partner, and an assignment is
solved only for a view with a detection that would gain in another part.
"""

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.matching.assignment import best_assignment
from mvpose.matching.rounding import read_only
from mvpose.ordering import rank_views

_LEAST_GAIN = 1e-9  # a smaller gain is rounding error and could cause cycles
_MOST_ROUNDS = 50


def cluster(affinity: Floats, view: Integers, *, alpha: float = 0.5) -> Integers:
    """Partition the detections.

    Args:
        affinity: affinity matrix, (m, m), symmetric, 0 to 1.
        view: camera of each detection, (m,), in any order.
        alpha: least affinity of a match.

    Returns:
        Part of every detection, (m,): arbitrary numbers below m, with at most one detection per view in a part.
    """
    order = np.argsort(view, kind="stable")  # the search visits views in the same order for any order of detections
    return _cluster(read_only(affinity, np.float64), read_only(view, np.int64), order, float(alpha))


def contract(affinity: Floats, view: Integers, *, alpha: float = 0.5) -> Integers:
    """Partition the detections by greedy contraction only, the first step of :func:`cluster`."""
    return _contract_pairs(read_only(affinity, np.float64), read_only(view, np.int64), float(alpha))


def join_by_gains(gains: Floats) -> Integers:
    """Partition n objects by greedy contraction: the two parts with the greatest sum of gains are joined first.

    Args:
        gains: gain of putting two objects into one part, (n, n), symmetric; -inf where they must be apart.

    Returns:
        Part of every object, (n,): arbitrary numbers below n.
    """
    return _contract(np.array(gains, np.float64))


@njit(cache=True)
def _cluster(affinity, view, order, alpha):
    """Partition the detections in an order by view, (m,); see :func:`cluster`."""
    m = len(order)
    rank, views = rank_views(view[order])
    ordered, result = np.empty((m, m)), np.empty(m, np.int64)
    for i in range(m):
        for j in range(m):
            ordered[i, j] = affinity[order[i], order[j]]
    gains = _pair_gains(ordered, alpha, rank)
    part = _contract(gains)
    parts, size, members, start = _member_gains(ordered, alpha, rank, views, part, gains)
    for _ in range(_MOST_ROUNDS):
        parts = _reassign_views(ordered, alpha, rank, members, start, part, parts, size, gains)
        if not _join_parts(rank, views, part, parts, size, gains):
            break
    for i in range(m):
        result[order[i]] = part[i]
    return result


@njit(cache=True)
def _contract_pairs(affinity, view, alpha):
    """Partition the detections; see :func:`contract`."""
    rank, _ = rank_views(view)
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
    """Join the two parts with the greatest positive gain until there are none; return the final part of each, (n,).

    ``gain`` (n, n) is symmetric, with -inf where two parts must not be joined, and is overwritten. Only the row of the
    part that grows is updated, so the gain of two parts is found in the row of the one that grew last. Each part stores
    its best partner and their gain. When a join removes the partner or lowers the gain, the stored gain is still an
    upper bound, and a new partner is searched for only when this bound is the greatest of all.
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
    """Overwrite ``gains`` (m, m): row i, column p is the gain of detection i with the members of other views in part p.

    Parts are renumbered 0, 1, ... in place; there are never more than m.

    Returns:
        Number of parts, size of each part, detections sorted by view, and start of each view in that order.
    """
    m = len(part)
    size, number, parts = np.zeros(m, np.int64), np.empty(m, np.int64), 0
    for i in range(m):
        if part[i] == i:  # the number of a part is the index of one of its members
            number[i] = parts
            parts += 1
    for i in range(m):
        part[i] = number[part[i]]
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
def _reassign_views(affinity, alpha, rank, order, start, part, parts, size, gains):
    """Reassign view by view until no view changes in a full turn; return the number of parts."""
    views, unchanged, r = len(start) - 1, 0, 0
    for _ in range(_MOST_ROUNDS * views):
        if unchanged == views:
            break
        detections = order[start[r] : start[r + 1]]
        unchanged += 1
        if _any_gains_by_move(detections, part, parts, gains):
            best_part, gained = _best_parts(detections, part, parts, gains)
            if gained > _LEAST_GAIN:
                unchanged = 0
                for a in range(len(detections)):
                    parts = _move(detections[a], best_part[a], affinity, alpha, rank, part, parts, size, gains)
        r = r + 1 if r + 1 < views else 0
    return parts


@njit(cache=True)
def _any_gains_by_move(detections, part, parts, gains):
    """Return whether a detection would gain in another part or alone; if not, the assignment already is the best."""
    for i in detections:
        current_gain = gains[i, part[i]] + _LEAST_GAIN
        if current_gain < 0.0:
            return True
        for p in range(parts):
            if gains[i, p] > current_gain:
                return True
    return False


@njit(cache=True)
def _best_parts(detections, part, parts, gains):
    """Return the best part for each detection of one view, -1 for alone, and the gain over the current assignment."""
    choices, count = np.empty(parts, np.int64), 0
    for p in range(parts):
        for i in detections:
            if gains[i, p] > 0.0:
                choices[count] = p
                count += 1
                break
    value = np.empty((len(detections), count))
    gained = 0.0
    for a in range(len(detections)):
        gained -= gains[detections[a], part[detections[a]]]
        for b in range(count):
            value[a, b] = gains[detections[a], choices[b]]
    best_part = best_assignment(value)
    for a in range(len(detections)):
        if best_part[a] >= 0:
            gained += value[a, best_part[a]]
            best_part[a] = choices[best_part[a]]
    return best_part, gained


@njit(cache=True)
def _move(i, to, affinity, alpha, rank, part, parts, size, gains):
    """Move detection i to part ``to``, or to a part alone if -1; return the number of parts, including empty ones."""
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
    """Join whole parts as long as the sum grows; return whether any were joined."""
    seen, between = np.zeros((parts, views), np.bool_), np.zeros((parts, parts))
    for i in range(len(part)):
        seen[part[i], rank[i]] = True
    for i in range(len(part)):
        for p in range(parts):
            between[part[i], p] += -np.inf if seen[p, rank[i]] else gains[i, p]
    number = _contract(between)
    joined = False
    for p in range(parts):
        if number[p] != p:
            joined = True
            for i in range(len(part)):
                gains[i, number[p]] += gains[i, p]
                gains[i, p] = 0.0
            size[number[p]] += size[p]
            size[p] = 0
    for i in range(len(part)):
        part[i] = number[part[i]]
    return joined
