"""Files of detections of one camera: their content, the people in a picture, and what a format is."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.files.archives import arrays_of
from mvpose.files.input_files import MIB, json_list_parts, read_bytes, read_json
from mvpose.files.message_text import listed, prefixed, shown
from mvpose.formats.joint_names import KNOWN, JointNames

WHAT = "detections of one camera: OpenPose, COCO or AlphaPose results, MMPose predictions or RTMLib arrays"
"""Expected content of a file, for messages."""

LONG_LIST = 16 * MIB
"""Size from which a list is read in parts of this size, bytes."""

_GREATEST_SCORE = 2.0  # heat maps and SimCC overshoot 1, mostly by a few per cent; 2 is a visible joint of COCO


@dataclass(frozen=True)
class PicturePeople:
    """People in one picture."""

    keypoints: Floats
    """(n, J, 2), pixels; NaN where missing."""
    scores: Floats
    """(n, J), 0 to 1; 0 where missing."""
    boxes: Floats
    """x, y, width, height, (n, 4), pixels; NaN in the row of a person without box."""
    box_scores: Floats
    """(n,), 0 to 1; NaN for a person without one."""
    joints: JointNames = KNOWN["coco17"]
    """The J joints."""

    def __len__(self) -> int:
        return len(self.scores)

    @classmethod
    def nobody(cls, joints: int = 17) -> "PicturePeople":
        """Return an empty picture."""
        return cls(np.zeros((0, joints, 2)), np.zeros((0, joints)), np.zeros((0, 4)), np.zeros(0))


@dataclass(frozen=True)
class DetectionFile:
    """A file of detections of unknown format. Its content is parsed at most once, when a format looks at it."""

    path: Path
    first: int = 0
    """Row of its first entry, where it is a part of a long list."""

    def parts(self) -> "Iterator[DetectionFile]":
        """Yield the file; in parts where it is a long JSON list, whose values would not fit into memory."""
        if self.path.suffix.lower() == ".json" and self.path.is_file() and self.path.stat().st_size > LONG_LIST:
            part = self
            for entries in json_list_parts(self.path, what=WHAT, size=LONG_LIST):
                part = DetectionFile(self.path, part.first + len(part.__dict__.get("json", ())))
                part.__dict__["json"] = entries  # the cached property
                yield part
            if part is not self:
                return
        yield self

    @cached_property
    def content(self) -> bytes:
        """All bytes of the file.

        Raises:
            ValueError: the file does not exist or cannot be read.
        """
        return read_bytes(self.path, what=WHAT)

    @cached_property
    def json(self) -> Any:
        """The JSON value of a file ``*.json``; None for others.

        Raises:
            ValueError: no such file, or no JSON.
        """
        return read_json(self.path, what=WHAT) if self.path.suffix.lower() == ".json" else None

    @cached_property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays ``keypoints`` and ``scores`` of a file ``*.npz``; none for others.

        Raises:
            ValueError: no such file, or a damaged one.
        """
        if self.path.suffix.lower() != ".npz":
            return {}
        with prefixed(self.path, "; expected the arrays keypoints and scores"):
            return arrays_of(self.content, only=("keypoints", "scores"))

    @property
    def entries(self) -> list[dict[str, Any]]:
        """The objects of a JSON list; none if it is another value."""
        return self.json if isinstance(self.json, list) and all(isinstance(each, dict) for each in self.json) else []

    @property
    def object(self) -> dict[str, Any]:
        """The JSON object; empty if the content is another value."""
        return self.json if isinstance(self.json, dict) else {}


@dataclass(frozen=True)
class DetectionFormat:
    """Format of detections of one camera."""

    title: str
    """Name in messages: "OpenPose"."""
    recognises: Callable[[DetectionFile], bool]
    """Test of a file."""
    read: Callable[[DetectionFile, JointNames | None], Mapping[int, PicturePeople]]
    """Reader: people by the number of the picture, on the skeleton of the file, given the declared one or None."""
    of_picture: Callable[[DetectionFile], bool] = lambda file: False
    """Test whether a recognised file holds one picture; its folder then holds those of one camera."""
    complete: bool = True
    """Whether pictures without people are in the files, too, so that they count the frames."""
    suffixes: tuple[str, ...] = (".json",)
    """Endings of files."""


def picture_people(
    where: object, keypoints: Any, scores: Any, skeleton: JointNames | None, boxes: Any = None, box_scores: Any = None
) -> PicturePeople:
    """Return the people of one picture, given the values of a file.

    Args:
        where: file and place in it, for messages.
        keypoints: (n, J, 2), pixels.
        scores: (n, J).
        skeleton: the J joints; None: the file does not name them.
        boxes: (n, 4), pixels; None: none has a box.
        box_scores: (n,); None: none has one.

    Raises:
        ValueError: no numbers, other shapes, or scores that are not about 0 to 1.
    """
    try:
        keypoints, scores = np.asarray(keypoints, float), np.asarray(scores, float)
    except (TypeError, ValueError):
        raise ValueError(f"{where}: keypoints and scores must be numbers, (n, J, 2) and (n, J)") from None
    if not keypoints.size and not scores.size:
        return PicturePeople.nobody()
    if keypoints.ndim != 3 or keypoints.shape[2] != 2 or scores.shape != keypoints.shape[:2]:
        raise ValueError(
            f"{where}: keypoints must be (n, J, 2) and scores (n, J), got {keypoints.shape} and {scores.shape}"
        )
    names = skeleton or nameless_skeleton(keypoints.shape[1])
    if len(names) != keypoints.shape[1]:
        raise ValueError(f"{where}: has {keypoints.shape[1]} joints, but skeleton {names.name} has {len(names)}")
    if np.nanmax(scores) > _GREATEST_SCORE:  # those slightly above 1 are clipped later
        raise ValueError(
            f"{where}: scores must lie in 0..1, got {np.nanmax(scores):.6g}; divide per cent by 100, take the sigmoid "
            "of logits"
        )
    boxes = np.full((len(scores), 4), np.nan) if boxes is None else np.asarray(boxes, float).reshape(-1, 4)
    box_scores = np.full(len(scores), np.nan) if box_scores is None else np.asarray(box_scores, float)
    bad = ~np.isfinite(boxes).all(axis=1) | (boxes[:, 2:] < 0).any(axis=1)
    return PicturePeople(keypoints, scores, np.where(bad[:, None], np.nan, boxes), box_scores, names)


def nameless_skeleton(joints: int) -> JointNames:
    """Return a skeleton of joints without names, of files that give none; :mod:`.skeleton_choice` names them."""
    return JointNames(f"{joints} joints", tuple(f"joint {row}" for row in range(joints)))


def summary(content: Any) -> str:
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
