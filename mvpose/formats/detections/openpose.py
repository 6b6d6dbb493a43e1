"""OpenPose JSON: one file for each frame and view, BODY_25 keypoints or those of another skeleton.

``people[].pose_keypoints_2d`` holds x, y (pixels), score of each joint; a missing keypoint is 0 0 0.

COCO-17 has no neck, no middle of the hips and no feet. The writer places the neck and the middle of the hips halfway
between shoulders and hips, respectively, where both were detected, and leaves the feet missing. Boxes, descriptors and
heat maps have no place in the format.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17, Detections
from mvpose.arrays import Floats
from mvpose.files.input_files import read_json_object
from mvpose.files.message_text import shown
from mvpose.formats.detections.detection_file import (
    DetectionFile,
    DetectionFormat,
    PicturePeople,
    nameless_skeleton,
    picture_people,
)
from mvpose.formats.joint_names import KNOWN, JointNames, to_coco17
from mvpose.skeleton import Skeleton

_WHAT = "OpenPose output of one image: {'people': [{'pose_keypoints_2d': [25 x (x, y, score)]}, ...]}"
_BODY25 = KNOWN["body25"]
_VERSION = 1.3  # of OpenPose's files
_OTHERS = ("face", "hand_left", "hand_right")
_MIDDLES = {"neck": "shoulder", "mid_hip": "hip"}


def read_people(path: str | Path, *, skeleton: JointNames = _BODY25) -> tuple[Floats, Floats]:
    """Read the people of one image.

    Args:
        path: the file.
        skeleton: joints of the file.

    Returns:
        COCO-17 keypoints, (n, 17, 2), pixels, NaN where missing, and their scores, (n, 17). Scores are clipped
        at 1: OpenPose reads them off an interpolated heat map that overshoots. People without any of the 17
        joints are left out.

    Raises:
        ValueError: the file does not exist, is truncated, or does not hold keypoints of the skeleton.
    """
    path = Path(path)
    people = read_json_object(path, what=_WHAT).get("people")
    if not isinstance(people, list):
        raise ValueError(f"{path}: no list 'people'; expected {_WHAT}")
    keypoints, scores = to_coco17(*_values(path, people, skeleton), skeleton)
    detected = (scores > 0).any(axis=1)
    return keypoints[detected], scores[detected]


def _values(path: Path, people: Sequence[Any], skeleton: JointNames) -> tuple[Floats, Floats]:
    """Return the keypoints (n, J, 2) and scores (n, J) of ``people`` in a file, on its own skeleton."""
    detected = [(index, person) for index, person in enumerate(people) if not _is_empty(person)]
    body = np.array([_keypoints(path, index, person, skeleton) for index, person in detected])
    body = body.reshape(-1, len(skeleton), 3)
    return body[..., :2], body[..., 2]


def _read(file: DetectionFile, skeleton: JointNames | None) -> dict[int, PicturePeople]:
    """Read the people of a picture."""
    people = file.object.get("people")
    if not isinstance(people, list):
        raise ValueError(f"{file.path}: people must be a list, got {shown(people)}")
    first = next((each for each in people if not _is_empty(each)), None)
    if skeleton is None and isinstance(first, dict):
        values = first.get("pose_keypoints_2d")
        skeleton = nameless_skeleton(len(values) // 3) if isinstance(values, list) and len(values) > 2 else None
    return {0: picture_people(file.path, *_values(file.path, people, skeleton or _BODY25), skeleton or _BODY25)}


FORMAT = DetectionFormat("OpenPose", lambda file: "people" in file.object, _read, lambda file: "people" in file.object)


def read_frame(paths: Sequence[str | Path]) -> Detections:
    """Read one frame of all views.

    Args:
        paths: one file of the 25 joints for each view, in the order of the rig's cameras.

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


def people_file(keypoints: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton = COCO17) -> dict[str, Any]:
    """Return OpenPose's file of one picture, JSON-ready. People without any keypoint are left out.

    The file has the joints of :func:`to_body25`.

    Args:
        keypoints: (n, J, 2), pixels; NaN where missing.
        scores: score of each keypoint, (n, J); 0 where missing.
        skeleton: the J joints, which contain those of COCO17.
    """
    body, certain = to_body25(keypoints, scores, skeleton=skeleton)
    triples = np.concatenate([body, certain[..., None]], axis=-1)
    return {"version": _VERSION, "people": [_person(each) for each in triples[(np.asarray(scores) > 0).any(axis=1)]]}


def to_body25(values: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton = COCO17) -> tuple[Floats, Floats]:
    """Return poses on BODY_25, (n, 25, D), and their scores, (n, 25); both are 0 where a joint is missing.

    Joints that BODY_25 does not know are left out; of a skeleton without them neck and middle of the hips are the
    midpoints of shoulders and of hips, with the lower of their scores.

    Args:
        values: pixels or metres, (n, J, D); NaN where missing.
        scores: score of each joint, (n, J); 0 where missing.
        skeleton: the J joints, which contain those of COCO17.
    """
    values, scores = np.asarray(values, float), np.asarray(scores, float)
    values = np.where(scores[..., None] > 0, values, 0.0)
    body, certain = np.zeros((len(scores), len(_BODY25), values.shape[-1])), np.zeros((len(scores), len(_BODY25)))
    for row, joint in enumerate(_BODY25.joints):
        ends = [skeleton.index(joint)] if joint in skeleton.joints else []
        if not ends and joint in _MIDDLES:
            ends = [skeleton.index(f"{side}_{_MIDDLES[joint]}") for side in ("left", "right")]
        if ends:
            certain[:, row] = scores[:, ends].min(axis=1)
            body[:, row] = np.where(certain[:, row, None] > 0, values[:, ends].mean(axis=1), 0.0)
    return body, certain


def _person(body: Floats) -> dict[str, Any]:
    person: dict[str, Any] = {"person_id": [-1], "pose_keypoints_2d": body.ravel().tolist()}
    person |= {f"{part}_keypoints_2d": [] for part in _OTHERS}
    return person | {f"{part}_keypoints_3d": [] for part in ("pose", *_OTHERS)}


def _is_empty(person: Any) -> bool:
    """Return whether a person was not detected: Pose2Sim leaves empty lists where it removes one."""
    return isinstance(person, dict) and person.get("pose_keypoints_2d") == []


def _keypoints(path: Path, index: int, person: Any, skeleton: JointNames) -> Floats:
    where = f"{path}: people[{index}]"
    if not isinstance(person, dict) or "pose_keypoints_2d" not in person:
        raise ValueError(f"{where} has no 'pose_keypoints_2d'; expected {_WHAT}")
    try:
        values = np.asarray(person["pose_keypoints_2d"], float)
    except (TypeError, ValueError):
        raise ValueError(f"{where}: pose_keypoints_2d holds something other than numbers; expected {_WHAT}") from None
    count = 3 * len(skeleton)
    if values.shape != (count,):
        body25 = skeleton == _BODY25
        mend = "run OpenPose with --model_pose BODY_25" if body25 else "correct the skeleton"
        raise ValueError(
            f"{where}: pose_keypoints_2d must be {count} numbers ({'BODY_25' if body25 else skeleton.name}), got "
            f"{values.size}; {mend}"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{where}: pose_keypoints_2d has values that are not finite")
    return values.reshape(len(skeleton), 3)
