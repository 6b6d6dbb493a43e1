"""Prior on the directions of bones in the frame of the body, which resolves the depth of joints seen by a single view.

Along the ray of such a joint a bone of given length fits at two depths, and so do, one after another, all joints that
hang on it. Lengths alone cannot tell a body from its reflection in depth; posture can. Upper arms, forearms, thighs and
shanks mostly point along the trunk, elbows bend forwards and knees backwards, hips are parallel to shoulders, the nose
is in front of the shoulders and the ears are behind the eyes. The direction of a bone is modelled as von Mises-Fisher
around a mean direction in the axes of the body. The vertical plays no part, so the prior also holds for a person who
lies down. The paper's prior has bone lengths only (section 3.3), and its released code places such joints at an
arbitrary depth.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.reconstruction.bone_graph import bone_graph
from mvpose.skeleton import Skeleton

# Concentration and mean direction from the inner to the outer end: forwards, outwards (to the side of the outer one, or
# towards the middle where that has no side), up the trunk. Means and concentrations of limbs are those of nine clips of
# recorded motion (subjects 02 and 03 of the CMU database: walk, run, jump, balance; dance and mime from other sources),
# whose concentrations of 12, 6, 8 and 11 are halved, because these people sit and bend less than most. Shoulders and
# hips there are parallel to within 4 degrees (concentration 250 and more); the hips hang below the shoulders with one
# of 1,000, but where the trunk direction is taken from the head, with 25. These are set much lower, because detected
# joints are not as exact. The head: positions of nose, eyes and ears as in the prior on bone lengths, on a head that
# turns by 30 degrees either way.
_DIRECTIONS: dict[tuple[str, str], tuple[float, tuple[float, float, float]]] = {
    ("shoulder", "hip"): (5.0, (0.0, -0.19, -0.98)),
    ("shoulder", "elbow"): (6.0, (-0.15, 0.17, -0.97)),
    ("elbow", "wrist"): (3.0, (0.51, 0.01, -0.86)),
    ("hip", "knee"): (4.0, (0.29, -0.02, -0.96)),
    ("knee", "ankle"): (5.0, (-0.40, -0.05, -0.91)),
    ("shoulder", "shoulder"): (20.0, (0.0, 1.0, 0.0)),
    ("hip", "hip"): (20.0, (0.0, 1.0, 0.0)),
    ("shoulder", "nose"): (6.0, (0.45, 0.62, 0.64)),
    ("nose", "eye"): (4.0, (-0.50, 0.55, 0.67)),
    ("eye", "ear"): (4.0, (-0.87, 0.47, -0.15)),
}
_SEGMENTS = {"shoulder": 1, "hip": 2, "nose": 3, "eye": 3, "ear": 3, "head_top": 3}


class LimbDirections(NamedTuple):
    """Mean directions of the bones of :func:`mvpose.reconstruction.bone_graph.bone_graph` in the axes of the body."""

    strength: Floats
    """Mean direction of each bone, from its inner to its outer end, times its concentration and its share, (B, 3):
    forward, left and up; 0 where nothing is known."""
    segments: Integers
    """Segment that each joint belongs to: 1 shoulders, 2 hips, 3 head, 0 other joints, (J,)."""
    across: Integers
    """Right counterpart of each left shoulder and hip, (J,); -1 for other joints."""


@cache
def limb_directions(skeleton: Skeleton) -> LimbDirections:
    """Return the directions of the bones of a skeleton."""
    graph = bone_graph(skeleton)
    side = np.array([joint.startswith("left_") * 1.0 - joint.startswith("right_") for joint in skeleton.joints])
    strength = np.zeros((len(graph.share), 3))
    for bone, (parent, child) in enumerate(zip(graph.parents, graph.children, strict=True)):
        known = _DIRECTIONS.get((skeleton.parts[parent], skeleton.parts[child])) if parent >= 0 else None
        if known is not None:
            outward = side[child] if side[child] else -side[parent]
            strength[bone] = graph.share[bone] * known[0] * np.array(known[1]) * [1.0, outward, 1.0]
    segments = np.array([_SEGMENTS.get(part, 0) for part in skeleton.parts], np.int64)
    paired = (side > 0) & ((segments == 1) | (segments == 2))
    return LimbDirections(strength, segments, np.where(paired, skeleton.mirror, -1))


@njit(cache=True)
def body_axes(states, chosen, count, limbs, axes):
    """Write the axes of a body, the rows forward, left and up, (3, 3); a row of zeros for an axis that is unknown.

    The trunk points from the hips to the shoulders, or else from the shoulders to the head; left is the mean direction
    from right to left shoulder and hip, across the trunk.

    Args:
        states: proposals of every joint, (J, S, 3), metres.
        chosen: the one of each joint that counts, (J,).
        count: number of valid proposals per joint, (J,); joints without any are unknown.
        limbs: :class:`LimbDirections`.
        axes: output, (3, 3).
    """
    centroid, placed, left = np.zeros((4, 3)), np.zeros(4), np.zeros(3)
    for j in range(len(count)):
        if count[j] > 0:
            other = limbs.across[j]
            placed[limbs.segments[j]] += 1.0
            for r in range(3):
                centroid[limbs.segments[j], r] += states[j, chosen[j], r]
                if other >= 0 and count[other] > 0:
                    left[r] += states[j, chosen[j], r] - states[other, chosen[other], r]
    upper, lower = (1, 2) if placed[2] > 0.0 else (3, 1)
    size = 0.0
    for r in range(3):
        axes[2, r] = centroid[upper, r] / max(placed[upper], 1.0) - centroid[lower, r] / max(placed[lower], 1.0)
        size += axes[2, r] ** 2
    known = placed[upper] > 0.0 and placed[lower] > 0.0 and size > 0.0
    for r in range(3):
        axes[2, r] = axes[2, r] / np.sqrt(size) if known else 0.0
    set_left(axes, left)


@njit(cache=True)
def set_left(axes, left):
    """Complete the axes of a body whose last row is known by a direction (3,) to its left; zeros where it has none."""
    along, size = 0.0, 0.0
    for r in range(3):
        along += left[r] * axes[2, r]
        size += left[r] ** 2
    across2 = size - along * along
    known = across2 > 0.01 * size and axes[2].any()
    for r in range(3):
        axes[1, r] = (left[r] - along * axes[2, r]) / np.sqrt(across2) if known else 0.0
    for r in range(3):
        axes[0, r] = axes[1, r - 2] * axes[2, r - 1] - axes[1, r - 1] * axes[2, r - 2]


@njit(cache=True)
def pull_bones(axes, limbs, pulled, pull):
    """Write the von Mises-Fisher parameters of the directions of bones, (B, 3): concentration times mean direction.

    Args:
        axes: axes of the body, (3, 3).
        limbs: :class:`LimbDirections`.
        pulled: bones that get one, (B,); 0 for the others.
        pull: output, (B, 3).
    """
    for bone in range(len(pull)):
        for r in range(3):
            value = 0.0
            for k in range(3):
                value += limbs.strength[bone, k] * axes[k, r]
            pull[bone, r] = value if pulled[bone] else 0.0


@njit(cache=True)
def direction_log_likelihood(point, other, outward, pull):
    """Return the log-likelihood of a bone's direction, up to a constant.

    Args:
        point: one end of the bone, (3,).
        other: other end of the bone, (3,).
        outward: whether the point is the child of the other.
        pull: von Mises-Fisher parameter, (3,).
    """
    size, along = 0.0, 0.0
    for r in range(3):
        x = point[r] - other[r]
        size += x * x
        along += x * pull[r]
    if size == 0.0:
        return 0.0
    return (along if outward else -along) / np.sqrt(size)
