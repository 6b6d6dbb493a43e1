"""What a person does over time: the pelvis and the joint angles of every frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array
from simharness.humans.anatomy import DOFS

Floats = NDArray[np.float64]

_UNIT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Motion:
    """The configuration of one person in T frames.

    Attributes:
        root: position of the pelvis in metres and its orientation as a unit quaternion w x y z, (T, 7).
        angles: joint angles in radians, (T, D), in the order of ``simharness.humans.anatomy.DOFS``.

    Raises:
        ValueError: a wrong shape, a value that is not finite, a quaternion that is not of unit length.
    """

    root: Floats
    angles: Floats

    def __post_init__(self) -> None:
        root = as_array(self.root, ("T", 7), "motion root")
        angles = as_array(self.angles, (len(root), len(DOFS)), "motion angles")
        if not (np.isfinite(root).all() and np.isfinite(angles).all()):
            bad = int(np.flatnonzero(~(np.isfinite(root).all(axis=1) & np.isfinite(angles).all(axis=1)))[0])
            raise ValueError(f"motion root and angles must be finite; frame {bad} is not")
        off = np.abs(np.linalg.norm(root[:, 3:], axis=1) - 1.0)
        if (off > _UNIT_TOLERANCE).any():
            raise ValueError(
                f"motion root quaternions (w x y z) must have unit length, the one of frame {int(off.argmax())} is "
                f"off by {off.max():.2g}"
            )
        object.__setattr__(self, "root", root)
        object.__setattr__(self, "angles", angles)

    def __len__(self) -> int:
        return len(self.root)
