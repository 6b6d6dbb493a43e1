"""State space of the pictorial structure: positions that pairs of views propose for every joint (paper, section 3.3).

If a joint is right in two views, its position is among the proposals; the point on which all views agree is added
because it is more accurate where more views are right. A joint that only one view sees is proposed where its ray is a
bone length away from a neighbour.
"""

from __future__ import annotations

import numpy as np

from mvpose.kernels import njit
from mvpose.reconstruction.error_scale import person_scale
from mvpose.reconstruction.likelihood import log_likelihood
from mvpose.reconstruction.limb_direction_prior import direction_log_likelihood
from mvpose.reconstruction.triangulation import consensus, pair_point

_SINGLE_VIEW_STATES = 16  # room for two depths per neighbour
_NEARER = 1e-9  # likelihood per metre; decides ties only
_SAME = 0.25  # squared distance, in variances of the joint, below which refinement moves two proposals to one point


@njit(cache=True)
def propose_all(origins, directions, weights, pixel, sigmas, floor, most_pairs, most_states):
    """Propose positions for every joint of one person in n views.

    Returns:
        States (J, S, 3), metres, and their log-likelihoods (J, S), the likeliest first, with room for the states that
        :func:`propose_single_views` adds; the number of valid states per joint, (J,); and the ratio of this person's
        errors to those of the error model.
    """
    joints = len(weights)
    room = max(most_states, _SINGLE_VIEW_STATES)
    states, unary = np.empty((joints, room, 3)), np.empty((joints, room))
    count, responsibilities, misfit = np.zeros(joints, np.int64), np.zeros(joints), np.zeros(joints)
    points, quality, scratch = np.empty((most_pairs + 1, 3)), np.empty(most_pairs + 1), np.empty((8, 3))
    for j in range(joints):
        filled = _pairs(origins, directions[j], weights[j], sigmas[j], points, quality)
        if filled == 0:
            continue
        view = origins, directions[j], weights[j], pixel, sigmas[j], floor
        support, responsibilities[j], misfit[j] = consensus(points[filled], view, scratch)
        if support > 0.0:
            quality[filled] = np.inf
            filled += 1
        while count[j] < most_states:
            best = 0
            for s in range(1, filled):
                if quality[s] > quality[best]:
                    best = s
            if quality[best] < 0.0:
                break
            point = points[best]
            value = log_likelihood(point, origins, directions[j], weights[j], pixel, sigmas[j], floor)
            insert(states[j], unary[j], count[j], value, point[0], point[1], point[2])
            count[j] += 1
            # A proposal this close to a better one adds nothing.
            for s in range(filled):
                x, y, z = points[s, 0] - point[0], points[s, 1] - point[1], points[s, 2] - point[2]
                if x * x + y * y + z * z <= _SAME * sigmas[j] * sigmas[j]:
                    quality[s] = -1.0
    return states, unary, count, np.sqrt(person_scale(misfit, responsibilities))


@njit(cache=True, borrows=True)
def insert(states, unary, count, value, x, y, z):
    """Insert a point into the ``count`` states (S, 3) of a joint, which are ordered with the likeliest first."""
    place = count
    while place > 0 and unary[place - 1] < value:
        unary[place] = unary[place - 1]
        for r in range(3):
            states[place, r] = states[place - 1, r]
        place -= 1
    unary[place] = value
    states[place, 0], states[place, 1], states[place, 2] = x, y, z


@njit(cache=True)
def _pairs(origins, directions, weights, sigma, points, quality):
    """Write the points of the best pairs of views, up to the last slot, which stays free; return their number."""
    n, modes = weights.shape
    most, filled, worst = len(points) - 1, 0, 0
    crowded = n * (n - 1) // 2 * modes * modes > most
    point = np.empty(3)
    for first in range(n):
        for second in range(first + 1, n):
            for mode in range(modes):
                for other in range(modes):
                    value = pair_point(
                        origins[first], directions[first, mode], weights[first, mode],
                        origins[second], directions[second, other], weights[second, other], point,
                    )  # fmt: skip
                    if value <= 0.0:
                        continue
                    if crowded:  # prefer pairs that agree
                        value *= _agreement(point, origins, directions, first, mode, second, other, sigma)
                    slot = filled
                    if filled < most:
                        filled += 1
                    elif value > quality[worst]:
                        slot = worst
                    else:
                        continue
                    quality[slot] = value
                    for r in range(3):
                        points[slot, r] = point[r]
                    if filled == most:
                        worst = 0
                        for s in range(1, most):
                            if quality[s] < quality[worst]:
                                worst = s
    return filled


@njit(cache=True, borrows=True)
def _agreement(point, origins, directions, first, mode, second, other, sigma):
    """Return the relative likelihood, at most 1, of the distances of two rays from their common point."""
    e2, a, b = 0.0, 0.0, 0.0
    for r in range(3):
        a += (point[r] - origins[first, r]) * directions[first, mode, r]
        b += (point[r] - origins[second, r]) * directions[second, other, r]
    for r in range(3):
        e2 += (point[r] - origins[first, r] - a * directions[first, mode, r]) ** 2
        e2 += (point[r] - origins[second, r] - b * directions[second, other, r]) ** 2
    return np.exp(-0.5 * e2 / (sigma * sigma))


@njit(cache=True)
def propose_single_views(
    states,
    unary,
    count,
    origins,
    directions,
    weights,
    floor,
    graph,
    length,
    precision,
    concentrations,
    trunk,
):
    """Add, in place, proposals for joints that a single view sees: where the ray is a bone length from a neighbour.

    Such a joint has no pair of views, but its ray is known, and the bone length leaves two depths on it. The prior on
    limb directions (:mod:`mvpose.reconstruction.limb_direction_prior`) ranks the two. Of equally likely ones the
    nearest to the camera comes first, because a body hides its far side. Joints placed in one round serve their
    neighbours in the next.
    """
    joints, n, _ = weights.shape
    only = np.empty(joints, np.int64)
    for j in range(joints):
        views, only[j] = 0, -1
        for v in range(n):
            if weights[j, v, 0] > 0.0:
                views, only[j] = views + 1, v
        if views != 1 or count[j] > 0:
            only[j] = -1
    placed, point = np.empty(joints, np.int64), np.empty(3)
    for j in range(joints):
        placed[j] = count[j]
    while True:
        any_placed = False
        for j in range(joints):
            if only[j] < 0 or placed[j] > 0:
                continue
            v = only[j]
            for slot in range(graph.neighbours.shape[1]):
                other, bone = graph.neighbours[j, slot], graph.bones[j, slot]
                if other < 0 or count[other] == 0 or precision[bone] == 0.0:
                    continue
                along, square = 0.0, 0.0
                for r in range(3):
                    offset = states[other, 0, r] - origins[v, r]
                    along += offset * directions[j, v, 0, r]
                    square += offset * offset
                reach = np.sqrt(max(length[bone] ** 2 - (square - along * along), 0.0))
                for depth in (along - reach, along + reach):
                    if depth > 0.0 and placed[j] < states.shape[1]:
                        for r in range(3):
                            point[r] = origins[v, r] + depth * directions[j, v, 0, r]
                        value = np.log(weights[j, v, 0] + floor)
                        value += direction_log_likelihood(
                            point, states[other, 0], graph.children[bone] == j, concentrations[bone], trunk
                        )
                        value -= _NEARER * depth
                        insert(states[j], unary[j], placed[j], value, point[0], point[1], point[2])
                        placed[j] += 1
            any_placed = any_placed or placed[j] > 0
        for j in range(joints):
            count[j] = placed[j]
        if not any_placed:
            return
