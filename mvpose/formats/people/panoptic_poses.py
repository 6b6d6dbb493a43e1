"""People in the layout of CMU Panoptic: ``body3DScene_FRAME.json`` for each frame, with ``joints19`` (older: 15).

Centimetres, y down: (X, Y, Z) = 100 (x, -z, y) of our metres, z up, as in the calibrations of
:mod:`mvpose.formats.calibration.panoptic`. ``joints19``, or another number of joints in the order of the skeleton, has
x, y, z and the confidence of each joint; 0 0 0 -1 is the data set's mark of an undefined joint. The name of a file ends
in the number of its frame. A person who is absent in a frame has no body in its file.
"""

import json
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.files.input_files import read_json_object
from mvpose.files.message_text import one_line, prefixed
from mvpose.formats.joint_names import KNOWN, skeleton_of
from mvpose.formats.people.people_files import Export, PeopleFiles
from mvpose.recording import People

_VERSION = 0.7  # of the dataset's files
_DECIMALS = 4  # of centimetres: micrometres
_LEAST_CONFIDENCE = 0.1  # of a defined joint; loaders of the dataset use the same limit
_NAME = re.compile(r"body3DScene_(\d+)\.json")
_COUNTED = re.compile(r"joints(\d+)")
_USUAL = {19: "panoptic19", 17: "coco17", 15: "panoptic15", 14: "shelf14"}  # by the number of joints
_WHAT = "a body3DScene file of Panoptic: {'bodies': [{'id', 'joints19': [19 x (x, y, z, confidence)]}, ...]}"


def body_scene(
    joints: ArrayLike, confidence: ArrayLike, *, ids: Sequence[int], time: float, rate: float
) -> dict[str, Any]:
    """Return the ``body3DScene`` file of one frame, JSON-ready.

    Args:
        joints: joints in the world, (n, J, 3), metres, z up.
        confidence: confidence of each joint, (n, J); -1 where undefined.
        ids: identities of the people, n.
        time: time of the frame, seconds.
        rate: frames per second.
    """
    x, y, z = np.moveaxis(100.0 * np.asarray(joints, float), -1, 0)
    values = np.stack([x, -z, y, np.asarray(confidence, float)], axis=-1).round(_DECIMALS) + 0.0  # without -0.0
    return {
        "version": _VERSION,
        "univTime": round(1000.0 * time, 3),  # milliseconds
        "fpsType": f"hd_{rate:g}".replace(".", "_"),
        "bodies": [
            {"id": int(number), f"joints{len(body)}": body.ravel().tolist()}
            for number, body in zip(ids, values, strict=True)
        ],
    }


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each frame."""
    people = export.people
    confidence = np.where(people.present, people.scores, -1.0)
    for row, (number, time) in enumerate(zip(people.numbers.tolist(), people.times.tolist(), strict=True)):
        here = people.present[row].any(axis=-1)
        joints, ids = np.nan_to_num(people.joints[row, here]), people.ids[here].tolist()
        scene = body_scene(joints, confidence[row, here], ids=ids, time=time, rate=people.rate)
        yield f"hdPose3d/body3DScene_{number:08d}.json", json.dumps(scene).encode()


def read(files: PeopleFiles) -> People:
    """Read the people of the wanted frames, in the order of their ids, from a folder.

    Joints with a confidence below 0.1 are undefined, as for other loaders of the dataset. Frames without a file are
    left out.

    Raises:
        ValueError: the folder is missing or has no such files, or a wanted file is damaged or of another layout.
    """
    folder = files.single()
    if not os.path.isdir(folder):
        raise ValueError(f"{folder}: no such folder; expected the files body3DScene_*.json of a Panoptic sequence")
    paths = {int(match[1]): path for path in folder.iterdir() if (match := _NAME.fullmatch(path.name))}
    if not paths:
        raise ValueError(f"{folder}: has no file body3DScene_*.json; expected the true poses of a Panoptic sequence")
    numbers = sorted(paths if files.numbers is None else paths.keys() & set(files.numbers.tolist()))
    if not numbers:
        assert files.numbers is not None
        raise ValueError(
            f"{folder}: has files of frames {min(paths)} to {max(paths)}, none of the recording's frames "
            f"{files.numbers.min()} to {files.numbers.max()}; correct the frames or the folder"
        )
    scenes = [read_json_object(paths[number], what=_WHAT) for number in numbers]
    skeleton = files.skeleton or KNOWN[_USUAL.get(_joint_count(scenes), "panoptic19")]
    bodies = [_bodies(paths[number], scene, len(skeleton)) for number, scene in zip(numbers, scenes, strict=True)]
    ids = sorted({identity for each in bodies for identity in each})
    values = np.full((len(numbers), len(ids), len(skeleton), 4), np.nan)
    for row, each in enumerate(bodies):
        for identity, body in each.items():
            values[row, ids.index(identity)] = body
    try:
        times = [0.001 * float(scene.get("univTime", np.nan)) for scene in scenes]
    except (TypeError, ValueError):
        times = [np.nan] * len(scenes)
    with prefixed(folder):
        return People(
            files.times(np.array(numbers), times),
            np.array(ids, np.int64),
            values[..., :3],
            np.clip(np.nan_to_num(values[..., 3]), 0.0, 1.0),
            skeleton=skeleton_of(skeleton),
            numbers=np.array(numbers),
        )


def _joint_count(scenes: Sequence[dict[str, Any]]) -> int:
    """Return the number of joints of the first body; 0 without any."""
    for scene in scenes:
        bodies = scene.get("bodies")
        for body in bodies if isinstance(bodies, list) else ():
            for key in body if isinstance(body, dict) else ():
                if match := _COUNTED.fullmatch(str(key)):
                    return int(match[1])
    return 0


def _bodies(path: Path, scene: dict[str, Any], count: int) -> dict[int, Floats]:
    """Return joints and confidences of each person of a frame, (J, 4), metres, z up, by the person's id."""
    key = f"joints{count}"
    result = {}
    try:
        for body in scene["bodies"]:
            if int(body["id"]) < 0:  # the dataset's mark of a person that was not tracked
                continue
            values = np.asarray(body[key], float)
            if values.shape != (4 * count,):
                raise ValueError(f"{key} must be {4 * count} numbers, got {values.size}")
            x, y, z, confidence = values.reshape(count, 4).T
            defined = confidence >= _LEAST_CONFIDENCE
            joints = np.where(defined[:, None], np.stack([x, z, -y], axis=-1) / 100.0, np.nan)
            result[int(body["id"])] = np.column_stack([joints, np.where(defined, confidence, 0.0)])
    except (KeyError, TypeError) as error:
        raise ValueError(one_line(f"{path}: lacks {error}; expected {_WHAT}")) from None
    except (ValueError, OverflowError) as error:
        raise ValueError(one_line(f"{path}: {error}")) from None
    return result
