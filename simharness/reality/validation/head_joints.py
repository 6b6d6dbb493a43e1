"""Completion of the joints of the face, so that one missing ear does not cost a whole head."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats

FACE = slice(0, 5)
"""Nose, eyes and ears in COCO-17: the joints from which the two head joints of SHELF14 are computed."""


def fill_face(joints: Floats) -> Floats:
    """Return joints (..., 17, 3) of COCO-17 with each missing joint of the face at the mean of those that exist.

    A nose or an ear that was not placed leaves both head joints of SHELF14 undefined, and so costs two of ten parts,
    head and torso. With two cameras this is the largest loss of the variants that place a joint only where two views
    agree, and it hides the others. A face without any joint stays missing.
    """
    face = joints[..., FACE, :]
    exists = np.isfinite(face).all(axis=-1, keepdims=True)
    count = exists.sum(axis=-2, keepdims=True)
    total = np.where(exists, face, 0.0).sum(axis=-2, keepdims=True)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    filled = joints.copy()
    filled[..., FACE, :] = np.where(exists, face, mean)
    return filled
