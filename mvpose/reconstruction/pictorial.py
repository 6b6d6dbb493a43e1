"""3D pictorial structures on the proposals of one matched person (paper, section 3.3).

The posterior of a pose is the product of every joint's likelihood in all views and of a Gaussian on every bone
length; its logarithm is a sum over a tree, so max-product (here max-sum) finds the best combination of proposals
exactly, in time linear in the bones and quadratic in the proposals of a joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.rays import Rays
from mvpose.reconstruction.bone_length_prior import bones, personal_prior
from mvpose.reconstruction.heatmap_likelihood import rescore
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.limb_direction_prior import down_the_trunk, hang, parts
from mvpose.reconstruction.poses import Poses, clear, gather
from mvpose.reconstruction.proposals import propose_all, propose_single_views
from mvpose.reconstruction.refinement import climb, fit_scale, judge, tree
from mvpose.skeleton import Skeleton


@dataclass(frozen=True)
class PictorialStructure:
    """Reconstruction by 3DPS: proposals, max-product, then a local refinement of the winner.

    The likelihood is that of the detections' heat maps where they carry any, else a Gaussian about each keypoint.

    A joint that one view alone sees is placed on its ray by the prior, with the covariance that this deserves; one
    that no view sees is missing.

    Attributes:
        noise: the error model of keypoints.
        personal: scale the bone-length prior to the person, whose stature the well-seen bones tell.
        most_pairs: pairs of views that propose for a joint, those that agree and meet at wide angles; 12 views and
            more have too many.
        most_states: proposals kept for a joint, the likeliest ones.
    """

    noise: Noise = Noise()
    personal: bool = True
    most_pairs: int = 64
    most_states: int = 32

    def __post_init__(self) -> None:
        for name in ("most_pairs", "most_states"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} of the pictorial structure must be at least 1, got {getattr(self, name)}")

    def __call__(self, rays: Rays, labels: NDArray[np.int64], skeleton: Skeleton) -> Poses:
        """The joints of everyone: labels (m,) from 0, -1 for a detection of nobody."""
        length, definition = bones(skeleton)
        modes = rays.modes
        maps = None if modes is None else (modes.values, modes.grid, modes.cameras)
        poses = Poses.empty(labels, len(skeleton))
        _structures(
            poses,
            labels,
            rays.origins,
            rays.directions[:, :, None] if modes is None else modes.directions,
            rays.weights[:, :, None] if modes is None else modes.weights,
            self.noise.pixels * rays.pixel,
            maps,
            self.noise.sigmas(skeleton),
            self.noise.floor,
            *tree(skeleton),
            length,
            definition,
            hang(skeleton),
            parts(skeleton),
            self.personal,
            self.most_pairs,
            self.most_states,
        )
        return poses


@njit(cache=True)
def _structures(
    poses, labels, origins, directions, weights, pixel, maps, sigmas, floor,
    parents, order, neighbours, bones, length, definition, hang, parts, personal, most_pairs, most_states,
):  # fmt: skip
    down = np.empty(3)
    for person in range(len(poses.joints)):
        joints, scores, covariance = poses.joints[person], poses.scores[person], poses.covariance[person]
        clear(joints, scores, covariance)
        mine, towards, weight, angle = gather(labels, person, origins, directions, weights, pixel)
        states, unary, count, scatter = propose_all(
            mine, towards, weight, angle, sigmas, floor, most_pairs, most_states
        )
        if maps is not None:
            rescore(states, unary, count, labels, person, weight, maps, floor)
        own_length, precision = personal_prior(states, count, weight, sigmas, parents, length, definition, personal)
        down_the_trunk(states, count, parts, down)
        propose_single_views(
            states, unary, count, mine, towards, weight, floor, neighbours, bones, own_length, precision, hang, down
        )
        chosen = max_product(states, unary, count, parents, order, own_length, precision)
        own = np.empty(len(sigmas))
        for j in range(len(sigmas)):
            own[j] = scatter * sigmas[j]
            if count[j] > 0:
                for r in range(3):
                    joints[j, r] = states[j, chosen[j], r]
        climb(
            joints, mine, towards, weight, angle, own, floor,
            parents, order, neighbours, bones, own_length, precision,
        )  # fmt: skip
        # Where the keypoints agree to a pixel, the prior has no say about millimetres (empirical Bayes).
        eased = precision * fit_scale(joints, mine, towards, weight, angle, own, floor)
        climb(
            joints, mine, towards, weight, angle, own, floor,
            parents, order, neighbours, bones, own_length, eased,
        )  # fmt: skip
        judge(
            scores, covariance, joints, mine, towards, weight, angle, own, floor,
            parents, order, neighbours, bones, own_length, precision, hang, down,
        )  # fmt: skip


@njit(cache=True)
def max_product(states, unary, count, parents, order, length, precision):
    """The combination of states with the greatest sum of unaries and log-Gaussian bone lengths.

    Args:
        states: candidate positions, (J, S, 3), metres.
        unary: their log-likelihoods, (J, S).
        count: how many of the S are valid for each joint, (J,). A joint without any is passed over: its neighbours
            are not constrained by it.
        parents: the tree, (J,), -1 for the root.
        order: its joints, leaves first, (J,).
        length: mean bone length to the parent, (J,), metres.
        precision: inverse variance of the length, (J,), 1/m^2; 0 for no constraint.

    Returns:
        Index of the chosen state of every joint, (J,); 0 for a joint without states.
    """
    joints = len(parents)
    belief = np.empty(unary.shape)
    choice = np.zeros(unary.shape, np.int64)  # best state of a joint for each state of its parent
    for joint in range(joints):
        for s in range(count[joint]):
            belief[joint, s] = unary[joint, s]
    for child in order:
        parent = parents[child]
        if parent < 0 or count[child] == 0:
            continue
        for p in range(count[parent]):
            best, argument = -np.inf, 0
            for c in range(count[child]):
                value = belief[child, c]
                if precision[child] > 0.0:
                    x = states[child, c, 0] - states[parent, p, 0]
                    y = states[child, c, 1] - states[parent, p, 1]
                    z = states[child, c, 2] - states[parent, p, 2]
                    value -= 0.5 * precision[child] * (np.sqrt(x * x + y * y + z * z) - length[child]) ** 2
                if value > best:
                    best, argument = value, c
            belief[parent, p] += best
            choice[child, p] = argument
    chosen = np.zeros(joints, np.int64)
    for joint in order[::-1]:
        parent = parents[joint]
        if parent >= 0 and count[parent] > 0:
            chosen[joint] = choice[joint, chosen[parent]]
        else:
            for s in range(1, count[joint]):
                if belief[joint, s] > belief[joint, chosen[joint]]:
                    chosen[joint] = s
    return chosen
