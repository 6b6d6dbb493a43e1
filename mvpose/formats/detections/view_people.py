"""People of one camera in all its pictures, read from the files of several programs.

- OpenPose, Pose2Sim: a folder with a JSON file for each picture,
  ``{"people": [{"pose_keypoints_2d": [x, y, score, ...]}]}``;
- COCO results, AlphaPose: a JSON list, ``[{"image_id", "keypoints": [x, y, score, ...], "score", "bbox" or "box"}]``;
- MMPose: a JSON list, or ``instance_info`` of an object, ``[{"frame_id", "instances": [{"keypoints",
  "keypoint_scores"}]}]``;
- RTMLib: its arrays, frame by frame, JSON ``[{"keypoints": (n, J, 2), "scores": (n, J)}]``, or npz with these names.

The skeleton is that which is declared, or else the usual one with this number of joints. Everything becomes COCO-17, or
stays on its skeleton where all joints are requested and :mod:`mvpose.wholebody` knows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.archives import arrays_of
from mvpose.files.input_files import file_numbers, natural_order, read_bytes, read_json
from mvpose.files.message_text import listed, shown
from mvpose.formats.detections import coco_results, openpose
from mvpose.formats.detections.sources import SUFFIXES, Source
from mvpose.formats.joint_names import KNOWN, JointNames, to_coco17
from mvpose.skeleton import COCO17
from mvpose.wholebody import known_names

USUAL = {
    len(KNOWN[name]): KNOWN[name] for name in ("coco17", "coco18", "body25", "halpe26", "wholebody133", "halpe136")
}
"""Skeleton by its number of joints, where none is declared."""

_WHAT = "detections of one camera: OpenPose, COCO or AlphaPose results, MMPose predictions or RTMLib arrays"
_GREATEST_SCORE = 2.0  # heat maps and SimCC overshoot 1, mostly by a few per cent; 2 is a visible joint of COCO


@dataclass(frozen=True)
class Picture:
    """People in one picture.

    Attributes:
        keypoints: (n, J, 2), pixels; NaN where missing.
        scores: (n, J), 0 to 1; 0 where missing.
        boxes: x, y, width, height, (n, 4), pixels; NaN in the row of a person without box.
        box_scores: (n,), 0 to 1; NaN for a person without one.
        joints: the J joints.
    """

    keypoints: Floats
    scores: Floats
    boxes: Floats
    box_scores: Floats
    joints: JointNames = KNOWN["coco17"]

    def __len__(self) -> int:
        return len(self.scores)


@dataclass(frozen=True)
class ViewPeople:
    """People of one camera.

    Attributes:
        source: where they were read.
        pictures: by the number of the frame, increasing.
        complete: whether pictures without people are among them.
        kind: the layout of the files: "OpenPose", "COCO", "MMPose" or "RTMLib".
    """

    source: Source
    pictures: Mapping[int, Picture]
    complete: bool
    kind: str


def read_view(source: Source, *, skeleton: JointNames | None = None, all_joints: bool = False) -> ViewPeople:
    """Read the people of one camera, without those of whom no joint of COCO-17 was detected.

    Args:
        source: its folder or file.
        skeleton: joints of the files; None: by their number.
        all_joints: keep the joints beyond COCO-17.

    Raises:
        ValueError: a file that cannot be read, is of no known layout, has an unknown number of joints, or scores that
            are not 0..1; no picture at all; or all joints are requested of a skeleton that is not shipped.
    """
    if source.path.is_dir():
        view = _read_folder(source, skeleton)
    elif source.path.suffix.lower() == ".npz":
        view = _read_arrays(source, skeleton)
    else:
        view = _read_file(source, skeleton)
    convert = _whole if all_joints else _body
    return replace(view, pictures={number: convert(source.path, each) for number, each in view.pictures.items()})


def _body(_: Path, picture: Picture) -> Picture:
    """Return a picture on COCO-17."""
    keypoints, scores = to_coco17(picture.keypoints, picture.scores, picture.joints)
    return _with_somebody(replace(picture, keypoints=keypoints, scores=scores, joints=KNOWN["coco17"]))


def _whole(path: Path, picture: Picture) -> Picture:
    """Return a picture on its own skeleton."""
    joints = picture.joints
    if joints.name not in KNOWN and joints.joints[:17] == COCO17.joints:
        joints = USUAL.get(len(joints), joints)  # MMPose has other names for the points of hands and faces
    if joints.name not in (*known_names(), "coco17"):
        raise ValueError(
            f"{path}: all joints of the skeleton {joints.name} are requested; expected one of "
            f"{', '.join(known_names())}, or a TOML file that describes it; or take those of the body only"
        )
    scores = np.clip(np.nan_to_num(picture.scores), 0.0, 1.0)
    keypoints = np.where(scores[..., None] > 0, picture.keypoints, np.nan)
    return _with_somebody(replace(picture, keypoints=keypoints, scores=scores, joints=joints))


def _with_somebody(picture: Picture) -> Picture:
    """Return a picture without people of whom none of the 17 joints was detected."""
    rows = picture.joints.rows(COCO17.joints)
    some = (picture.scores[:, rows[rows >= 0]] > 0).any(axis=1)
    parts = (picture.keypoints[some], picture.scores[some], picture.boxes[some], picture.box_scores[some])
    return Picture(*parts, picture.joints)


def _read_folder(source: Source, skeleton: JointNames | None) -> ViewPeople:
    """Read a folder with a file for each picture."""
    files = sorted((each for each in source.path.iterdir() if each.suffix.lower() in SUFFIXES), key=natural_order)
    if not files:
        raise ValueError(f"{source.path}: an empty folder; expected a *.json file for each picture")
    pictures, kind = {}, "OpenPose"
    for number, file in zip(file_numbers(files), files, strict=True):
        content = read_json(file, what=_WHAT)
        if isinstance(content, dict) and "people" in content:
            pictures[number] = _of_openpose(file, content["people"], skeleton)
        elif _is_instances(content) or (isinstance(content, dict) and isinstance(content.get("instances"), list)):
            instances = content["instances"] if isinstance(content, dict) else content
            pictures[number], kind = _of_instances(file, instances, skeleton), "MMPose"
        else:
            raise ValueError(
                f"{file}: expected the people of one picture, {{'people': [...]}}, got {_summary(content)}"
            )
    return ViewPeople(source, dict(sorted(pictures.items())), complete=True, kind=kind)


def _read_file(source: Source, skeleton: JointNames | None) -> ViewPeople:
    """Read one file of all pictures."""
    path = source.path
    content = read_json(path, what=_WHAT)
    if isinstance(content, dict):
        if isinstance(content.get("instance_info"), list):
            return _of_frames(source, content["instance_info"], skeleton or _named_joints(path, content))
        if "people" in content:
            return ViewPeople(source, {0: _of_openpose(path, content["people"], skeleton)}, True, "OpenPose")
        if "annotations" in content:
            raise ValueError(
                f"{path}: COCO annotations; expected COCO results, a list of {{image_id, keypoints, score}}"
            )
        raise ValueError(f"{path}: expected {_WHAT}; got {_summary(content)}")
    if not isinstance(content, list) or not all(isinstance(each, dict) for each in content):
        raise ValueError(f"{path}: expected {_WHAT}; got {_summary(content)}")
    if not content:
        raise ValueError(f"{path}: an empty list, of a camera without any detection; leave the camera out (--cameras)")
    if "image_id" in content[0]:
        return ViewPeople(source, _of_coco(path, content, skeleton), complete=False, kind="COCO")
    if "instances" in content[0]:
        return _of_frames(source, content, skeleton)
    if _is_instances(content):
        return ViewPeople(source, {0: _of_instances(path, content, skeleton)}, True, "MMPose")
    if {"keypoints", "scores"} <= content[0].keys():
        pictures = {
            k: _picture(f"{path}: frame {k}", frame.get("keypoints"), frame.get("scores"), skeleton)
            for k, frame in enumerate(content)
        }
        return ViewPeople(source, pictures, complete=True, kind="RTMLib")
    raise ValueError(f"{path}: expected {_WHAT}; got {_summary(content)}")


def _read_arrays(source: Source, skeleton: JointNames | None) -> ViewPeople:
    """Read arrays keypoints (T, n, J, 2) or (T, J, 2) and scores."""
    path = source.path
    try:
        arrays = arrays_of(read_bytes(path, what=_WHAT), only=("keypoints", "scores"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}; expected the arrays keypoints and scores") from None
    keypoints, scores = arrays.get("keypoints"), arrays.get("scores")
    if keypoints is None or scores is None or keypoints.ndim not in (3, 4) or keypoints.shape[:-1] != scores.shape:
        raise ValueError(f"{path}: expected arrays keypoints (T, n, J, 2) and scores (T, n, J), got {sorted(arrays)}")
    if keypoints.ndim == 3:
        keypoints, scores = keypoints[:, None], scores[:, None]
    pictures = {k: _picture(f"{path}: frame {k}", keypoints[k], scores[k], skeleton) for k in range(len(keypoints))}
    return ViewPeople(source, pictures, complete=True, kind="RTMLib")


def _of_openpose(path: Path, people: Any, skeleton: JointNames | None) -> Picture:
    if not isinstance(people, list):
        raise ValueError(f"{path}: people must be a list, got {shown(people)}")
    if skeleton is None and people and isinstance(people[0], dict):
        values = people[0].get("pose_keypoints_2d")
        skeleton = _usual(path, len(values) // 3 if isinstance(values, list) else 0)
    keypoints, scores = openpose.keypoints_of(path, people, skeleton or KNOWN["body25"])
    _check_scores(path, scores)
    return _read(keypoints, scores, skeleton or KNOWN["body25"])


def _of_coco(path: Path, entries: Sequence[Any], skeleton: JointNames | None) -> dict[int, Picture]:
    """Return the pictures of COCO results; AlphaPose's have the names of files as image_id, and ``box``."""
    rows: dict[int, list[tuple[Floats, Any, Any]]] = {}
    for index, entry in enumerate(entries):
        if skeleton is None:
            skeleton = _usual(path, np.size(entry.get("keypoints", ())) // 3)
        frame = coco_results.frame_of(path, index, entry)
        box, score = coco_results.box_of(path, index, entry)
        rows.setdefault(frame, []).append((coco_results.keypoints_of(path, index, entry, skeleton), box, score))
    assert skeleton is not None, "there is an entry"
    pictures = {}
    for frame in sorted(rows):
        values = np.stack([each for each, _, _ in rows[frame]])
        _check_scores(path, values[..., 2])
        boxes = [np.full(4, np.nan) if box is None else box for _, box, _ in rows[frame]]
        scores = [np.nan if score is None else min(max(score, 0.0), 1.0) for _, _, score in rows[frame]]
        pictures[frame] = _read(values[..., :2], values[..., 2], skeleton, boxes, scores)
    return pictures


def _of_frames(source: Source, frames: Sequence[Any], skeleton: JointNames | None) -> ViewPeople:
    """Return the people of MMPose's frames, which count from 0 or 1."""
    pictures = {}
    for row, frame in enumerate(frames):
        if not isinstance(frame, dict) or not isinstance(frame.get("instances"), list):
            raise ValueError(f"{source.path}: entry {row}: expected frame_id and instances, got {shown(frame)}")
        number = frame.get("frame_id", row)
        if not isinstance(number, int) or number in pictures:
            raise ValueError(f"{source.path}: entry {row}: frame_id must be a different number, got {shown(number)}")
        pictures[number] = _of_instances(source.path, frame["instances"], skeleton)
    return ViewPeople(source, dict(sorted(pictures.items())), complete=True, kind="MMPose")


def _of_instances(path: Path, instances: Sequence[Any], skeleton: JointNames | None) -> Picture:
    """Return the people of one picture of MMPose; ``bbox`` holds corners, in a list of one."""
    if not all(isinstance(each, dict) and {"keypoints", "keypoint_scores"} <= each.keys() for each in instances):
        raise ValueError(f"{path}: instances must have keypoints and keypoint_scores; got {_summary(list(instances))}")
    boxes = []
    for each in instances:
        corners = np.asarray(each.get("bbox", ()), dtype=object).ravel()
        numbers = len(corners) == 4 and all(isinstance(value, int | float) for value in corners)
        x0, y0, x1, y1 = corners.astype(float) if numbers else (np.nan,) * 4
        boxes.append([x0, y0, x1 - x0, y1 - y0])
    scores = [each.get("bbox_score") for each in instances]
    return _picture(
        str(path),
        [each["keypoints"] for each in instances],
        [each["keypoint_scores"] for each in instances],
        skeleton,
        boxes,
        [min(max(float(each), 0.0), 1.0) if isinstance(each, int | float) else np.nan for each in scores],
    )


def _picture(
    where: str, keypoints: Any, scores: Any, skeleton: JointNames | None, boxes: Any = None, box_scores: Any = None
) -> Picture:
    """Return a picture of arrays keypoints (n, J, 2) and scores (n, J)."""
    try:
        keypoints, scores = np.asarray(keypoints, float), np.asarray(scores, float)
    except (TypeError, ValueError):
        raise ValueError(f"{where}: keypoints and scores must be numbers, (n, J, 2) and (n, J)") from None
    if not keypoints.size and not scores.size:
        return _read(np.zeros((0, 17, 2)), np.zeros((0, 17)), KNOWN["coco17"])
    if keypoints.ndim != 3 or keypoints.shape[2] != 2 or scores.shape != keypoints.shape[:2]:
        raise ValueError(
            f"{where}: keypoints must be (n, J, 2) and scores (n, J), got {keypoints.shape} and {scores.shape}"
        )
    names = skeleton or _usual(where, keypoints.shape[1])
    if len(names) != keypoints.shape[1]:
        raise ValueError(f"{where}: has {keypoints.shape[1]} joints, but skeleton {names.name} has {len(names)}")
    _check_scores(where, scores)
    return _read(keypoints, scores, names, boxes, box_scores)


def _read(
    keypoints: Floats, scores: Floats, skeleton: JointNames, boxes: Any = None, box_scores: Any = None
) -> Picture:
    """Return a picture with the joints of a file."""
    boxes = np.full((len(scores), 4), np.nan) if boxes is None else np.asarray(boxes, float).reshape(-1, 4)
    box_scores = np.full(len(scores), np.nan) if box_scores is None else np.asarray(box_scores, float)
    bad = ~np.isfinite(boxes).all(axis=1) | (boxes[:, 2:] < 0).any(axis=1)
    boxes = np.where(bad[:, None], np.nan, boxes)
    return Picture(keypoints, scores, boxes, box_scores, skeleton)


def _usual(where: object, joints: int) -> JointNames:
    if joints not in USUAL:
        known = listed([f"{name.name} ({count})" for count, name in USUAL.items()])
        raise ValueError(f"{where}: has {joints} joints a person; expected {known}, or a --skeleton by its name")
    return USUAL[joints]


def _check_scores(where: object, scores: Floats) -> None:
    """Check that scores are about 0 to 1; those slightly above 1 are clipped later.

    Raises:
        ValueError: per cent, logits, or heights of other scale.
    """
    if scores.size and np.nanmax(scores) > _GREATEST_SCORE:
        raise ValueError(
            f"{where}: scores must lie in 0..1, got {np.nanmax(scores):.6g}; divide per cent by 100, take the sigmoid "
            "of logits"
        )


def _is_instances(content: Any) -> bool:
    return (
        bool(content) and isinstance(content, list) and isinstance(content[0], dict) and "keypoint_scores" in content[0]
    )


def _named_joints(path: Path, content: Mapping[str, Any]) -> JointNames | None:
    """Return the skeleton that MMPose states in ``meta_info``; None without one."""
    about = content.get("meta_info")
    names = about.get("keypoint_id2name") if isinstance(about, dict) else None
    if not isinstance(names, dict) or not all(str(k) in names for k in range(len(names))) or not names:
        return None
    return JointNames(path.stem, tuple(str(names[str(k)]) for k in range(len(names))))


def _summary(content: Any) -> str:
    """Return the kind and the keys of a JSON value, for messages."""
    if isinstance(content, dict):
        return f"an object with {_keys(content)}"
    if not isinstance(content, list):
        return f"{shown(content)}, no object or list"
    if content and isinstance(content[0], dict):
        return f"a list of objects with {_keys(content[0])}"
    return f"a list that begins with {shown(content[0])}" if content else "an empty list"


def _keys(content: Mapping[str, Any]) -> str:
    return f"the keys {listed(list(content))}" if content else "no keys"
