"""Size of a rig by the bone lengths of the people it sees, for calibrations whose scale is not trusted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.camera import Rig
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.reconstruction.bone_length_prior import STATURE_DEVIATION, published_bones
from mvpose.skeleton import Skeleton

_FEWEST = 30  # bones in frames of a person; fewer show nothing


def size_of_people(
    positions: Floats, body: Integers, person: Integers, kind: Integers, skeleton: Skeleton
) -> tuple[float, float]:
    """Return how many times as large as adults people are, and the standard deviation; NaN and infinity if unknown.

    Of each person the median over bones and frames counts, which wrong keypoints hardly change; statures of adults
    differ by 5.5 %, so that n people give the size up to 5.5 % / sqrt(n).

    Args:
        positions: joints, (G, 3), metres; NaN where unknown.
        body: number of the person in a frame that each joint belongs to, (G,).
        person: person of each joint, (G,).
        kind: index of each joint in the skeleton, (G,).
        skeleton: the joints.
    """
    bodies = int(body.max(initial=-1)) + 1
    joints, owner = np.full((bodies, len(skeleton), 3), np.nan), np.zeros(bodies, np.int64)
    joints[body, kind], owner[body] = positions, person
    parents, children, length = published_limbs(skeleton)
    ratio = np.linalg.norm(joints[:, parents] - joints[:, children], axis=-1) / length
    known = np.isfinite(ratio)
    people = [each for each in np.unique(owner) if known[owner == each].sum() >= _FEWEST]
    if not people:
        return np.nan, np.inf
    sizes = [np.median(ratio[owner == each][known[owner == each]]) for each in people]
    return float(np.median(sizes)), STATURE_DEVIATION / np.sqrt(len(people))


def published_limbs(skeleton: Skeleton) -> tuple[Integers, Integers, Floats]:
    """Return parents, children and lengths, metres, of bones whose joints detectors define clearly, (B,) each."""
    graph, published = bone_graph(skeleton), published_bones(skeleton)
    good = (graph.parents >= 0) & (published.length > 0.2) & (published.definition < 0.05)
    return graph.parents[good], graph.children[good], published.length[good]


def resized(rig: Rig, factor: float) -> Rig:
    """Return a rig of another size, about the mean of its optical centres."""
    middle = rig.centers.mean(axis=0)
    centers = middle + factor * (rig.centers - middle)
    return Rig([replace(camera, t=-camera.R @ center) for camera, center in zip(rig, centers, strict=True)])
