"""Skeletons: joint names, the kinematic tree, mirror pairs, OKS sigmas; and mappings between them.

World axes are z up wherever a mapping needs to know (the published head mappings of Shelf do).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.checks import as_points

HeadMapping = Literal["voxelpose", "2019"]


@dataclass(frozen=True)
class Skeleton:
    """A set of joints and the tree that joins them.

    Attributes:
        name: how files and messages call it.
        joints: joint names, J of them.
        parents: index of each joint's parent in the tree, -1 for the root, (J,); parents may come later.
        mirror: index of each joint's left-right counterpart, itself on the midline, (J,).
        sigmas: OKS standard deviations, (J,), as fractions of the square root of the person's area.
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    mirror: tuple[int, ...]
    sigmas: tuple[float, ...]

    def __post_init__(self) -> None:
        for key in ("joints", "parents", "mirror", "sigmas"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        count, skeleton = len(self.joints), f"skeleton {self.name!r}"
        if not count or len(set(self.joints)) != count:
            raise ValueError(f"{skeleton}: joints must be different names, one or more, got {self.joints}")
        for key in ("parents", "mirror", "sigmas"):
            if len(getattr(self, key)) != count:
                raise ValueError(f"{skeleton}: {key} must have {count} entries, got {len(getattr(self, key))}")
        if self.parents.count(-1) != 1 or not all(-1 <= parent < count for parent in self.parents):
            raise ValueError(f"{skeleton}: parents must name one root (-1) and joints below {count}")
        reached = {self.parents.index(-1)}
        for _ in range(count):
            reached |= {joint for joint, parent in enumerate(self.parents) if parent in reached}
        if len(reached) != count:
            raise ValueError(f"{skeleton}: parents do not form one tree")
        for joint, other in enumerate(self.mirror):
            if not 0 <= other < count or self.mirror[other] != joint:
                raise ValueError(
                    f"{skeleton}: mirror must name pairs, each the other's, and itself on the midline; "
                    f"{self.joints[joint]!r} ({joint}) has {other}"
                )
        if not all(0 < sigma < np.inf for sigma in self.sigmas):
            raise ValueError(f"{skeleton}: sigmas must be positive, got {self.sigmas}")

    def __len__(self) -> int:
        return len(self.joints)

    def __hash__(self) -> int:
        return hash(self.name)  # what depends on a skeleton alone is cached by it, and asked for in every frame

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """The bones of the tree as (parent, child), J - 1 of them."""
        return tuple((parent, child) for child, parent in enumerate(self.parents) if parent >= 0)

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """What each joint is of the body, whichever its side: the names without ``left_`` and ``right_``, (J,)."""
        return tuple(joint.removeprefix("left_").removeprefix("right_") for joint in self.joints)

    @cached_property
    def variances(self) -> Floats:
        """What OKS divides squared distances by, ``(2 sigma)²``, (J,), as fractions of the person's area."""
        variances = (2.0 * np.array(self.sigmas)) ** 2
        variances.flags.writeable = False
        return variances

    def index(self, joint: str) -> int:
        """Index of a joint by its name; a ValueError lists the names."""
        if joint not in self.joints:
            raise ValueError(f"skeleton {self.name!r} has no joint {joint!r}; it has {', '.join(self.joints)}")
        return self.joints.index(joint)


# fmt: off
COCO17 = Skeleton(
    name="coco17",
    joints=(
        "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder",
        "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip",
        "left_knee", "right_knee", "left_ankle", "right_ankle",
    ),
    # Rooted at the left shoulder: the torso is the best seen part, and every edge is a bone with a length
    # of its own. The face hangs on the ears' side through the nose, which nods little against a shoulder.
    parents=(5, 0, 0, 1, 2, -1, 5, 5, 6, 7, 8, 5, 6, 11, 12, 13, 14),
    mirror=(0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15),
    sigmas=(.026, .025, .025, .035, .035, .079, .079, .072, .072, .062, .062, .107, .107, .087, .087, .089, .089),
)

SHELF14 = Skeleton(
    name="shelf14",
    joints=(
        "right_ankle", "right_knee", "right_hip", "left_hip", "left_knee", "left_ankle",
        "right_wrist", "right_elbow", "right_shoulder", "left_shoulder", "left_elbow", "left_wrist",
        "head_bottom", "head_top",
    ),
    parents=(1, 2, 8, 9, 3, 4, 7, 8, 9, -1, 9, 10, 9, 12),
    mirror=(5, 4, 3, 2, 1, 0, 11, 10, 9, 8, 7, 6, 12, 13),
    sigmas=(.089, .087, .107, .107, .087, .089, .062, .072, .079, .079, .072, .062, .079, .079),
)

PANOPTIC19 = Skeleton(
    name="panoptic19",
    joints=(
        "neck", "nose", "mid_hip", "left_shoulder", "left_elbow", "left_wrist", "left_hip", "left_knee", "left_ankle",
        "right_shoulder", "right_elbow", "right_wrist", "right_hip", "right_knee", "right_ankle",
        "left_eye", "left_ear", "right_eye", "right_ear",
    ),
    parents=(-1, 0, 0, 0, 3, 4, 2, 6, 7, 0, 9, 10, 2, 12, 13, 1, 15, 1, 17),
    mirror=(0, 1, 2, 9, 10, 11, 12, 13, 14, 3, 4, 5, 6, 7, 8, 17, 18, 15, 16),
    # COCO's; the neck as the shoulders and the middle of the hips as the hips.
    sigmas=(
        .079, .026, .107, .079, .072, .062, .107, .087, .089,
        .079, .072, .062, .107, .087, .089, .025, .035, .025, .035,
    ),
)  # the order of the CMU Panoptic dataset's joints19: BodyCenter is mid_hip

_LIMBS_COCO17_TO_SHELF14 = (16, 14, 12, 11, 13, 15, 10, 8, 6, 5, 7, 9)
# fmt: on


def coco17_to_shelf14(joints: ArrayLike, *, head: HeadMapping = "voxelpose") -> Floats:
    """Map COCO-17 joints in the world, (..., 17, 3) with z up, to the 14 of Shelf and Campus, (..., 14, 3).

    The two head joints do not exist in COCO; they are built from shoulders, nose and ears. ``head`` names the
    published rule: ``"2019"`` (the code released with the paper) or ``"voxelpose"`` (its evaluation, which
    later methods use). The choice moves the Shelf average by about 0.9 points of PCP. NaN stays NaN.

    Raises:
        ValueError: a wrong shape or an unknown rule.
    """
    joints = as_points(joints, 3, "joints")
    if joints.shape[-2:] != (17, 3):
        raise ValueError(f"joints must be (..., 17, 3), those of COCO17, got {joints.shape}")
    nose, ears = joints[..., 0, :], joints[..., 3:5, :].mean(axis=-2)
    shoulders = joints[..., 5:7, :].mean(axis=-2)
    bottom = shoulders + 0.5 * (nose - shoulders)
    top = shoulders + (nose - shoulders) * np.array([0.75, 0.75, 1.5])
    if head == "voxelpose":
        other_bottom = 0.5 * (shoulders + ears)
        other_top = other_bottom + 2 * (ears - other_bottom)
        bottom = 0.75 * bottom + 0.25 * other_bottom
        top = 0.75 * top + 0.25 * other_top
    elif head != "2019":
        raise ValueError(f"head mapping must be 'voxelpose' or '2019', got {head!r}")
    limbs = joints[..., _LIMBS_COCO17_TO_SHELF14, :]
    return np.concatenate([limbs, bottom[..., None, :], top[..., None, :]], axis=-2)
