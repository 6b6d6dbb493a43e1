"""3D pictorial structures on the proposals of one matched person (paper, section 3.3).

The posterior of a pose is the product of every joint's likelihood in all views and of a Gaussian on every bone
length. Its logarithm is a sum over the bones, which form a tree or, with the mirror images of bones
(:mod:`mvpose.reconstruction.bone_graph`), nearly so. So max-product (here max-sum) finds the best combination of
proposals exactly, in time linear in the number of bones and quadratic in the number of proposals per joint, cubic for a
joint that both sides hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.reconstruction.bone_length_prior import personal_prior, published_bones
from mvpose.reconstruction.heatmap_likelihood import rescore
from mvpose.reconstruction.inference import max_product
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.limb_direction_prior import direction_concentrations, trunk_direction, trunk_segments
from mvpose.reconstruction.poses import Poses, clear, empty_poses, gather
from mvpose.reconstruction.proposals import propose_all, propose_single_views
from mvpose.reconstruction.refinement import climb, fit_scale, write_uncertainty
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
        poses = _structures(
            labels,
            rays.origins,
            rays.directions[:, :, None] if modes is None else modes.directions,
            rays.weights[:, :, None] if modes is None else modes.weights,
            self.noise.pixels * rays.pixel,
            maps,
            self.noise.sigmas(skeleton),
            self.noise.floor,
            bone_graph(skeleton),
            length,
            definition,
            direction_concentrations(skeleton),
            trunk_segments(skeleton),
            self.personal,
            self.most_pairs,
            self.most_states,
        )
        return Poses(*poses)


@njit(cache=True)
def _structures(
    labels, origins, directions, weights, pixel, maps, sigmas, floor,
    graph, length, definition, concentrations, segments, personal, most_pairs, most_states,
):  # fmt: skip
    poses, trunk = empty_poses(labels, len(sigmas)), np.empty(3)
    for person in range(len(poses[0])):
        joints, scores, covariance, freedom = poses[0][person], poses[1][person], poses[2][person], poses[3][person]
        clear(joints, scores, covariance, freedom)
        centers, rays, scores_2d, angles = gather(labels, person, origins, directions, weights, pixel)
        states, unary, count, scale = propose_all(
            centers, rays, scores_2d, angles, sigmas, floor, most_pairs, most_states
        )  # fmt: skip
        if maps is not None:
            rescore(states, unary, count, labels, person, scores_2d, maps, floor)
        lengths, precision = personal_prior(states, count, scores_2d, sigmas, graph, length, definition, personal)
        trunk_direction(states, count, segments, trunk)
        propose_single_views(
            states, unary, count, centers, rays, scores_2d, floor, graph, lengths, precision, concentrations, trunk
        )
        chosen = max_product(states, unary, count, graph, lengths, precision)
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
        write_uncertainty(
            scores, covariance, freedom, joints, centers, rays, scores_2d, angles, sigmas, deviations, floor, graph,
            lengths, precision, concentrations, trunk,
        )  # fmt: skip
    return poses
