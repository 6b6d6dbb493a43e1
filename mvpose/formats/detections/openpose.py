"""OpenPose JSON: one file for each frame and view, BODY_25 keypoints or those of another skeleton.

``people[].pose_keypoints_2d`` holds x, y (pixels), score of each joint; a missing keypoint is 0 0 0.

COCO-17 has no neck, no middle of the hips and no feet. The writer places the neck and the middle of the hips halfway
between shoulders and hips, respectively, where both were detected, and leaves the feet missing. Boxes, descriptors and
heat maps have no place in the format.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose import COCO17, Detections
from mvpose.arrays import Floats
from mvpose.files.input_files import natural_order, read_json_object
from mvpose.formats.detection_files import DetectionFiles
from mvpose.formats.joint_names import BODY_25, KNOWN, JointNames, to_coco17
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
    keypoints, scores = to_coco17(*keypoints_of(path, people, skeleton), skeleton)
    detected = (scores > 0).any(axis=1)
    return keypoints[detected], scores[detected]


def keypoints_of(path: Path, people: Sequence[Any], skeleton: JointNames) -> tuple[Floats, Floats]:
    """Return the keypoints (n, J, 2) and scores (n, J) of ``people`` in a file, on its own skeleton.

    Raises:
        ValueError: a person without keypoints of the skeleton; the message names the file.
    """
    body = np.array([_keypoints(path, index, person, skeleton) for index, person in enumerate(people)])
    body = body.reshape(-1, len(skeleton), 3)
    return body[..., :2], body[..., 2]


def read_frame(paths: Sequence[str | Path], *, skeleton: JointNames = _BODY25) -> Detections:
    """Read one frame of all views.

    Args:
        paths: one file for each view, in the order of the rig's cameras.
        skeleton: joints of the files.

    Returns:
        The people of all views on COCO-17; boxes enclose their keypoints.

    Raises:
        ValueError: as :func:`read_people`, for the first faulty file.
    """
    views = [read_people(path, skeleton=skeleton) for path in paths]
    return Detections.from_keypoints(
        np.repeat(np.arange(len(views)), [len(scores) for _, scores in views]),
        np.concatenate([np.zeros((0, len(COCO17), 2)), *(keypoints for keypoints, _ in views)]),
        np.concatenate([np.zeros((0, len(COCO17))), *(scores for _, scores in views)]),
    )


def read_detections(files: DetectionFiles) -> tuple[Detections, ...]:
    """Read the requested frames from the folders ``path/CAMERA``.

    The files of a folder, sorted by the numbers in their names, belong to consecutive frames from ``files.first`` on;
    or, where there are as many as requested frames, which have gaps, to these in order.

    Raises:
        ValueError: a camera without folder or files, a requested frame without file, or a fault of a file.
    """
    paths = [_paths(files, camera) for camera in files.cameras]
    skeleton = files.skeleton or _BODY25
    return tuple(read_frame(of_frame, skeleton=skeleton) for of_frame in zip(*paths, strict=True))


def _paths(files: DetectionFiles, camera: str) -> list[Path]:
    """Return the file of a camera for each requested frame."""
    folder = files.path / camera
    paths = _files_of(folder)
    rows = files.frames - files.first
    if len(paths) == len(rows) <= rows.max():
        return paths
    if rows.min() < 0 or rows.max() >= len(paths):
        outside = files.frames[(rows < 0) | (rows >= len(paths))]
        raise ValueError(
            f"{folder}: has {len(paths)} files, of frames {files.first} to {files.first + len(paths) - 1}, but frame "
            f"{outside[0]} is requested; correct frames or first (the frame number of the first file)"
        )
    numbers = [int(found[-1]) for path in paths if (found := re.findall(r"\d+", path.stem))]
    steps = np.diff(numbers)
    if len(numbers) == len(paths) and steps.min(initial=2) == 1 < steps.max():
        hole = int(np.flatnonzero(steps > 1)[0])
        raise ValueError(
            f"{folder}: expected a file for every frame, but {paths[hole].name} is followed by {paths[hole + 1].name}; "
            "add the missing files: {'people': []} where nobody was detected"
        )
    return [paths[row] for row in rows]


def _files_of(folder: Path) -> list[Path]:
    parent = folder.parent
    if not os.path.isdir(folder):
        present = sorted(each.name for each in parent.iterdir() if each.is_dir()) if parent.is_dir() else []
        has = f"{parent} has the folders {', '.join(present)}" if present else f"{parent} has no folders"
        raise ValueError(
            f"{folder}: no such folder; expected OpenPose files of the camera {folder.name!r}; {has}. "
            "Name the folders as the cameras of the calibration, or select cameras"
        )
    paths = sorted(folder.glob("*.json"), key=natural_order)
    if not paths:
        raise ValueError(f"{folder}: has no *.json; expected {_WHAT}, one for each frame")
    return paths


def people_file(keypoints: ArrayLike, scores: ArrayLike, *, skeleton: Skeleton = COCO17) -> dict[str, Any]:
    """Return OpenPose's file of one picture, JSON-ready. People without any keypoint are left out.

    The file has BODY_25: joints that it does not know are left out, and of a skeleton without them neck and middle of
    the hips are the midpoints of shoulders and of hips.

    Args:
        keypoints: (n, J, 2), pixels; NaN where missing.
        scores: score of each keypoint, (n, J); 0 where missing.
        skeleton: the J joints, which contain those of COCO17.
    """
    keypoints, scores = np.asarray(keypoints, float), np.asarray(scores, float)
    triples = np.where(scores[..., None] > 0, np.concatenate([keypoints, scores[..., None]], axis=-1), 0.0)
    body = np.zeros((len(scores), len(BODY_25), 3))
    for row, joint in enumerate(BODY_25):
        if joint in skeleton.joints:
            body[:, row] = triples[:, skeleton.index(joint)]
    for joint, end in _MIDDLES.items():
        if joint in skeleton.joints:
            continue
        ends = triples[:, [skeleton.index(f"left_{end}"), skeleton.index(f"right_{end}")]]
        middle = np.concatenate([ends[..., :2].mean(axis=1), ends[..., 2:].min(axis=1)], axis=-1)
        body[:, BODY_25.index(joint)] = np.where(middle[:, 2:] > 0, middle, 0.0)
    return {"version": _VERSION, "people": [_person(each) for each in body[(scores > 0).any(axis=1)]]}


def _person(body: Floats) -> dict[str, Any]:
    person: dict[str, Any] = {"person_id": [-1], "pose_keypoints_2d": body.ravel().tolist()}
    person |= {f"{part}_keypoints_2d": [] for part in _OTHERS}
    return person | {f"{part}_keypoints_3d": [] for part in ("pose", *_OTHERS)}


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
