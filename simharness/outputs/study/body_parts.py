"""Bodies as capsules around joints: limbs, a trunk with round edges, a neck and a head.

Radii are about those of the median circumferences of men and women in ANSUR II (Gordon et al., 2014), averaged along
each limb: they make a person of joints recognisable, and measure nothing.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton import COCO17

_LIMBS = (("shoulder", "elbow", 46), ("elbow", "wrist", 36), ("hip", "knee", 72), ("knee", "ankle", 48))

CAPSULES: tuple[tuple[int, int, int], ...] = tuple(
    (COCO17.index(f"{side}_{one}"), COCO17.index(f"{side}_{other}"), radius)
    for one, other, radius in _LIMBS
    for side in ("left", "right")
)
"""Two joints and the radius of each limb, mm."""

TRUNK: tuple[tuple[int, ...], int] = (
    tuple(COCO17.index(name) for name in ("left_shoulder", "right_shoulder", "right_hip", "left_hip")),
    85,
)
"""Corners of the trunk, and the radius of its edges, mm."""

HEAD: tuple[tuple[int, ...], int] = (tuple(range(5)), 98)
"""Joints whose mean is the middle of the head, and its radius, mm."""

NECK = 52
"""Radius of the neck, from the middle of the shoulders to the head, mm."""


def body_parts(joints: Floats) -> list[tuple[Floats, float]]:
    """Return the parts of a body whose joints are known: points, (k, 3) metres, and the radius around them, metres.

    One point is a ball, two are a capsule, and four are the trunk.

    Args:
        joints: joints, (J, 3), metres, the first 17 those of COCO-17; NaN where unknown.
    """
    known = np.asarray(np.isfinite(joints).all(axis=1))
    parts = [(joints[[a, b]], radius) for a, b, radius in CAPSULES if known[a] and known[b]]
    trunk, face = list(TRUNK[0]), [joint for joint in HEAD[0] if known[joint]]
    if known[trunk].all():
        parts.append((joints[trunk], TRUNK[1]))
    if face:
        head = joints[face].mean(axis=0)
        parts.append((head[None], HEAD[1]))
        if known[trunk[:2]].all():
            parts.append((np.stack([joints[trunk[:2]].mean(axis=0), head]), NECK))
    return [(points, radius / 1000) for points, radius in parts]
