"""3D pictorial structures on the proposals of one matched person (paper, section 3.3).

The posterior of a pose is the product of every joint's likelihood in all views and of a Gaussian on every bone
length; its logarithm is a sum over a tree, so max-product (here max-sum) finds the best combination of proposals
exactly, in time linear in the bones and quadratic in the proposals of a joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from mvpose.rays import Rays
from mvpose.reconstruction.bones import bone_lengths
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.triangulation import Proposals, propose, refine
from mvpose.skeleton import Skeleton

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PictorialStructure:
    """Reconstruction by 3DPS: proposals, max-product, then a local refinement of the winner.

    Attributes:
        noise: the error model of keypoints.
        most_states: proposals kept for a joint, the most likely ones; many views have very many pairs.
    """

    noise: Noise = Noise()
    most_states: int = 64

    def __call__(self, rays: Rays, skeleton: Skeleton) -> tuple[Floats, Floats, Floats]:
        """Joints (J, 3), scores (J,) and covariances (J, 3, 3) of one person; NaN and score 0 where missing.

        A joint that one view alone sees is placed on its ray by the prior, with the covariance that this deserves;
        one that no view sees is missing.
        """
        length, deviation = bone_lengths(skeleton)
        proposals = _keep_likely(propose(rays, self.noise.sigmas(skeleton), self.noise), self.most_states)
        proposals = _add_single_views(proposals, rays, skeleton, self.noise, length=length, deviation=deviation)
        chosen = max_product(
            proposals.states,
            proposals.unary,
            proposals.count,
            parents=skeleton.parents,
            length=length,
            deviation=deviation,
        )
        return refine(rays, skeleton, proposals, chosen, self.noise, length=length, deviation=deviation)


def max_product(
    states: Floats,
    unary: Floats,
    count: NDArray[np.int64],
    *,
    parents: ArrayLike,
    length: Floats,
    deviation: Floats,
) -> NDArray[np.int64]:
    """The combination of states with the greatest sum of unaries and log-Gaussian bone lengths.

    Args:
        states: candidate positions, (J, S, 3), metres.
        unary: their log-likelihoods, (J, S).
        count: how many of the S are valid for each joint, (J,). A joint without any is passed over: its neighbours
            are not constrained by it.
        parents: the tree, (J,), -1 for the root.
        length: mean bone length to the parent, (J,), metres.
        deviation: its deviation, (J,), metres; infinite for no constraint.

    Returns:
        Index of the chosen state of every joint, (J,); 0 for a joint without states.
    """
    parents = np.asarray(parents, np.int64)
    return _max_product(states, unary, count, parents, _leaves_first(parents), length, 1.0 / deviation**2)


def _leaves_first(parents: NDArray[np.int64]) -> NDArray[np.int64]:
    depth = np.zeros(len(parents), np.int64)
    for joint in range(len(parents)):
        ancestor = parents[joint]
        while ancestor >= 0:
            depth[joint] += 1
            ancestor = parents[ancestor]
    return np.argsort(-depth, kind="stable")


def _keep_likely(proposals: Proposals, most: int) -> Proposals:
    if proposals.unary.shape[1] <= most:
        return proposals
    best = np.argsort(-proposals.unary, axis=1, kind="stable")[:, :most]
    return Proposals(
        states=np.take_along_axis(proposals.states, best[:, :, None], axis=1),
        unary=np.take_along_axis(proposals.unary, best, axis=1),
        count=np.minimum(proposals.count, most),
    )


def _add_single_views(
    proposals: Proposals, rays: Rays, skeleton: Skeleton, noise: Noise, *, length: Floats, deviation: Floats
) -> Proposals:
    """Propose for joints that a single view sees: where its ray is a bone's length from a neighbour in the tree.

    Such a joint has no pair of views, but its direction is known and the prior knows the depth, up to which of two
    points it is. The nearer comes first, so it wins a tie: a body hides its own far side. Placed joints serve their
    own neighbours in turn.
    """
    views = (rays.weights > 0).sum(axis=0)
    waiting = set(np.flatnonzero((proposals.count == 0) & (views == 1)).tolist())
    if not waiting:
        return proposals
    states = [list(proposals.states[j, : proposals.count[j]]) for j in range(len(skeleton))]
    unary = [list(proposals.unary[j, : proposals.count[j]]) for j in range(len(skeleton))]
    bones = [(a, b, length[b]) for a, b in skeleton.edges if np.isfinite(deviation[b])]
    neighbours = {j: [(a + b - j, bone) for a, b, bone in bones if j in (a, b)] for j in waiting}
    while ready := [j for j in waiting if any(states[other] for other, _ in neighbours[j])]:
        for j in ready:
            view = int(np.argmax(rays.weights[:, j]))
            origin, direction = rays.origins[view], rays.directions[view, j]
            for other, bone in neighbours[j]:
                if states[other]:
                    anchor = states[other][int(np.argmax(unary[other]))] - origin
                    along = anchor @ direction
                    reach = np.sqrt(max(bone**2 - (anchor @ anchor - along**2), 0.0))
                    depths = [depth for depth in (along - reach, along + reach) if depth > 0]
                    states[j] += [origin + depth * direction for depth in depths]
                    unary[j] += [np.log(rays.weights[view, j] + noise.floor)] * len(depths)
        waiting -= set(ready)
    most = max(proposals.states.shape[1], *(len(each) for each in states))
    padded = Proposals(
        np.zeros((len(states), most, 3)), np.full((len(states), most), -np.inf), np.array([len(s) for s in states])
    )
    for j, count in enumerate(padded.count):
        padded.states[j, :count] = np.reshape(states[j], (-1, 3))
        padded.unary[j, :count] = unary[j]
    return padded


@njit(cache=True)
def _max_product(states, unary, count, parents, order, length, precision):  # type: ignore[no-untyped-def]
    joints = len(parents)
    belief = unary.copy()
    choice = np.zeros((joints, states.shape[1]), np.int64)  # best state of a joint for each state of its parent
    for child in order:
        parent = parents[child]
        if parent < 0 or count[child] == 0:
            continue
        for p in range(count[parent]):
            best, argument = -np.inf, 0
            for c in range(count[child]):
                value = belief[child, c]
                if precision[child] > 0.0:
                    d2 = 0.0
                    for r in range(3):
                        d2 += (states[child, c, r] - states[parent, p, r]) ** 2
                    value -= 0.5 * precision[child] * (np.sqrt(d2) - length[child]) ** 2
                if value > best:
                    best, argument = value, c
            belief[parent, p] += best
            choice[child, p] = argument
    chosen = np.zeros(joints, np.int64)
    for joint in order[::-1]:
        parent = parents[joint]
        if parent >= 0 and count[parent] > 0:
            chosen[joint] = choice[joint, chosen[parent]]
        elif count[joint] > 0:
            chosen[joint] = np.argmax(belief[joint, : count[joint]])
    return chosen
