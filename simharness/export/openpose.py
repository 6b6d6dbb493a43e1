"""Detections as OpenPose writes them: one file for every picture, BODY_25 keypoints.

Missing keypoints are 0 0 0. Feet are always missing, and COCO-17 has no neck and no middle of the hips: these are made
halfway between shoulders and hips where both were detected. Boxes, descriptors and heat maps have no place there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17
from simharness.formats.openpose import BODY_25, BODY_25_OF_COCO17

_VERSION = 1.3  # of OpenPose's files
_OTHERS = ("face", "hand_left", "hand_right")
_MIDDLES = {"neck": "shoulder", "mid_hip": "hip"}


def people_file(keypoints: ArrayLike, scores: ArrayLike) -> dict[str, Any]:
    """What OpenPose writes of one picture, JSON-ready. Who has no keypoint at all is left out.

    Args:
        keypoints: COCO-17, (n, 17, 2), pixels; NaN where missing.
        scores: of each, (n, 17); 0 where missing.
    """
    keypoints, scores = np.asarray(keypoints, float), np.asarray(scores, float)
    triples = np.where(scores[..., None] > 0, np.concatenate([keypoints, scores[..., None]], axis=-1), 0.0)
    body = np.zeros((len(scores), len(BODY_25), 3))
    body[:, BODY_25_OF_COCO17] = triples
    for joint, end in _MIDDLES.items():
        ends = triples[:, [COCO17.index(f"left_{end}"), COCO17.index(f"right_{end}")]]
        middle = np.concatenate([ends[..., :2].mean(axis=1), ends[..., 2:].min(axis=1)], axis=-1)
        body[:, BODY_25.index(joint)] = np.where(middle[:, 2:] > 0, middle, 0.0)
    return {"version": _VERSION, "people": [_person(each) for each in body[(scores > 0).any(axis=1)]]}


def _person(body: np.ndarray) -> dict[str, Any]:
    person: dict[str, Any] = {"person_id": [-1], "pose_keypoints_2d": body.ravel().tolist()}
    person |= {f"{part}_keypoints_2d": [] for part in _OTHERS}
    return person | {f"{part}_keypoints_3d": [] for part in ("pose", *_OTHERS)}
