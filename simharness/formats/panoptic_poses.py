"""True poses in the format of the CMU Panoptic dataset: ``body3DScene`` files with ``joints19`` (older: ``joints15``).

Centimetres, y down: (X, Y, Z) = 100 (x, -z, y) of our metres, z up, as in the calibrations of
:mod:`mvpose.formats.calibration.panoptic`. The name of a file ends in the number of its frame. Simulated joints are
always defined, even where they are hidden; the dataset's mark of an undefined joint (0 0 0 -1) is never written. A
person who is absent in a frame has no body in its file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose import COCO17
from mvpose.files.input_files import read_json_object
from mvpose.files.message_text import one_line
from mvpose.formats.joint_names import KNOWN
from mvpose.skeleton import PANOPTIC19
from simharness.formats.joint_tracks import JointTracks, TrackFiles
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
_LEAST_CONFIDENCE = 0.1  # of a defined joint; loaders of the dataset use the same limit
_NAME = re.compile(r"body3DScene_(\d+)\.json")
_WHAT = "a body3DScene file of Panoptic: {'bodies': [{'id', 'joints19': [19 x (x, y, z, confidence)]}, ...]}"


def read_tracks(files: TrackFiles) -> JointTracks:
    """Read the people of the requested frames, (n, P, J, 3), in the order of their ids; J is 19, or 15.

    Joints with a confidence below 0.1 are undefined, as for other loaders of the dataset. Frames without a file are
    left out.

    Raises:
        ValueError: the folder is missing or has no such files, or a requested file is damaged or of another layout.
    """
    folder = files.single()
    if not os.path.isdir(folder):
        raise ValueError(f"{folder}: no such folder; expected the files body3DScene_*.json of a Panoptic sequence")
    numbers = {int(match[1]): path for path in folder.iterdir() if (match := _NAME.fullmatch(path.name))}
    if not numbers:
        raise ValueError(f"{folder}: has no file body3DScene_*.json; expected the true poses of a Panoptic sequence")
    skeleton = files.skeleton or KNOWN["panoptic19"]
    frames = sorted(numbers.keys() & set(files.frames.tolist()))
    if not frames:
        raise ValueError(
            f"{folder}: has files of frames {min(numbers)} to {max(numbers)}, none of the recording's frames "
            f"{files.frames.min()} to {files.frames.max()}; correct the frames or the folder"
        )
    bodies = [_bodies(numbers[frame], len(skeleton)) for frame in frames]
    ids = sorted({number for each in bodies for number in each})
    joints = np.full((len(frames), len(ids), len(skeleton), 3), np.nan)
    for row, each in enumerate(bodies):
        for number, body in each.items():
            joints[row, ids.index(number)] = body
    return JointTracks(np.array(frames), joints, people=tuple(ids))


def _bodies(path: Path, count: int) -> dict[int, NDArray[np.float64]]:
    """Return the joints of each person of a frame, (J, 3), metres, z up, by the person's id."""
    key = f"joints{count}"
    result = {}
    try:
        for body in read_json_object(path, what=_WHAT)["bodies"]:
            if int(body["id"]) < 0:  # the dataset's mark of a person that was not tracked
                continue
            values = np.asarray(body[key], float)
            if values.shape != (4 * count,):
                raise ValueError(f"{key} must be {4 * count} numbers, got {values.size}")
            x, y, z, confidence = values.reshape(count, 4).T
            defined = confidence >= _LEAST_CONFIDENCE
            result[int(body["id"])] = np.where(defined[:, None], np.stack([x, z, -y], axis=-1) / 100.0, np.nan)
    except (KeyError, TypeError) as error:
        raise ValueError(one_line(f"{path}: lacks {error}; expected {_WHAT}")) from None
    except (ValueError, OverflowError) as error:
        raise ValueError(one_line(str(error) if str(error).startswith(str(path)) else f"{path}: {error}")) from None
    return result


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
