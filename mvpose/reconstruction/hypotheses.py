"""Where anybody's joints can be, whosever the keypoints are: the state space of 3DPS without matching.

Every pair of keypoints of one joint in two views proposes a state where their rays meet. A keypoint vouches for a
state if, were the joint there, the keypoint would sooner be right than wrong: if its responsibility
(:mod:`mvpose.reconstruction.likelihood`) exceeds 1/2. Where the rays of two people meet by chance two views vouch;
where a joint really is most of them do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mvpose.arrays import Floats, Integers
from mvpose.rays import Rays
from mvpose.reconstruction.bone_length_prior import bone_lengths
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.triangulation import pair_point
from mvpose.skeleton import Skeleton


class Hypotheses(NamedTuple):
    """The states of all joints, S in all, what vouches for them and which are a bone apart.

    Attributes:
        start: first state of each joint, and S, (J + 1,).
        points: (S, 3), metres.
        voucher_start: first voucher of each state, and their number, (S + 1,).
        voucher: detections whose keypoints vouch, in the order of their views.
        evidence: log-likelihood of each of these keypoints with the joint there, less that without.
        link_start: first link of each state, and their number, (S + 1,).
        link: states of the parent joint that are a bone away.
        cost: what the prior takes off for that bone's length.
    """

    start: Integers
    points: Floats
    voucher_start: Integers
    voucher: Integers
    evidence: Floats
    link_start: Integers
    link: Integers
    cost: Floats


def hypothesize(
    rays: Rays, skeleton: Skeleton, *, noise: Noise, agreement: float, reach: float, most: int
) -> Hypotheses:
    """States of everybody's joints.

    Args:
        rays: m detections, in the order of their views.
        skeleton: their J joints.
        noise: the error model of keypoints.
        agreement: two rays meet if they pass each other within this many standard deviations, before both cameras.
        reach: greatest misfit of a bone, in standard deviations of its length and of the states at its ends.
        most: states that a keypoint can propose, the likeliest ones; those within a standard deviation are one.
    """
    sigmas, joints = noise.sigmas(skeleton), range(len(skeleton))
    seen = [np.flatnonzero(rays.weights[:, j] > noise.floor) for j in joints]  # others can vouch for nothing
    sights = [_sights(rays, j, seen[j], noise) for j in joints]
    points = [_propose(rays.view[seen[j]], sights[j], sigmas[j], agreement, most) for j in joints]
    vouchers = [_vouch(sights[j], points[j], sigmas[j]) for j in joints]
    start = np.cumsum([0, *map(len, points)])
    length, deviation = bone_lengths(skeleton)
    parents = np.array(skeleton.parents, np.int64)
    # The likeliest of several pairs is about as good as the mean of four keypoints.
    spread = np.sqrt(deviation**2 + (sigmas**2 + sigmas[parents] ** 2) / 4)
    return Hypotheses(
        start,
        np.concatenate(points),
        np.cumsum(np.concatenate([[0], *(count for count, _, _ in vouchers)])),
        np.concatenate([seen[j][which] for j, (_, which, _) in enumerate(vouchers)]),
        np.concatenate([evidence for _, _, evidence in vouchers]),
        *_link(start, np.concatenate(points), parents, length, spread, reach),
    )


def _sights(rays: Rays, joint: int, seen: Integers, noise: Noise) -> Floats:
    """The rays of one joint, a row each: origin, direction, score, score over floor, pixel angle squared, and a bound.

    At more than that many variances, squared distance from the ray, the keypoint does not vouch.
    """
    score = rays.weights[seen, joint]
    odds, pixel = score / noise.floor, (noise.pixels * rays.pixel[seen]) ** 2
    return np.column_stack([rays.origins[seen], rays.directions[seen, joint], score, odds, pixel, 2 * np.log(odds)])


def _propose(view: Integers, sights: Floats, sigma: float, agreement: float, most: int) -> Floats:
    """States of one joint, (S, 3): where rays of two views meet, the likeliest ones of each keypoint, all distinct."""
    points, ends, likelihood = _meetings(view, sights, sigma, agreement)
    return points[_distinct(points, ends, np.argsort(-likelihood, kind="stable"), len(view), sigma, most)]


@njit(cache=True)
def _meetings(view, sights, sigma, agreement):
    """Where pairs of rays of different views meet, (N, 3), which rays these are, (N, 2), and log-likelihoods, (N,)."""
    n = len(view)
    points, likelihood = np.empty((n * (n - 1) // 2, 3)), np.empty(n * (n - 1) // 2)
    ends = np.empty((len(points), 2), np.int64)
    pairs = 0
    for a in range(n):
        for b in range(a + 1, n):
            if view[a] == view[b] or not pair_point(
                sights[a, :3], sights[a, 3:6], sights[a, 6], sights[b, :3], sights[b, 3:6], sights[b, 6], points[pairs]
            ):
                continue
            # Across both rays the errors add up to what parts them.
            near, far = _across(points, pairs, sights, a, sigma), _across(points, pairs, sights, b, sigma)
            gap = np.sqrt(near[0]) + np.sqrt(far[0])
            if gap * gap > agreement * agreement * (near[1] + far[1]):
                continue
            ends[pairs, 0], ends[pairs, 1] = a, b
            total, best = 0.0, 0.0
            for k in range(n):
                if k > 0 and view[k] != view[k - 1]:
                    total += np.log1p(best)
                    best = 0.0
                best = max(best, _odds(points, pairs, sights, k, sigma))
            likelihood[pairs] = total + np.log1p(best)
            pairs += 1
    return points[:pairs], ends[:pairs], likelihood[:pairs]


@njit(cache=True)
def _distinct(points, ends, order, rays, sigma, most):
    """Indices of points to keep, in this order: none within sigma of one before, and so many of each ray."""
    kept, count, states = np.empty(len(points), np.int64), np.zeros(rays, np.int64), 0
    for k in order:
        a, b = ends[k, 0], ends[k, 1]
        new = count[a] < most and count[b] < most
        for s in range(states):
            if not new:
                break
            x, y = points[k, 0] - points[kept[s], 0], points[k, 1] - points[kept[s], 1]
            z = points[k, 2] - points[kept[s], 2]
            new = x * x + y * y + z * z > sigma * sigma
        if new:
            kept[states] = k
            states += 1
            count[a] += 1
            count[b] += 1
    return kept[:states]


@njit(cache=True)
def _across(points, s, sights, k, sigma):
    """Squared distance of a point from a ray and its variance, m^2, and how far along the ray the point is, metres."""
    x, y, z = points[s, 0] - sights[k, 0], points[s, 1] - sights[k, 1], points[s, 2] - sights[k, 2]
    along = x * sights[k, 3] + y * sights[k, 4] + z * sights[k, 5]
    variance = (sigma * sigma + sights[k, 8] * along * along) / (sights[k, 6] * sights[k, 6])
    return max(x * x + y * y + z * z - along * along, 0.0), variance, along


@njit(cache=True)
def _odds(points, s, sights, k, sigma):
    """How many times likelier a keypoint is with the joint at the point than without; 0 where it does not vouch."""
    e2, variance, along = _across(points, s, sights, k, sigma)
    return sights[k, 7] * np.exp(-0.5 * e2 / variance) if along > 0.0 and e2 < sights[k, 9] * variance else 0.0


@njit(cache=True)
def _vouch(sights, points, sigma):
    """How many rays vouch for each state of one joint, which ones, and the evidence that each adds."""
    count = np.zeros(len(points), np.int64)
    for s in range(len(points)):
        for k in range(len(sights)):
            count[s] += _odds(points, s, sights, k, sigma) > 0.0
    which, evidence = np.empty(count.sum(), np.int64), np.empty(count.sum())
    filled = 0
    for s in range(len(points)):
        for k in range(len(sights)):
            odds = _odds(points, s, sights, k, sigma)
            if odds > 0.0:
                which[filled], evidence[filled] = k, np.log1p(odds)
                filled += 1
    return count, which, evidence


@njit(cache=True)
def _link(start, points, parents, length, deviation, reach):
    """The links and costs of :class:`Hypotheses`. A bone of unknown length (infinite deviation) links nothing."""
    begin = np.zeros(len(points) + 1, np.int64)
    link, cost = np.empty(0, np.int64), np.empty(0)
    for filling in (False, True):
        if filling:
            link, cost = np.empty(begin[-1], np.int64), np.empty(begin[-1])
        count = 0
        for joint in range(len(parents)):
            parent = parents[joint]
            known = parent >= 0 and deviation[joint] < np.inf
            longest = length[joint] + reach * deviation[joint]
            shortest = max(length[joint] - reach * deviation[joint], 0.0)
            for s in range(start[joint], start[joint + 1]):
                for other in range(start[parent], start[parent + 1] if known else start[parent]):
                    x, y, z = (
                        points[s, 0] - points[other, 0],
                        points[s, 1] - points[other, 1],
                        points[s, 2] - points[other, 2],
                    )
                    d2 = x * x + y * y + z * z
                    if shortest * shortest <= d2 <= longest * longest:
                        if filling:
                            link[count] = other
                            cost[count] = 0.5 * ((np.sqrt(d2) - length[joint]) / deviation[joint]) ** 2
                        count += 1
                begin[s + 1] = count
    return begin, link, cost
