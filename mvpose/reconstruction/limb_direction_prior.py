"""Prior on limb directions relative to the trunk, which resolves the depth of joints seen by a single view.

Along the ray of such a joint a bone of given length fits at two depths. Posture makes one of them more likely: upper
arms, forearms, thighs and shanks mostly point along the trunk, from the shoulders towards the hips. The direction of a
limb is modelled as von Mises-Fisher around the direction of the trunk. The vertical plays no part, so the prior also
holds for a person who lies down. The paper's prior has bone lengths only (section 3.3), and its released code places
such joints at an arbitrary depth.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.kernels import njit
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.skeleton import Skeleton

# Nine clips of recorded motion (subjects 02 and 03 of the CMU database: walk, run, jump, balance; dance and mime from
# other sources) have mean cosines of 0.98, 0.89, 0.72, 0.83 and 0.83, hence concentrations of 50, 9, 4, 6 and 6. The
# last four are halved because these people sit and bend less than most. The side of the trunk (shoulder to hip) matters
# only where the trunk direction is taken from the head (mean cosine 0.96, concentration 25), and is set much lower
# because the nose is not the centre of the head.
_CONCENTRATION: dict[tuple[str, str], float] = {
    ("shoulder", "hip"): 5.0,
    ("shoulder", "elbow"): 4.5,
    ("elbow", "wrist"): 2.0,
    ("hip", "knee"): 3.0,
    ("knee", "ankle"): 3.0,
}
_SEGMENTS = {"shoulder": 1, "hip": 2, "nose": 3, "eye": 3, "ear": 3, "head_top": 3}


@cache
def direction_concentrations(skeleton: Skeleton) -> Floats:
    """Return the von Mises-Fisher concentration of the direction of every bone, (B,); 0 is uniform.

    The direction is from the inner to the outer end; for the bones see
    :func:`mvpose.reconstruction.bone_graph.bone_graph`.
    """
    graph = bone_graph(skeleton)
    ends = zip(graph.parents, graph.children, strict=True)
    known = (
        _CONCENTRATION.get((skeleton.parts[parent], skeleton.parts[child]), 0.0) if parent >= 0 else 0.0
        for parent, child in ends
    )
    return np.array(list(known))


@cache
def trunk_segments(skeleton: Skeleton) -> NDArray[np.int64]:
    """Return the segment that each joint belongs to: 1 shoulders, 2 hips, 3 head, 0 other joints, (J,)."""
    return np.array([_SEGMENTS.get(part, 0) for part in skeleton.parts], np.int64)


@njit(cache=True)
def trunk_direction(states, count, segments, trunk):
    """Write the unit direction (3,) from shoulders to hips, or else from head to shoulders; zeros if unknown.

    Args:
        states: proposals of every joint, (J, S, 3), metres, the likeliest first.
        count: number of valid proposals per joint, (J,).
        segments: segment of each joint, from :func:`trunk_segments`, (J,).
        trunk: output, (3,).
    """
    centroid, placed = np.zeros((4, 3)), np.zeros(4)
    for j in range(len(segments)):
        if count[j] > 0:
            placed[segments[j]] += 1.0
            for r in range(3):
                centroid[segments[j], r] += states[j, 0, r]
    upper, lower = (1, 2) if placed[2] > 0.0 else (3, 1)
    size = 0.0
    for r in range(3):
        trunk[r] = centroid[lower, r] / max(placed[lower], 1.0) - centroid[upper, r] / max(placed[upper], 1.0)
        size += trunk[r] ** 2
    known = placed[upper] > 0.0 and placed[lower] > 0.0 and size > 0.0
    for r in range(3):
        trunk[r] = trunk[r] / np.sqrt(size) if known else 0.0


@njit(cache=True)
def direction_log_likelihood(point, other, outward, concentration, trunk):
    """Return the log-likelihood of a bone's direction, up to a constant; at most 0.

    Args:
        point: one end of the bone, (3,).
        other: other end of the bone, (3,).
        outward: whether the point is the child of the other.
        concentration: von Mises-Fisher concentration of the bone.
        trunk: unit direction of the trunk, (3,); zeros if unknown.
    """
    size, cosine = 0.0, 0.0
    for r in range(3):
        x = point[r] - other[r]
        size += x * x
        cosine += x * trunk[r]
    if concentration == 0.0 or size == 0.0 or (trunk[0] == 0.0 and trunk[1] == 0.0 and trunk[2] == 0.0):
        return 0.0
    cosine /= np.sqrt(size)
    return concentration * ((cosine if outward else -cosine) - 1.0)
