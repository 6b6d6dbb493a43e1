"""By how much estimated bones are too long or too short."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17, Skeleton


def bone_errors(truth: ArrayLike, estimate: ArrayLike, *, skeleton: Skeleton = COCO17) -> NDArray[np.float64]:
    """The estimated length less the true one, of every bone of the skeleton's tree.

    Args:
        truth: (..., J, 3).
        estimate: (..., J, 3), in the same unit.
        skeleton: the J joints.

    Returns:
        (..., J - 1) in the order of ``skeleton.edges``; NaN where an end is missing in either.
    """
    return _lengths(np.asarray(estimate, float), skeleton) - _lengths(np.asarray(truth, float), skeleton)


def _lengths(joints: NDArray[np.float64], skeleton: Skeleton) -> NDArray[np.float64]:
    parents, children = np.array(skeleton.edges).T
    return np.linalg.norm(joints[..., children, :] - joints[..., parents, :], axis=-1)
