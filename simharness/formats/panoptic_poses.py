"""True poses in the format of the CMU Panoptic dataset: ``body3DScene`` files with ``joints19``.

Centimetres, y down: (X, Y, Z) = 100 (x, -z, y) of our metres, z up, as in the calibrations of
:mod:`simharness.formats.calibration.panoptic`. Simulated joints are always defined, even where they are hidden; the
dataset's mark of an undefined joint (0 0 0 -1) is never written.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17
from mvpose.skeleton import PANOPTIC19
from simharness.types.views import Visibility

VERSION = 0.7  # of the dataset's files
CONFIDENCES = {"two or more": 1.0, "one": 0.5, "none": 0.2, "none, nor any joint of the person": 0.0}
"""Confidence of a joint by the number of pictures that show it.

Loaders drop joints with a confidence below 0.1, and people whose middle of the hips has such a confidence. So a hidden
joint gets 0.2 where another joint of the person is visible (a table hides the hips, and the person is kept), and 0
where no picture shows the person at all (the person is dropped).
"""

_MADE_FROM = {"neck": ("left_shoulder", "right_shoulder"), "mid_hip": ("left_hip", "right_hip")}
_SEEN_WITH = [[COCO17.index(each) for each in _MADE_FROM.get(joint, (joint,))] for joint in PANOPTIC19.joints]
_DECIMALS = 4  # of centimetres


def confidences(visibility: ArrayLike) -> NDArray[np.float64]:
    """Return the confidence of every joint, (P, 19), one of the values of ``CONFIDENCES``.

    Args:
        visibility: :class:`simharness.types.views.Visibility` of COCO-17 in the pictures of a frame,
            (V, P, 17). The neck counts as visible where a shoulder is, the middle of the hips where a hip is.
    """
    visible = np.asarray(visibility) == Visibility.VISIBLE
    seen = np.stack([visible[..., joints].any(axis=-1) for joints in _SEEN_WITH], axis=-1).sum(axis=0)
    person_seen = (seen > 0).any(axis=-1, keepdims=True)
    two, one, hidden, unseen = CONFIDENCES.values()
    return np.select([seen >= 2, seen == 1], [two, one], np.where(person_seen, hidden, unseen))


def body_scene(
    joints: ArrayLike, confidence: ArrayLike, *, ids: Sequence[int], time: float, rate: float
) -> dict[str, Any]:
    """Return the ``body3DScene`` file of one frame, JSON-ready.

    Args:
        joints: joints of PANOPTIC19 in the world, (P, 19, 3), metres, z up.
        confidence: confidence of each joint, (P, 19).
        ids: numbers of the people, P.
        time: time of the frame, seconds.
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
