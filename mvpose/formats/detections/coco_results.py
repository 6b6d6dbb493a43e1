"""COCO keypoint results (JSON), one file for each camera: ``[{image_id, keypoints, score, bbox}, ...]``.

``image_id`` is the number of the frame, ``keypoints`` x, y (pixels), score of each joint, ``score`` that of the person
and ``bbox``, which is optional, x, y, width, height in pixels. People of all frames are in one list, in any order.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose import COCO17, Detections
from mvpose.arrays import Floats
from mvpose.files.input_files import read_json
from mvpose.files.message_text import shown
from mvpose.formats.detection_files import DetectionFiles
from mvpose.formats.joint_names import KNOWN, JointNames, to_coco17

_WHAT = "COCO keypoint results: a list of {image_id, keypoints: [x, y, score, ...], score, bbox}"


def read_detections(files: DetectionFiles) -> tuple[Detections, ...]:
    """Read the requested frames from the files ``path/CAMERA.json``. A frame without entries has no detections.

    People without a box get the one that spans their keypoints, and without a score the mean of their joints. Scores
    are clipped to 0..1.

    Raises:
        ValueError: a camera without file, a file of another layout, or no entry in any requested frame.
    """
    skeleton = files.skeleton or KNOWN["coco17"]
    wanted = set(files.frames.tolist())
    frames: dict[int, list[tuple[int, Mapping[str, Any], Floats]]] = defaultdict(list)
    for view, camera in enumerate(files.cameras):
        path = files.path / f"{camera}.json"
        found = set()
        for index, entry in enumerate(_entries(path)):
            frame = frame_of(path, index, entry)
            found.add(frame)
            if frame in wanted:
                box_of(path, index, entry)
                frames[frame].append((view, entry, keypoints_of(path, index, entry, skeleton)))
        if found and not found & wanted:
            raise ValueError(
                f"{path}: has image_id {min(found)} to {max(found)}, none of the requested frames {min(wanted)} to "
                f"{max(wanted)}; expected the numbers of the frames as image_id"
            )
    return tuple(_detections(frames[frame], skeleton) for frame in files.frames.tolist())


def _entries(path: Path) -> list[Mapping[str, Any]]:
    entries = read_json(path, what=_WHAT)
    if not isinstance(entries, list) or not all(isinstance(each, dict) for each in entries):
        raise ValueError(f"{path}: expected {_WHAT}, got a {type(entries).__name__}")
    return entries


def frame_of(path: Path, index: int, entry: Mapping[str, Any]) -> int:
    """Return the frame of an entry: the number ``image_id``, or the last number in it where it is a file's name.

    Raises:
        ValueError: no number.
    """
    image = entry.get("image_id")
    if isinstance(image, str) and (digits := re.findall(r"\d+", Path(image).stem)):
        return int(digits[-1])
    try:
        return int(entry["image_id"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise ValueError(
            f"{path}: entry {index}: expected image_id, the number of the frame, got {shown(entry.get('image_id'))}"
        ) from None


def box_of(path: Path, index: int, entry: Mapping[str, Any]) -> tuple[list[float] | None, float | None]:
    """Return the box (``bbox``, or ``box`` of AlphaPose) and the score of an entry; None where it has none.

    Raises:
        ValueError: a box that is not four numbers, or a score that is no number.
    """
    box, score = entry.get("bbox", entry.get("box")), entry.get("score")
    if box is not None and not (isinstance(box, list) and len(box) == 4 and all(map(_is_number, box))):
        raise ValueError(f"{path}: entry {index}: bbox must be x, y, width, height in pixels, got {shown(box)}")
    if score is not None and not _is_number(score):
        raise ValueError(f"{path}: entry {index}: score must be a number, got {shown(score)}")
    return box, score


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def keypoints_of(path: Path, index: int, entry: Mapping[str, Any], skeleton: JointNames) -> Floats:
    """Return the keypoints and scores of an entry, (J, 3).

    Raises:
        ValueError: no numbers, or those of another number of joints.
    """
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


def _detections(people: Sequence[tuple[int, Mapping[str, Any], Floats]], skeleton: JointNames) -> Detections:
    if not people:
        return Detections.empty(COCO17)
    values = np.stack([each for _, _, each in people])
    keypoints, scores = to_coco17(values[..., :2], values[..., 2], skeleton)
    spanned = Detections.from_keypoints([view for view, _, _ in people], keypoints, scores)
    boxes, box_scores = spanned.boxes.copy(), spanned.box_scores.copy()
    for row, (_, entry, _) in enumerate(people):
        if entry.get("bbox") is not None:
            boxes[row] = entry["bbox"]
        if entry.get("score") is not None:
            box_scores[row] = min(max(entry["score"], 0.0), 1.0)
    return Detections(spanned.view, keypoints, scores, boxes, box_scores)
