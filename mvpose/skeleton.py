"""Skeletons (joint names, kinematic tree, mirror pairs, OKS sigmas) and mappings between them.

Mappings that depend on the vertical (the published head mappings of Shelf) assume that z is up in the world.
"""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.checks import as_points

HeadMapping = Literal["voxelpose", "2019"]
_SIDES = {"left": "right_", "right": "left_"}


@dataclass(frozen=True)
class Skeleton:
    """Set of joints with a kinematic tree.

    Raises:
        ValueError: repeated or no joint names, a field of another length, parents that do not form one tree, mirror
            indices that are not pairs, or a sigma that is not positive.
    """

    name: str
    """Name of the skeleton in files and messages."""
    joints: tuple[str, ...]
    """Names of the J joints."""
    parents: tuple[int, ...]
    """Index of each joint's parent in the tree, -1 for the root, (J,); a parent may come after its child."""
    mirror: tuple[int, ...]
    """Index of each joint's left-right counterpart, or of the joint itself on the midline, (J,)."""
    sigmas: tuple[float, ...]
    """OKS standard deviations, (J,), as fractions of the square root of the person's area."""

    def __post_init__(self) -> None:
        for key in ("joints", "parents", "mirror", "sigmas"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        count, skeleton = len(self.joints), f"skeleton {self.name!r}"
        if not count or len(set(self.joints)) != count:
            raise ValueError(f"{skeleton}: joints must be one or more different names, got {self.joints}")
        for key in ("parents", "mirror", "sigmas"):
            if len(getattr(self, key)) != count:
                raise ValueError(f"{skeleton}: {key} must have {count} entries, got {len(getattr(self, key))}")
        if self.parents.count(-1) != 1 or not all(-1 <= parent < count for parent in self.parents):
            raise ValueError(
                f"{skeleton}: parents must have one root (-1) and joint indices below {count}, got {self.parents}"
            )
        reached = {self.parents.index(-1)}
        for _ in range(count):
            reached |= {joint for joint, parent in enumerate(self.parents) if parent in reached}
        if len(reached) != count:
            raise ValueError(f"{skeleton}: parents must form one tree, got {self.parents}, which has a cycle")
        for joint, other in enumerate(self.mirror):
            if not 0 <= other < count or self.mirror[other] != joint:
                raise ValueError(
                    f"{skeleton}: mirror must hold pairs of joints that refer to each other, or the joint itself on "
                    f"the midline; {self.joints[joint]!r} ({joint}) has {other}"
                )
        if not all(0 < sigma < np.inf for sigma in self.sigmas):
            raise ValueError(f"{skeleton}: sigmas must be positive, got {self.sigmas}")

    def __len__(self) -> int:
        return len(self.joints)

    def __hash__(self) -> int:
        return hash(self.name)  # fast, because values that depend on the skeleton are looked up by it in every frame

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """The J - 1 bones of the tree as (parent, child)."""
        return tuple((parent, child) for child, parent in enumerate(self.parents) if parent >= 0)

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """Joint names without the side (``left_``, ``right_``), (J,)."""
        return tuple(joint.removeprefix("left_").removeprefix("right_") for joint in self.joints)

    @cached_property
    def variances(self) -> Floats:
        """OKS variances ``(2 sigma)²``, (J,), as fractions of the person's area."""
        variances = (2.0 * np.array(self.sigmas)) ** 2
        variances.flags.writeable = False
        return variances

    def index(self, joint: str) -> int:
        """Return the index of a joint by name.

        Raises:
            ValueError: an unknown name.
        """
        if joint not in self.joints:
            raise ValueError(f"skeleton {self.name!r} has no joint {joint!r}; it has {', '.join(self.joints)}")
        return self.joints.index(joint)


def _read_skeletons() -> Iterator[Skeleton]:
    """Yield the skeletons of the method and of its recordings."""
    file = Path(__file__).parent / "data" / "skeletons.toml"
    for name, joints in tomllib.loads(file.read_text(encoding="utf-8")).items():
        row = {joint: k for k, joint in enumerate(["", *joints], -1)}
        sides = {joint: re.sub("^(left|right)_", lambda side: _SIDES[side[1]], joint) for joint in joints}
        parents, sigmas = zip(*joints.values(), strict=True)
        mirror = tuple(row[sides[joint]] for joint in joints)
        yield Skeleton(name, tuple(joints), tuple(row[joint] for joint in parents), mirror, sigmas)


COCO17, SHELF14, PANOPTIC19 = _read_skeletons()

_LIMBS_COCO17_TO_SHELF14 = (16, 14, 12, 11, 13, 15, 10, 8, 6, 5, 7, 9)


def coco17_to_shelf14(joints: ArrayLike, *, head: HeadMapping = "voxelpose") -> Floats:
    """Map COCO-17 joints in the world, (..., 17, 3) with z up, to the 14 joints of Shelf and Campus, (..., 14, 3).

    COCO does not have the two head joints; they are computed from shoulders, nose and ears. ``head`` selects the
    published rule: ``"2019"`` (the code released with the paper) or ``"voxelpose"`` (the evaluation of VoxelPose,
    which later methods use). The choice changes the Shelf average by about 0.9 points of PCP. NaN stays NaN.

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
