"""3D pictorial structures on the proposals of one matched person (paper, section 3.3).

The posterior of a pose is the product of every joint's likelihood in all views and of a Gaussian on every bone
length. Its logarithm is a sum over the bones, which form a tree or, with the mirror images of bones
(:mod:`mvpose.reconstruction.bone_graph`), nearly so. So max-product (here max-sum) finds the best combination of
proposals exactly, in time linear in the number of bones and quadratic in the number of proposals per joint, cubic for a
joint that both sides hold. The directions of bones join them where a single view sees an end of a bone
(:mod:`mvpose.reconstruction.limb_direction_prior`): lengths alone leave its depth open.

Pairs of views propose the positions. If a joint is right in two views, its position is among them; the point on which
all views agree is added because it is more accurate where more views are right. A joint that only one view sees is
proposed where its ray is a bone length away from a neighbour. Where there are heat maps, proposals and refinement use
Gaussians at their modes (:mod:`mvpose.reconstruction.likelihood`); the maps themselves decide which proposal is the
likeliest.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.heatmaps import height
from mvpose.kernels import njit
from mvpose.lens import distort
from mvpose.rays import Rays
from mvpose.reconstruction.bone_graph import BoneGraph, bone_graph
from mvpose.reconstruction.bone_length_prior import personal_prior, published_bones
from mvpose.reconstruction.error_scale import person_scale
from mvpose.reconstruction.inference import max_product
from mvpose.reconstruction.likelihood import Noise, log_likelihood
from mvpose.reconstruction.limb_direction_prior import LimbDirections, body_axes, limb_directions, pull_bones, set_left
from mvpose.reconstruction.poses import Poses, clear, empty_poses, gather
from mvpose.reconstruction.refinement import climb, fit_scale, write_uncertainty
from mvpose.reconstruction.triangulation import consensus, pair_point
from mvpose.skeleton import Skeleton

_SINGLE_VIEW_STATES = 32  # room for two depths per position of each neighbour
_BEARINGS = 8  # tried for a body whose left and right are unknown
_BRANCHES = 8  # positions of a neighbour, itself seen by a single view, that propose depths
_NEARER = 1e-9  # likelihood per metre; decides ties only
_SAME = 0.25  # squared distance, in variances of the joint, below which refinement moves two proposals to one point


class _ModeRays(NamedTuple):
    """Viewing rays of the K modes of every keypoint of m detections."""

    origins: Floats
    """Optical centres, (m, 3), metres."""
    directions: Floats
    """Unit vectors, (m, J, K, 3)."""
    weights: Floats
    """Scores, (m, J, K); 0 for a missing keypoint."""
    pixel: Floats
    """Least angle of an error, (m,), radians."""


class _BodyPrior(NamedTuple):
    """What is known of every body on a skeleton of B bones."""

    graph: BoneGraph
    """The bones."""
    length: Floats
    """Their mean lengths, (B,), metres."""
    definition: Floats
    """Standard deviation of their lengths by definition."""
    limbs: LimbDirections
    """Their directions."""


@dataclass(frozen=True)
class PictorialStructure:
    """Reconstruction by 3DPS: proposals, max-product, then local refinement of the best pose.

    The likelihood comes from the heat maps of the detections where they carry any, else from a Gaussian around each
    keypoint.

    A joint that only one view sees is placed on its ray by the prior, with the resulting covariance; a joint that no
    view sees is missing.

    Raises:
        ValueError: ``most_pairs`` or ``most_states`` below 1.
    """

    noise: Noise = Noise()
    """Error model of keypoints."""
    personal: bool = True
    """Whether to scale the bone-length prior to the person's stature, estimated from the well-seen bones."""
    most_pairs: int = 64
    """Greatest number of pairs of views that propose positions for a joint; pairs that agree and meet at wide angles
    come first. The limit matters from 12 views on."""
    most_states: int = 32
    """Number of proposals kept for a joint, the likeliest ones."""

    def __post_init__(self) -> None:
        for name in ("most_pairs", "most_states"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} of the pictorial structure must be at least 1, got {getattr(self, name)}")

    def __call__(self, rays: Rays, labels: NDArray[np.int64], skeleton: Skeleton) -> Poses:
        """Return the joints of all people; labels (m,) count from 0, -1 for a detection of no person."""
        length, definition = published_bones(skeleton)
        modes = rays.modes
        maps = None if modes is None else (modes.values, modes.row, modes.grid, modes.cameras)
        views = _ModeRays(
            rays.origins,
            rays.directions[:, :, None] if modes is None else modes.directions,
            rays.weights[:, :, None] if modes is None else modes.weights,
            self.noise.pixels * rays.pixel,
        )
        body = _BodyPrior(bone_graph(skeleton), length, definition, limb_directions(skeleton))
        limits = self.personal, self.most_pairs, self.most_states
        poses = _structures(labels, views, maps, self.noise.sigmas(skeleton), self.noise.floor, body, limits)
        return Poses(*poses)


@njit(cache=True)
def _structures(labels, views, maps, sigmas, floor, body, limits):
    graph, length, definition, limbs = body
    personal, most_pairs, most_states = limits
    poses, pull = empty_poses(labels, len(sigmas)), np.zeros((len(length), 3))
    for person in range(len(poses[0])):
        joints, scores, covariance, freedom = poses[0][person], poses[1][person], poses[2][person], poses[3][person]
        clear(joints, scores, covariance, freedom)
        own = gather(labels, person, views.origins, views.directions, views.weights, views.pixel)
        centers, rays, scores_2d, angles = own
        states, unary, count, scale = propose_all(
            centers, rays, scores_2d, angles, sigmas, floor, most_pairs, most_states
        )  # fmt: skip
        if maps is not None:
            rescore(states, unary, count, labels, person, scores_2d, maps, floor)
        lengths, precision = personal_prior(states, count, scores_2d, sigmas, graph, length, definition, personal)
        seen_twice = count.copy()
        pulled = propose_single_views(states, unary, count, own, floor, graph, lengths, precision)
        pull[:] = 0.0
        if pulled.any():
            bones = graph, lengths, precision
            chosen = _choose_bent(states, unary, count, seen_twice, centers, bones, limbs, pulled, pull)
        else:
            chosen, _ = max_product(states, unary, count, graph, lengths, precision, pull)
        deviations = np.empty(len(sigmas))
        for j in range(len(sigmas)):
            deviations[j] = scale * sigmas[j]
            if count[j] > 0:
                for r in range(3):
                    joints[j, r] = states[j, chosen[j], r]
        climb(joints, centers, rays, scores_2d, angles, deviations, floor, graph, lengths, precision)
        # The prior is weakened where the keypoints agree to a pixel, so that it does not move joints by millimetres
        # (empirical Bayes).
        weakened = precision * fit_scale(joints, centers, rays, scores_2d, angles, deviations, floor)
        climb(joints, centers, rays, scores_2d, angles, deviations, floor, graph, lengths, weakened)
        pose = joints, scores, covariance, freedom
        write_uncertainty(pose, own, sigmas, deviations, floor, graph, precision, pull)
    return poses


@njit(cache=True)
def _choose_bent(states, unary, count, seen_twice, centers, bones, limbs, pulled, pull):
    """Choose the states of a body of which a single view sees some joints; write the pull of its bones, (B, 3).

    Axes of the body that the joints of several views do not give are searched: bearings around the trunk, as seen from
    the cameras, of which the one with the most probable pose counts.
    """
    graph, length, precision = bones
    axes, chosen, trial = np.zeros((3, 3)), np.zeros(len(count), np.int64), np.zeros_like(pull)
    body_axes(states, chosen, seen_twice, limbs, axes)
    if not axes[2].any():
        chosen, _ = max_product(states, unary, count, graph, length, precision, pull)
        body_axes(states, chosen, count, limbs, axes)
        axes[:2] = 0.0
    if axes[0].any() or not axes[2].any():
        pull_bones(axes, limbs, pulled, pull)
        return max_product(states, unary, count, graph, length, precision, pull)[0]
    towards, best = np.zeros(3), -np.inf
    for j in range(len(count)):
        if count[j] > 0:
            for v in range(len(centers)):
                for r in range(3):
                    towards[r] += centers[v, r] - states[j, chosen[j], r]
    set_left(axes, towards)
    ahead, aside = axes[0].copy(), axes[1].copy()
    for k in range(_BEARINGS):
        angle = 2.0 * np.pi * k / _BEARINGS
        set_left(axes, np.cos(angle) * ahead + np.sin(angle) * aside)
        pull_bones(axes, limbs, pulled, trial)
        candidate, value = max_product(states, unary, count, graph, length, precision, trial)
        if value > best:
            best, chosen = value, candidate
            pull[:] = trial
    body_axes(states, chosen, count, limbs, axes)
    pull_bones(axes, limbs, pulled, pull)
    return max_product(states, unary, count, graph, length, precision, pull)[0]


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
def propose_single_views(states, unary, count, views, floor, graph, length, precision):
    """Add, in place, proposals for joints that a single view sees: where the ray is a bone length from a neighbour.

    Such a joint has no pair of views, but its ray is known, and the bone length leaves two depths on it, for each
    position of the neighbour. All are proposed, because the bones that follow may exclude the one that looks best: the
    lengths and directions (:mod:`mvpose.reconstruction.limb_direction_prior`) of all bones together decide. Of equally
    likely ones the nearest to the camera comes first, because a body hides its far side. Joints placed in one round
    serve their neighbours in the next.

    Returns:
        Whether a single view sees an end of each bone, (B,).
    """
    origins, directions, weights, _ = views
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
                for o in range(min(count[other], _BRANCHES) if only[other] >= 0 else 1):
                    along, square = 0.0, 0.0
                    for r in range(3):
                        offset = states[other, o, r] - origins[v, r]
                        along += offset * directions[j, v, 0, r]
                        square += offset * offset
                    reach = np.sqrt(max(length[bone] ** 2 - (square - along * along), 0.0))
                    for depth in (along - reach, along + reach):
                        last = min(placed[j], states.shape[1] - 1)
                        value = np.log(weights[j, v, 0] + floor) - _NEARER * depth
                        if depth <= 0.0 or (placed[j] > last and value <= unary[j, last]):
                            continue
                        for r in range(3):
                            point[r] = origins[v, r] + depth * directions[j, v, 0, r]
                        insert(states[j], unary[j], last, value, point[0], point[1], point[2])
                        placed[j] = last + 1
            any_placed = any_placed or placed[j] > 0
        for j in range(joints):
            count[j] = placed[j]
        if not any_placed:
            break
    of_single = np.zeros(len(length), np.bool_)
    for bone in range(len(length)):
        parent = graph.parents[bone]
        of_single[bone] = parent >= 0 and (only[parent] >= 0 or only[graph.children[bone]] >= 0)
    return of_single


@njit(cache=True)
def rescore(states, unary, count, labels, person, weights, maps, floor):
    """Score proposals by heat maps, in place, and sort them again, the likeliest first.

    The likelihood of a view is ``floor + height`` of its map at the projection (sub-pixel); the floor models a joint
    that the detector missed.

    Args:
        states: proposals, (J, S, 3), metres.
        unary: output, log-likelihood of each proposal, (J, S).
        count: number of valid proposals per joint, (J,).
        labels: person of each detection, (m,).
        person: label of the person to whom the proposals belong.
        weights: heights of the modes of the person's n detections, (J, n, K).
        maps: values (M, J, h, w), row (m,), grid (m, 4) and cameras (m, 22) of :class:`mvpose.rays.Modes`.
        floor: likelihood of a joint at any place.
    """
    values, row, grid, cameras = maps
    for j in range(len(count)):
        for s in range(count[j]):
            x, y, z = states[j, s, 0], states[j, s, 1], states[j, s, 2]
            total, v = 0.0, 0
            for d in range(len(labels)):
                if labels[d] == person:
                    if weights[j, v, 0] > 0.0:
                        total += np.log(floor + _height_at(x, y, z, row[d], j, values, grid[d], cameras[d]))
                    v += 1
            insert(states[j], unary[j], s, total, x, y, z)


@njit(cache=True)
def _height_at(x, y, z, detection, joint, values, grid, camera):
    """Return the height of one map where a world point projects; 0 behind the camera."""
    x, y, z = x - camera[14], y - camera[15], z - camera[16]
    depth = camera[11] * x + camera[12] * y + camera[13] * z
    if depth <= 0.0:
        return 0.0
    across = (camera[5] * x + camera[6] * y + camera[7] * z) / depth
    down = (camera[8] * x + camera[9] * y + camera[10] * z) / depth
    u, v = distort(across, down, camera[17:22])
    column = camera[0] * u + camera[1] * v + camera[2]
    row = camera[3] * v + camera[4]
    return height(values, detection, joint, (column - grid[0]) / grid[2], (row - grid[1]) / grid[3])
