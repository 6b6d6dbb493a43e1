"""People in the pictures of one camera, kept in a file: as objects, those of an hour would not fit into memory."""

import hashlib
import weakref
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import copy
from dataclasses import replace
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.formats.detections.detection_file import PicturePeople
from mvpose.formats.joint_names import JointNames


class PictureStore(Mapping[int, PicturePeople]):
    """People by the number of the frame, increasing.

    The file has no name: the system removes it when nobody uses it any more. It lies where temporary files do.

    Args:
        pictures: number of the frame and people of each picture, in any order; people of one number are joined.
    """

    def __init__(self, pictures: Iterable[tuple[int, PicturePeople]]) -> None:
        self._file = TemporaryFile()  # noqa: SIM115, it is open as long as this object and its copies
        weakref.finalize(self, self._file.close)
        self._origin: PictureStore | None = None  # of a copy: keeps the file open
        self._convert: Callable[[PicturePeople], PicturePeople] = lambda picture: picture
        self._skeletons: dict[JointNames, int] = {}
        records, place, digest = array("q"), 0, hashlib.blake2b(digest_size=16)
        for number, each in pictures:
            parts = each.keypoints, each.scores, each.boxes, each.box_scores
            values = np.concatenate([np.ravel(part) for part in parts]).astype(float)
            kind = self._skeletons.setdefault(each.joints, len(self._skeletons))
            digest.update(b"%d %d " % (number, kind))
            digest.update(values.tobytes())
            self._file.write(values.tobytes())
            records.extend((number, place, len(each), kind))
            place += values.nbytes
        self._file.flush()
        table = np.array(records, np.int64).reshape(-1, 4)
        self._table = table[np.argsort(table[:, 0], kind="stable")]
        self._numbers, self._starts = np.unique(self._table[:, 0], return_index=True)
        self.digest = digest.hexdigest()

    def __len__(self) -> int:
        return len(self._numbers)

    def __iter__(self) -> Iterator[int]:
        return iter(self._numbers.tolist())

    def __contains__(self, number: object) -> bool:
        return isinstance(number, int) and self._row(number) >= 0

    def __getitem__(self, number: int) -> PicturePeople:
        row = self._row(number)
        if row < 0:
            raise KeyError(number)
        stop = self._starts[row + 1] if row + 1 < len(self) else len(self._table)
        records = self._table[self._starts[row] : stop]
        some = records[records[:, 2] > 0].tolist() or records[:1].tolist()
        people = [self._read(*record[1:]) for record in some]
        joined = people[0]
        if len(people) > 1:
            keys = ("keypoints", "scores", "boxes", "box_scores")
            parts: dict[str, Any] = {key: np.concatenate([getattr(each, key) for each in people]) for key in keys}
            joined = replace(joined, **parts)
        return self._convert(joined) if len(joined) else joined

    @property
    def joined(self) -> bool:
        """Whether people of several given pictures have one number."""
        return len(self._table) > len(self)

    def converted(self, convert: Callable[[PicturePeople], PicturePeople]) -> "PictureStore":
        """Return the same pictures; a function is applied to each with people when it is read."""
        result = copy(self)
        result._origin, result._convert = self, convert
        return result

    def renumbered(self, numbers: Mapping[int, int]) -> "PictureStore":
        """Return some pictures under new numbers, given those of the frames by the present ones."""
        result, rows = copy(self), [self._row(number) for number in numbers]
        result._origin = self
        result._table = self._table[rows].copy()
        result._table[:, 0] = list(numbers.values())
        result._table = result._table[np.argsort(result._table[:, 0], kind="stable")]
        result._numbers, result._starts = np.unique(result._table[:, 0], return_index=True)
        return result

    def examples(self) -> Iterator[PicturePeople]:
        """Yield one picture with people for each skeleton."""
        some = self._table[self._table[:, 2] > 0]
        for row in np.unique(some[:, 3], return_index=True)[1]:
            yield self[int(some[row, 0])]

    def _row(self, number: int) -> int:
        """Return the row of a frame; -1 for none."""
        row = int(np.searchsorted(self._numbers, number))
        return row if row < len(self) and self._numbers[row] == number else -1

    def _read(self, place: int, count: int, kind: int) -> PicturePeople:
        joints = list(self._skeletons)[kind]
        if not count:
            return PicturePeople.nobody()
        self._file.seek(place)
        values: Floats = np.frombuffer(self._file.read(8 * count * (3 * len(joints) + 5)))
        keypoints, scores, boxes, box_scores = np.split(
            values, np.cumsum([2 * count * len(joints), count * len(joints), 4 * count])
        )
        return PicturePeople(
            keypoints.reshape(count, -1, 2), scores.reshape(count, -1), boxes.reshape(count, 4), box_scores, joints
        )
