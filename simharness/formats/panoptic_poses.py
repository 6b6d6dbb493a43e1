"""True poses as the CMU Panoptic dataset writes them: ``body3DScene`` files with ``joints19``.

Centimetres, y down: (X, Y, Z) = 100 (x, -z, y) of our metres, z up, as the calibrations of
:mod:`simharness.formats.calibration.panoptic`. The joints are the body's own points, so none is ever undefined
(0 0 0 -1 in the dataset), however well it is hidden.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17
from mvpose.skeleton import PANOPTIC19
from simharness.types.visibility import Visibility

VERSION = 0.7  # of the dataset's files
CONFIDENCES = {"two or more": 1.0, "one": 0.5, "none": 0.2, "nobody": 0.0}
"""Confidence of a joint by how many pictures show it; "none" where others of that person's joints are seen, "nobody"
where none is. Loaders drop joints below 0.1, and people with such a middle of the hips: a person whose hips a table
hides must not be lost to them, and one whom no picture shows must."""

_MADE_FROM = {"neck": ("left_shoulder", "right_shoulder"), "mid_hip": ("left_hip", "right_hip")}
_SEEN_WITH = [[COCO17.index(each) for each in _MADE_FROM.get(joint, (joint,))] for joint in PANOPTIC19.joints]
_DECIMALS = 4  # of centimetres


def confidences(visibility: ArrayLike) -> NDArray[np.float64]:
    """Confidence of every joint, (P, 19), one of ``CONFIDENCES``.

    Args:
        visibility: :class:`simharness.types.visibility.Visibility` of COCO-17 in the pictures of a frame,
            (V, P, 17). The neck is seen where a shoulder is, the middle of the hips where a hip is.
    """
    visible = np.asarray(visibility) == Visibility.VISIBLE
    seen = np.stack([visible[..., joints].any(axis=-1) for joints in _SEEN_WITH], axis=-1).sum(axis=0)
    somebody = (seen > 0).any(axis=-1, keepdims=True)
    hidden = np.where(somebody, CONFIDENCES["none"], CONFIDENCES["nobody"])
    return np.select([seen >= 2, seen == 1], [CONFIDENCES["two or more"], CONFIDENCES["one"]], hidden)


def body_scene(
    joints: ArrayLike, confidence: ArrayLike, *, ids: Sequence[int], time: float, rate: float
) -> dict[str, Any]:
    """One frame as a ``body3DScene`` file holds it, JSON-ready.

    Args:
        joints: of PANOPTIC19 in the world, (P, 19, 3), metres, z up.
        confidence: of each, (P, 19).
        ids: the people's numbers, P.
        time: of the frame, seconds.
        rate: frames per second.
    """
    x, y, z = np.moveaxis(100.0 * np.asarray(joints, float), -1, 0)
    values = np.stack([x, -z, y, np.asarray(confidence, float)], axis=-1).round(_DECIMALS)
    return {
        "version": VERSION,
        "univTime": round(1000.0 * time, 3),
        "fpsType": f"hd_{rate:g}".replace(".", "_"),
        "bodies": [
            {"id": int(number), "joints19": body.ravel().tolist()} for number, body in zip(ids, values, strict=True)
        ],
    }
