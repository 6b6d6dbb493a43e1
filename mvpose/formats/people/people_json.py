"""All people of a recording in one JSON file, in the style of CMU Panoptic: bodies of each frame with flat joints.

Metres, z up. ``joints17`` (or another number of joints) has x, y, z and the score of every joint in the order of
``skeleton.joints``; ``null, null, null, 0`` is a joint that was not estimated. A person without any joint in a frame
has no body there.
"""

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from mvpose.checks import as_array
from mvpose.files.input_files import read_json_object
from mvpose.files.message_text import prefixed
from mvpose.formats.joint_names import JointNames, skeleton_of
from mvpose.formats.people.people_files import AXES, Export, PeopleFiles
from mvpose.recording import People
from mvpose.skeleton import Skeleton

_FORMAT = "mvpose people"
_DECIMALS = 6  # micrometres, microseconds
_WHAT = "people.json of mvpose: an object with skeleton and frames"


def write(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the file; its frames are one line each."""
    people = export.people
    skeleton = people.skeleton
    head = {
        "format": _FORMAT,
        "version": 1,
        "units": "m",
        "up": export.options.up or "z",
        "rate": round(people.rate, _DECIMALS),
        "skeleton": {"name": skeleton.name, "joints": skeleton.joints, "parents": skeleton.parents},
    }
    turned = np.round(people.joints @ export.axes("z").T, _DECIMALS) + 0.0  # without -0.0
    values = np.concatenate([turned, np.round(people.scores, _DECIMALS)[..., None]], axis=-1)
    key, present = f"joints{len(skeleton)}", np.asarray(people.present.any(axis=-1))
    frames = []
    for k, time in enumerate(people.times.tolist()):
        bodies: list[dict[str, Any]] = [
            {
                "id": int(people.ids[column]),
                key: [None if math.isnan(value) else value for value in values[k, column].ravel().tolist()],
            }
            for column in np.flatnonzero(present[k])
        ]
        frames.append(_compact({"frame": int(people.numbers[k]), "time": round(time, _DECIMALS), "bodies": bodies}))
    begin = json.dumps(head, indent=1)[:-2] + ',\n "frames": [\n' if export.first else ",\n"
    yield "people.json", (begin + ",\n".join(frames) + ("\n]}\n" if export.last else "")).encode()


def _compact(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def read(files: PeopleFiles) -> People:
    """Read the people of a file.

    Raises:
        ValueError: no such file, or one of another layout.
    """
    path = files.single()
    content = read_json_object(path, what=_WHAT)
    with prefixed(path, f"; expected {_WHAT}", damage=(KeyError, TypeError, IndexError, OverflowError)):
        return _people(content, files)


def _people(content: dict[str, Any], files: PeopleFiles) -> People:
    skeleton = _skeleton(content["skeleton"])
    frames, count = content["frames"], len(skeleton)
    ids = sorted({int(body["id"]) for frame in frames for body in frame["bodies"]})
    values = np.full((len(frames), len(ids), count, 4), np.nan)
    for row, frame in enumerate(frames):
        for body in frame["bodies"]:
            flat = as_array(body[f"joints{count}"], (4 * count,), f"frame {row}: joints{count}")
            values[row, ids.index(int(body["id"]))] = flat.reshape(count, 4)
    numbers = np.array([frame["frame"] for frame in frames], np.int64)
    return People(
        files.times(numbers, [frame["time"] for frame in frames], rate=float(content["rate"])),
        np.array(ids, np.int64),
        np.where(np.isfinite(values[..., :3]), values[..., :3], np.nan) @ AXES[content["up"]],
        np.nan_to_num(values[..., 3]),
        skeleton=skeleton,
        numbers=files.renumbered(numbers, counted=bool(len(numbers)) and numbers[0] == 0),
    )


def _skeleton(given: dict[str, Any]) -> Skeleton:
    """Return the shipped skeleton of these joints, or the tree of the file."""
    name, joints = str(given["name"]), tuple(map(str, given["joints"]))
    known = skeleton_of(JointNames(name, joints))
    if known.name != name or known.parents == tuple(given["parents"]):
        return known
    return Skeleton(name, joints, tuple(given["parents"]), known.mirror, known.sigmas)
