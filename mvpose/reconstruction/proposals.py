"""The state space of the pictorial structure: points that pairs of views propose for every joint (paper, 3.3).

As long as a joint is right in two views, its position is among the proposals; the point that all views agree on adds
accuracy where more are right. A joint that one view alone sees is proposed where its ray is a bone's length from a
neighbour in the tree.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mvpose.reconstruction.error_scale import person_scale
from mvpose.reconstruction.likelihood import log_likelihood
from mvpose.reconstruction.limb_direction_prior import how_it_hangs
from mvpose.reconstruction.triangulation import consensus, pair_point

_SINGLE_VIEW_STATES = 16  # two depths from every neighbour
_SAME = 0.25  # of the joint's variance: squared distance under which refinement leads two proposals to one point


@njit(cache=True)
def propose_all(origins, directions, weights, pixel, sigmas, floor, most_pairs, most_states):
    """Propose for every joint of one person in n views.

    Returns:
        States (J, S, 3), metres, their log-likelihoods (J, S), the likeliest first; how many of the S are valid,
        (J,), with room for what :func:`propose_single_views` adds; and how much larger the errors of this person
        are than the model's.
    """
    joints = len(weights)
    room = max(most_states, _SINGLE_VIEW_STATES)
    states, unary = np.empty((joints, room, 3)), np.empty((joints, room))
    count, rights, misfit = np.zeros(joints, np.int64), np.zeros(joints), np.zeros(joints)
    points, quality, scratch = np.empty((most_pairs + 1, 3)), np.empty(most_pairs + 1), np.empty((8, 3))
    for j in range(joints):
        found = _pairs(origins, directions[j], weights[j], sigmas[j], points, quality)
        if found == 0:
            continue
        view = origins, directions[j], weights[j], pixel, sigmas[j], floor
        support, rights[j], misfit[j] = consensus(points[found], view, scratch)
        if support > 0.0:
            quality[found] = np.inf
            found += 1
        while count[j] < most_states:
            best = 0
            for s in range(1, found):
                if quality[s] > quality[best]:
                    best = s
            if quality[best] < 0.0:
                break
            point = points[best]
            value = log_likelihood(point, origins, directions[j], weights[j], pixel, sigmas[j], floor)
            insert(states[j], unary[j], count[j], value, point[0], point[1], point[2])
            count[j] += 1
            # What is this near adds nothing.
            for s in range(found):
                x, y, z = points[s, 0] - point[0], points[s, 1] - point[1], points[s, 2] - point[2]
                if x * x + y * y + z * z <= _SAME * sigmas[j] * sigmas[j]:
                    quality[s] = -1.0
    return states, unary, count, np.sqrt(person_scale(misfit, rights))


@njit(cache=True)
def insert(states, unary, count, value, x, y, z):
    """Put a point among the ``count`` states (S, 3) of a joint, the likeliest first."""
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
    """Write the points of the best pairs of views, all but the last place; how many there are."""
    n, modes = weights.shape
    most, found, worst = len(points) - 1, 0, 0
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
                    slot = found
                    if found < most:
                        found += 1
                    elif value > quality[worst]:
                        slot = worst
                    else:
                        continue
                    quality[slot] = value
                    for r in range(3):
                        points[slot, r] = point[r]
                    if found == most:
                        worst = 0
                        for s in range(1, most):
                            if quality[s] < quality[worst]:
                                worst = s
    return found


@njit(cache=True)
def _agreement(point, origins, directions, first, mode, second, other, sigma):
    """How likely the two rays' distances from their common point are, at most 1."""
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
    states, unary, count, origins, directions, weights, floor, neighbours, bones, length, precision, hang, down
):
    """Propose, in place, for joints that a single view sees: where its ray is a bone's length from a neighbour.

    Such a joint has no pair of views, but its direction is known and the prior knows the depth, up to which of two
    points it is: the one where the limb hangs down the trunk (:mod:`mvpose.reconstruction.limb_direction_prior`) as limbs do.
    The nearer comes first, so it wins a tie: a body hides its own far side. Placed joints serve their own neighbours
    in the next round.
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
        changed = False
        for j in range(joints):
            if only[j] < 0 or placed[j] > 0:
                continue
            v = only[j]
            for slot in range(neighbours.shape[1]):
                other, bone = neighbours[j, slot], bones[j, slot]
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
                        value += how_it_hangs(point, states[other, 0], bone == j, hang[bone], down)
                        insert(states[j], unary[j], placed[j], value, point[0], point[1], point[2])
                        placed[j] += 1
            changed = changed or placed[j] > 0
        for j in range(joints):
            count[j] = placed[j]
        if not changed:
            return
