"""Predictions of MMPose: a JSON list, or ``instance_info`` of an object, with ``instances`` (people) of each frame.

A frame is ``{"frame_id", "instances": [{"keypoints", "keypoint_scores", "bbox", "bbox_score"}]}``. Where a file holds
one picture, it is the instances themselves, or an object with them.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.files.message_text import shown
from mvpose.formats.detections import detection_file
from mvpose.formats.joint_names import KNOWN, JointNames, canonical


def _recognises(file: detection_file.DetectionFile) -> bool:
    if isinstance(file.object.get("instance_info"), list) or _is_of_picture(file):
        return True
    return bool(file.entries) and "instances" in file.entries[0] and "image_id" not in file.entries[0]


def _is_of_picture(file: detection_file.DetectionFile) -> bool:
    if isinstance(file.json, list):
        return bool(file.json) and isinstance(file.json[0], dict) and "keypoint_scores" in file.json[0]
    return isinstance(file.object.get("instances"), list)


def _read(file: detection_file.DetectionFile, skeleton: JointNames | None) -> dict[int, detection_file.PicturePeople]:
    if _is_of_picture(file):
        return {0: _people(file.path, file.object.get("instances", file.json), skeleton)}
    info = file.object.get("instance_info")
    if isinstance(info, list):
        return _frames(file.path, info, skeleton or _named_joints(file.path, file.object))
    return _frames(file.path, file.json, skeleton, file.first)


def _frames(
    path: Path, frames: Any, skeleton: JointNames | None, first: int = 0
) -> dict[int, detection_file.PicturePeople]:
    """Return the people of frames, which count from 0 or 1; ``first`` is the row of the first one."""
    pictures = {}
    for row, frame in enumerate(frames if isinstance(frames, list) else [frames], first):
        if not isinstance(frame, dict) or not isinstance(frame.get("instances"), list):
            raise ValueError(f"{path}: entry {row}: expected frame_id and instances, got {shown(frame)}")
        number = frame.get("frame_id", row)
        if not isinstance(number, int) or number in pictures:
            raise ValueError(f"{path}: entry {row}: frame_id must be a different number, got {shown(number)}")
        pictures[number] = _people(path, frame["instances"], skeleton)
    return pictures


def _people(path: Path, instances: Sequence[Any], skeleton: JointNames | None) -> detection_file.PicturePeople:
    """Return the people of one picture; ``bbox`` holds corners, in a list of one."""
    instances = [each for each in instances if not (isinstance(each, dict) and each.get("keypoints") == [])]
    if not all(isinstance(each, dict) and {"keypoints", "keypoint_scores"} <= each.keys() for each in instances):
        raise ValueError(
            f"{path}: instances must have keypoints and keypoint_scores; got {detection_file.summary(list(instances))}"
        )
    boxes = []
    for each in instances:
        corners = np.asarray(each.get("bbox", ()), dtype=object).ravel()
        numbers = len(corners) == 4 and all(isinstance(value, int | float) for value in corners)
        x0, y0, x1, y1 = corners.astype(float) if numbers else (np.nan,) * 4
        boxes.append([x0, y0, x1 - x0, y1 - y0])
    scores = [each.get("bbox_score") for each in instances]
    return detection_file.picture_people(
        path,
        [each["keypoints"] for each in instances],
        [each["keypoint_scores"] for each in instances],
        skeleton,
        boxes,
        [min(max(float(each), 0.0), 1.0) if isinstance(each, int | float) else np.nan for each in scores],
    )


def _named_joints(path: Path, content: Mapping[str, Any]) -> JointNames | None:
    """Return the skeleton that ``meta_info`` states; None without one."""
    about = content.get("meta_info")
    names = about.get("keypoint_id2name") if isinstance(about, dict) else None
    if not isinstance(names, dict) or not all(str(k) in names for k in range(len(names))) or not names:
        return None
    own = JointNames(path.stem, tuple(str(names[str(k)]) for k in range(len(names))))
    return next((each for each in KNOWN.values() if _is_same(own, each)), own)


def _is_same(own: JointNames, known: JointNames) -> bool:
    """Return whether a skeleton is a known one; MMPose has other names for the points of hands and faces."""
    return len(own) == len(known) and all(
        canonical(name) == joint or joint.startswith(("face_", "left_hand_", "right_hand_"))
        for name, joint in zip(own.joints, known.joints, strict=True)
    )


FORMAT = detection_file.DetectionFormat("MMPose", _recognises, _read, _is_of_picture)
