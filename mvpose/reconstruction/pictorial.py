"""3D pictorial structures on the proposals of one matched person (paper, section 3.3).

The posterior of a pose is the product of every joint's likelihood in all views and of a Gaussian on every bone
length. Its logarithm is a sum over a tree, so max-product (here max-sum) finds the best combination of proposals
exactly, in time linear in the number of bones and quadratic in the number of proposals per joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.bone_length_prior import personal_prior, published_bones
from mvpose.reconstruction.heatmap_likelihood import rescore
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.limb_direction_prior import direction_concentrations, trunk_direction, trunk_segments
from mvpose.reconstruction.poses import Poses, clear, gather
from mvpose.reconstruction.proposals import propose_all, propose_single_views
from mvpose.reconstruction.refinement import climb, fit_scale, tree, write_uncertainty
from mvpose.skeleton import Skeleton


@dataclass(frozen=True)
class PictorialStructure:
    """Reconstruction by 3DPS: proposals, max-product, then local refinement of the best pose.

    The likelihood comes from the heat maps of the detections where they carry any, else from a Gaussian around each
    keypoint.

    A joint that only one view sees is placed on its ray by the prior, with the resulting covariance; a joint that no
    view sees is missing.

    Attributes:
        noise: error model of keypoints.
        personal: whether to scale the bone-length prior to the person's stature, estimated from the well-seen bones.
        most_pairs: greatest number of pairs of views that propose positions for a joint; pairs that agree and meet at
            wide angles come first. The limit matters from 12 views on.
        most_states: number of proposals kept for a joint, the likeliest ones.

    Raises:
        ValueError: ``most_pairs`` or ``most_states`` below 1.
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
        """Return the joints of all people; labels (m,) count from 0, -1 for a detection of no person."""
        length, definition = published_bones(skeleton)
        modes = rays.modes
        maps = None if modes is None else (modes.values, modes.row, modes.grid, modes.cameras)
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
            direction_concentrations(skeleton),
            trunk_segments(skeleton),
            self.personal,
            self.most_pairs,
            self.most_states,
        )
        return poses


@njit(cache=True)
def _structures(
    poses, labels, origins, directions, weights, pixel, maps, sigmas, floor,
    parents, order, neighbours, bones, length, definition, concentrations, segments, personal, most_pairs, most_states,
):  # fmt: skip
    trunk = np.empty(3)
    for person in range(len(poses.joints)):
        joints, scores, covariance = poses.joints[person], poses.scores[person], poses.covariance[person]
        clear(joints, scores, covariance)
        centers, rays, scores_2d, angles = gather(labels, person, origins, directions, weights, pixel)
        states, unary, count, scale = propose_all(
            centers, rays, scores_2d, angles, sigmas, floor, most_pairs, most_states
        )  # fmt: skip
        if maps is not None:
            rescore(states, unary, count, labels, person, scores_2d, maps, floor)
        lengths, precision = personal_prior(states, count, scores_2d, sigmas, parents, length, definition, personal)
        trunk_direction(states, count, segments, trunk)
        propose_single_views(
            states, unary, count, centers, rays, scores_2d, floor, neighbours, bones, lengths, precision,
            concentrations, trunk,
        )  # fmt: skip
        chosen = max_product(states, unary, count, parents, order, lengths, precision)
        deviations = np.empty(len(sigmas))
        for j in range(len(sigmas)):
            deviations[j] = scale * sigmas[j]
            if count[j] > 0:
                for r in range(3):
                    joints[j, r] = states[j, chosen[j], r]
        climb(
            joints, centers, rays, scores_2d, angles, deviations, floor,
            parents, order, neighbours, bones, lengths, precision,
        )  # fmt: skip
        # The prior is weakened where the keypoints agree to a pixel, so that it does not move joints by millimetres
        # (empirical Bayes).
        weakened = precision * fit_scale(joints, centers, rays, scores_2d, angles, deviations, floor)
        climb(
            joints, centers, rays, scores_2d, angles, deviations, floor,
            parents, order, neighbours, bones, lengths, weakened,
        )  # fmt: skip
        write_uncertainty(
            scores, covariance, joints, centers, rays, scores_2d, angles, deviations, floor,
            parents, order, neighbours, bones, lengths, precision, concentrations, trunk,
        )  # fmt: skip


@njit(cache=True)
def max_product(states, unary, count, parents, order, length, precision):
    """Find the combination of states with the greatest sum of unaries and log-Gaussian pairwise terms of bone length.

    Args:
        states: candidate positions, (J, S, 3), metres.
        unary: log-likelihoods of the states, (J, S).
        count: number of valid states for each joint, (J,). A joint without any is skipped: it does not constrain its
            neighbours.
        parents: parent of each joint, (J,), -1 for the root.
        order: joints in an order with leaves first, (J,).
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
