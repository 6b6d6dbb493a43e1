"""COCO keypoint results (JSON), one file for each camera: ``[{image_id, keypoints, score, bbox}, ...]``.

``image_id`` is the number of the frame, or the name of a picture's file that ends in it (AlphaPose); ``keypoints`` x, y
(pixels), score of each joint, ``score`` that of the person and ``bbox`` (AlphaPose: ``box``), which is optional, x, y,
width, height in pixels. People of all frames are in one list, in any order; a frame without people has no entry.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.message_text import shown
from mvpose.formats.detections import detection_file
from mvpose.formats.joint_names import KNOWN, JointNames

_WHAT = "COCO keypoint results: a list of {image_id, keypoints: [x, y, score, ...], score, bbox}"


def _read(file: detection_file.DetectionFile, skeleton: JointNames | None) -> dict[int, detection_file.PicturePeople]:
    path, content = file.path, file.json
    if not isinstance(content, list) or not all(isinstance(each, dict) for each in content):
        raise ValueError(f"{path}: expected {_WHAT}, got a {type(content).__name__}")
    rows: dict[int, list[tuple[Floats, Any, Any]]] = {}
    for index, entry in enumerate(content, file.first):
        frame, (box, score) = _frame(path, index, entry), _box(path, index, entry)
        if entry.get("keypoints") == []:  # not detected
            rows.setdefault(frame, [])
            continue
        if skeleton is None and "keypoints" in entry:
            skeleton = detection_file.nameless_skeleton(max(np.size(np.asarray(entry["keypoints"], object)) // 3, 1))
        rows.setdefault(frame, []).append((_keypoints(path, index, entry, skeleton or KNOWN["coco17"]), box, score))
    pictures = {}
    for frame in sorted(rows):
        if not rows[frame]:
            pictures[frame] = detection_file.PicturePeople.nobody()
            continue
        values = np.stack([each for each, _, _ in rows[frame]])
        boxes = [np.full(4, np.nan) if box is None else box for _, box, _ in rows[frame]]
        scores = [np.nan if score is None else min(max(score, 0.0), 1.0) for _, _, score in rows[frame]]
        pictures[frame] = detection_file.picture_people(path, values[..., :2], values[..., 2], skeleton, boxes, scores)
    return pictures


def _recognises(file: detection_file.DetectionFile) -> bool:
    return file.json == [] or (bool(file.entries) and "image_id" in file.entries[0])  # of a camera that saw nobody


FORMAT = detection_file.DetectionFormat("COCO", _recognises, _read, complete=False)


def _frame(path: Path, index: int, entry: Mapping[str, Any]) -> int:
    """Return the frame of an entry: the number ``image_id``, or the last number in it where it is a file's name."""
    image = entry.get("image_id")
    if isinstance(image, str) and (digits := re.findall(r"\d+", Path(image).stem)):
        return int(digits[-1])
    try:
        return int(entry["image_id"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(
            f"{path}: entry {index}: expected image_id, the number of the frame, got {shown(entry.get('image_id'))}"
        ) from None


def _box(path: Path, index: int, entry: Mapping[str, Any]) -> tuple[list[float] | None, float | None]:
    """Return the box and the score of an entry; None where it has none."""
    box, score = entry.get("bbox", entry.get("box")), entry.get("score")
    if box is not None and not (isinstance(box, list) and len(box) == 4 and all(map(_is_number, box))):
        raise ValueError(f"{path}: entry {index}: bbox must be x, y, width, height in pixels, got {shown(box)}")
    if score is not None and not _is_number(score):
        raise ValueError(f"{path}: entry {index}: score must be a number, got {shown(score)}")
    return box, score


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _keypoints(path: Path, index: int, entry: Mapping[str, Any], skeleton: JointNames) -> Floats:
    """Return the keypoints and scores of an entry, (J, 3)."""
    try:
        values = np.asarray(entry["keypoints"], float).ravel()
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{path}: entry {index}: no numbers 'keypoints'; expected {_WHAT}") from None
    if values.size != 3 * len(skeleton):
        raise ValueError(
            f"{path}: entry {index}: keypoints must be {3 * len(skeleton)} numbers, x, y, score of the "
            f"{len(skeleton)} joints of {skeleton.name}, got {values.size}; correct the skeleton"
        )
    return values.reshape(len(skeleton), 3)
