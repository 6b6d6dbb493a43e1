"""OpenPose JSON: one file for each frame and view, BODY_25 keypoints.

``people[].pose_keypoints_2d`` holds 25 times x, y (pixels), score; a missing keypoint is 0 0 0.

COCO-17 has no neck, no middle of the hips and no feet. The writer places the neck and the middle of the hips halfway
between shoulders and hips, respectively, where both were detected, and leaves the feet missing. Boxes, descriptors and
heat maps have no place in the format.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17, Detections
from mvpose.arrays import Floats
from simharness.formats.read_errors import read_json

_WHAT = "OpenPose output of one image: {'people': [{'pose_keypoints_2d': [25 x (x, y, score)]}, ...]}"
_VERSION = 1.3  # of OpenPose's files
_OTHERS = ("face", "hand_left", "hand_right")
# fmt: off
BODY_25 = (
    "nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist",
    "mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle",
    "right_eye", "left_eye", "right_ear", "left_ear",
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe", "right_heel",
)
# fmt: on
BODY_25_OF_COCO17 = [BODY_25.index(joint) for joint in COCO17.joints]
"""Index in BODY_25 of each joint of COCO-17."""
_MIDDLES = {"neck": "shoulder", "mid_hip": "hip"}


def read_people(path: str | Path) -> tuple[Floats, Floats]:
    """Read the people of one image.

    Returns:
        COCO-17 keypoints, (n, 17, 2), pixels, NaN where missing, and their scores, (n, 17). Scores are clipped
        at 1: OpenPose reads them off an interpolated heat map that overshoots. People without any of the 17
        joints are left out.

    Raises:
        ValueError: the file does not exist, is truncated, or does not hold BODY_25 keypoints.
    """
    path = Path(path)
    people = read_json(path, what=_WHAT).get("people")
    if not isinstance(people, list):
        raise ValueError(f"{path}: no list 'people'; expected {_WHAT}")
    body = np.array([_keypoints(path, index, person) for index, person in enumerate(people)])
    coco = body.reshape(-1, 25, 3)[:, BODY_25_OF_COCO17]
    scores = np.clip(coco[..., 2], 0.0, 1.0)
    keypoints = np.where(scores[..., None] > 0, coco[..., :2], np.nan)
    detected = (scores > 0).any(axis=1)
    return keypoints[detected], scores[detected]


def read_frame(paths: Sequence[str | Path]) -> Detections:
    """Read one frame of all views.

    Args:
        paths: one file for each view, in the order of the rig's cameras.

    Returns:
        The people of all views on COCO-17; boxes enclose their keypoints.

    Raises:
        ValueError: as :func:`read_people`, for the first faulty file.
    """
    views = [read_people(path) for path in paths]
    return Detections.from_keypoints(
        np.repeat(np.arange(len(views)), [len(scores) for _, scores in views]),
        np.concatenate([np.zeros((0, len(COCO17), 2)), *(keypoints for keypoints, _ in views)]),
        np.concatenate([np.zeros((0, len(COCO17))), *(scores for _, scores in views)]),
    )


def people_file(keypoints: ArrayLike, scores: ArrayLike) -> dict[str, Any]:
    """Return OpenPose's file of one picture, JSON-ready. People without any keypoint are left out.

    Args:
        keypoints: COCO-17, (n, 17, 2), pixels; NaN where missing.
        scores: score of each keypoint, (n, 17); 0 where missing.
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


def _person(body: Floats) -> dict[str, Any]:
    person: dict[str, Any] = {"person_id": [-1], "pose_keypoints_2d": body.ravel().tolist()}
    person |= {f"{part}_keypoints_2d": [] for part in _OTHERS}
    return person | {f"{part}_keypoints_3d": [] for part in ("pose", *_OTHERS)}


def _keypoints(path: Path, index: int, person: Any) -> Floats:
    where = f"{path}: people[{index}]"
    if not isinstance(person, dict) or "pose_keypoints_2d" not in person:
        raise ValueError(f"{where} has no 'pose_keypoints_2d'; expected {_WHAT}")
    try:
        values = np.asarray(person["pose_keypoints_2d"], float)
    except (TypeError, ValueError):
        raise ValueError(f"{where}: pose_keypoints_2d holds something other than numbers; expected {_WHAT}") from None
    if values.shape != (75,):
        raise ValueError(
            f"{where}: pose_keypoints_2d must be 75 numbers (BODY_25), got {values.size}; "
            "run OpenPose with --model_pose BODY_25"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{where}: pose_keypoints_2d has values that are not finite")
    return values.reshape(25, 3)
