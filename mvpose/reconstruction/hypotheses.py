"""State space of 3DPS without matching: possible joint positions of all people.

Every pair of keypoints of one joint in two views proposes a state where their rays meet. A keypoint supports a state
if it is more likely right than wrong given the joint there, that is, if its responsibility
(:mod:`mvpose.reconstruction.likelihood`) exceeds 1/2. Where the rays of two people meet by chance, two views support
the state; at a true joint position most views do.
"""

from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.bone_graph import mirror_images
from mvpose.reconstruction.bone_length_prior import bone_lengths
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.triangulation import pair_point
from mvpose.skeleton import Skeleton


class Hypotheses(NamedTuple):
    """States of all joints (S in total), and the keypoints that support them."""

    start: Integers
    """First state of each joint, and S, (J + 1,)."""
    points: Floats
    """Positions of the states, (S, 3), metres."""
    support_start: Integers
    """First supporting keypoint of each state, and their total number, (S + 1,)."""
    support: Integers
    """Detections whose keypoints support each state, in the order of their views."""
    evidence: Floats
    """Log-likelihood ratio of each supporting keypoint with the joint at the state against without it."""


class Links(NamedTuple):
    """Kinematic tree, and links between states at the distance of its bones."""

    parents: Integers
    """Parent of each joint, (J,), -1 for the root."""
    order: Integers
    """Joints from the root outwards, (J,)."""
    known: Bools
    """Whether the length of the bone from each joint to its parent has a prior, (J,)."""
    start: Integers
    """First link of each state, and their total number, (S + 1,)."""
    state: Integers
    """States of the parent joint at the distance of a bone."""
    cost: Floats
    """Negative log-prior of the bone length of each link."""


def hypothesize(rays: Rays, skeleton: Skeleton, *, noise: Noise, agreement: float, most: int) -> Hypotheses:
    """Return the states of the joints of all people.

    Args:
        rays: m detections, in the order of their views.
        skeleton: the J joints.
        noise: error model of keypoints.
        agreement: greatest distance between two rays that meet, in standard deviations; they must meet in front of
            both cameras.
        most: greatest number of states that a keypoint proposes, the likeliest ones; states within one standard
            deviation of each other are merged.
    """
    sigmas, joints = noise.sigmas(skeleton), range(len(skeleton))
    seen = [np.flatnonzero(rays.weights[:, j] > noise.floor) for j in joints]  # weaker keypoints cannot support a state
    rows = [_ray_rows(rays, j, seen[j], noise) for j in joints]
    points = [_propose(rays.view[seen[j]], rows[j], sigmas[j], agreement, most) for j in joints]
    supports = [_supporting_rays(rows[j], points[j], sigmas[j]) for j in joints]
    start = np.cumsum([0, *map(len, points)])
    return Hypotheses(
        start,
        np.concatenate(points),
        np.cumsum(np.concatenate([[0], *(count for count, _, _ in supports)])),
        np.concatenate([seen[j][which] for j, (_, which, _) in enumerate(supports)]),
        np.concatenate([evidence for _, _, evidence in supports]),
    )


def link(space: Hypotheses, skeleton: Skeleton, *, noise: Noise, reach: float) -> tuple[Links, ...]:
    """Link states along the bones of the tree and, if that is another one, of its mirror image.

    Args:
        space: states of all joints.
        skeleton: the J joints.
        noise: error model of keypoints.
        reach: greatest error of a bone length, in standard deviations of the length and of the states at its ends.
    """
    sigmas, mirror = noise.sigmas(skeleton), np.array(skeleton.mirror)
    length, deviation = (each[: len(skeleton)] for each in bone_lengths(skeleton))
    parents = np.array(skeleton.parents, np.int64)
    trees = [(parents, length, deviation)]
    if mirror_images(skeleton):
        image = np.where(parents >= 0, mirror[parents], -1)[mirror]
        trees.append((image, length[mirror], deviation[mirror]))
    return tuple(_tree_links(space, *tree, sigmas, reach) for tree in trees)


def _tree_links(
    space: Hypotheses, parents: Integers, length: Floats, deviation: Floats, sigmas: Floats, reach: float
) -> Links:
    order = np.flatnonzero(parents < 0).tolist()
    for joint in order:
        order += np.flatnonzero(parents == joint).tolist()
    # The likeliest of several pairs is about as accurate as the mean of four keypoints.
    spread = np.sqrt(deviation**2 + (sigmas**2 + sigmas[parents] ** 2) / 4)
    links = _link(space.start, space.points, parents, length, spread, reach)
    return Links(parents, np.array(order), np.isfinite(deviation), *links)


def _ray_rows(rays: Rays, joint: int, seen: Integers, noise: Noise) -> Floats:
    """Return the rays of one joint as rows: origin, direction, score, score over floor, squared pixel angle, bound.

    The bound is the squared distance from the ray, in variances, beyond which the keypoint does not support a state.
    """
    score = rays.weights[seen, joint]
    odds, pixel = score / noise.floor, (noise.pixels * rays.pixel[seen]) ** 2
    return np.column_stack([rays.origins[seen], rays.directions[seen, joint], score, odds, pixel, 2 * np.log(odds)])


def _propose(view: Integers, rows: Floats, sigma: float, agreement: float, most: int) -> Floats:
    """Return the states of one joint, (S, 3): the likeliest distinct points where rays of two views meet."""
    points, ends, likelihood = _meetings(view, rows, sigma, agreement)
    return points[_distinct(points, ends, np.argsort(-likelihood, kind="stable"), len(view), sigma, most)]


@njit(cache=True)
def _meetings(view, rows, sigma, agreement):
    """Return points where rays of two views meet, (N, 3), the two rays, (N, 2), and log-likelihoods, (N,)."""
    n = len(view)
    points, likelihood = np.empty((n * (n - 1) // 2, 3)), np.empty(n * (n - 1) // 2)
    ends = np.empty((len(points), 2), np.int64)
    columns, exponents = rows.T.copy(), np.empty(n)
    pairs = 0
    for a in range(n):
        for b in range(a + 1, n):
            if view[a] == view[b] or not pair_point(
                rows[a, :3], rows[a, 3:6], rows[a, 6], rows[b, :3], rows[b, 3:6], rows[b, 6], points[pairs]
            ):
                continue
            # The errors across both rays add up to the distance between the rays.
            near, far = _distance_to_ray(points, pairs, rows, a, sigma), _distance_to_ray(points, pairs, rows, b, sigma)
            gap = np.sqrt(near[0]) + np.sqrt(far[0])
            if gap * gap > agreement * agreement * (near[1] + far[1]):
                continue
            ends[pairs, 0], ends[pairs, 1] = a, b
            _exponents(points[pairs], columns, sigma, exponents)
            total, best, last = 0.0, 0.0, -1
            for k in range(n):
                if exponents[k] <= 0.0:
                    if view[k] != last:
                        total += np.log1p(best)
                        best, last = 0.0, view[k]
                    best = max(best, rows[k, 7] * np.exp(exponents[k]))
            likelihood[pairs] = total + np.log1p(best)
            pairs += 1
    return points[:pairs], ends[:pairs], likelihood[:pairs]


@njit(cache=True)
def _distinct(points, ends, order, rays, sigma, most):
    """Return indices of the points to keep: none within sigma of an earlier one, and at most ``most`` per ray."""
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
def _distance_to_ray(points, s, rows, k, sigma):
    """Return the squared distance of a point from a ray and its variance, m^2, and its depth along the ray, metres."""
    x, y, z = points[s, 0] - rows[k, 0], points[s, 1] - rows[k, 1], points[s, 2] - rows[k, 2]
    along = x * rows[k, 3] + y * rows[k, 4] + z * rows[k, 5]
    variance = (sigma * sigma + rows[k, 8] * along * along) / (rows[k, 6] * rows[k, 6])
    return max(x * x + y * y + z * z - along * along, 0.0), variance, along


@njit(cache=True, borrows=True)
def _exponents(point, columns, sigma, exponents):
    """Write the exponent of the likelihood of every keypoint with the joint at the point; 1 without support.

    Hardly any keypoint supports a point, so the test of all of them has no branches and vectorises; the exponential is
    for those that do. ``columns`` are the rows of :func:`_ray_rows`, transposed.
    """
    square = sigma * sigma
    for k in range(len(exponents)):
        x, y, z = point[0] - columns[0, k], point[1] - columns[1, k], point[2] - columns[2, k]
        along = x * columns[3, k] + y * columns[4, k] + z * columns[5, k]
        variance = (square + columns[8, k] * along * along) / (columns[6, k] * columns[6, k])
        e2 = max(x * x + y * y + z * z - along * along, 0.0)
        supports = (along > 0.0) & (e2 < columns[9, k] * variance)
        exponents[k] = -0.5 * e2 / variance if supports else 1.0


@njit(cache=True)
def _supporting_rays(rows, points, sigma):
    """Return the number of rays that support each state of one joint, the rays, and the evidence of each."""
    count, columns, exponents = np.zeros(len(points), np.int64), rows.T.copy(), np.empty(len(rows))
    for s in range(len(points)):
        _exponents(points[s], columns, sigma, exponents)
        for k in range(len(rows)):
            count[s] += exponents[k] <= 0.0
    which, evidence = np.empty(count.sum(), np.int64), np.empty(count.sum())
    filled = 0
    for s in range(len(points)):
        _exponents(points[s], columns, sigma, exponents)
        for k in range(len(rows)):
            if exponents[k] <= 0.0:
                which[filled], evidence[filled] = k, np.log1p(rows[k, 7] * np.exp(exponents[k]))
                filled += 1
    return count, which, evidence


@njit(cache=True)
def _link(start, points, parents, length, deviation, reach):
    """Return the last three fields of :class:`Links`; a bone of unknown length (infinite deviation) has no links."""
    link_start = np.zeros(len(points) + 1, np.int64)
    link, cost, columns = np.empty(0, np.int64), np.empty(0), points.T.copy()
    for filling in (False, True):
        if filling:
            link, cost = np.empty(link_start[-1], np.int64), np.empty(link_start[-1])
        count = 0
        for joint in range(len(parents)):
            parent = parents[joint]
            known = parent >= 0 and deviation[joint] < np.inf
            longest = length[joint] + reach * deviation[joint]
            shortest = max(length[joint] - reach * deviation[joint], 0.0)
            limits = shortest * shortest, longest * longest
            for s in range(start[joint], start[joint + 1]):
                if filling and link_start[s + 1] > count:
                    for other in range(start[parent], start[parent + 1]):
                        d2 = _squared_distance(columns, s, other)
                        if limits[0] <= d2 <= limits[1]:
                            link[count] = other
                            cost[count] = 0.5 * ((np.sqrt(d2) - length[joint]) / deviation[joint]) ** 2
                            count += 1
                elif not filling:
                    for other in range(start[parent], start[parent + 1] if known else start[parent]):  # vectorises
                        d2 = _squared_distance(columns, s, other)
                        count += (limits[0] <= d2) & (d2 <= limits[1])
                    link_start[s + 1] = count
    return link_start, link, cost


@njit(cache=True, borrows=True)
def _squared_distance(columns, s, other):
    x, y, z = columns[0, s] - columns[0, other], columns[1, s] - columns[1, other], columns[2, s] - columns[2, other]
    return x * x + y * y + z * z
