"""People of a recording in parts on disk, each of some frames: what an estimation writes as it goes.

An hour of people does not fit into memory with its covariances. Files are made from one part after the other, or from
one person after the other; a recording that is short enough is one :class:`People` again (:meth:`PeopleParts.whole`).
"""

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats, Integers
from mvpose.estimate import Estimate
from mvpose.files.archives import arrays_of
from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_bytes
from mvpose.formats.people.outliers import LeftOut, OutputLimits, expected_errors, within_limits
from mvpose.recording import People, frame_times
from mvpose.skeleton import Skeleton

FRAMES = 3000
"""Frames of a part."""

_OURS = ("given", "ids", "joints", "scores", "covariance", "freedom", "errors")


class PeopleParts:
    """People of a recording, in a folder of which each file holds those of :data:`FRAMES` frames.

    Args:
        folder: an existing folder; parts that it holds are kept.
        skeleton: joints of the people.
        period: time between frames, seconds, where estimates state no times.
        tracked: whether identities say who somebody is in the next frame.
    """

    def __init__(self, folder: Path, skeleton: Skeleton, period: float, *, tracked: bool) -> None:
        self.folder, self.skeleton, self.period, self.tracked = folder, skeleton, period, tracked
        self.extras: list[dict[str, Any]] = []
        self._given: list[Floats] = []
        self._ids: list[Integers] = []
        self._kept: dict[int, tuple[int, Bools]] | None = None  # first frame and mask of each person within limits
        self._changed = False
        while self._file(len(self._given)).is_file():
            self._take(self._load(len(self._given)))

    def add(self, estimates: Sequence[Estimate], extra: Mapping[str, Floats]) -> None:
        """Write the next part.

        Args:
            estimates: those of the next :data:`FRAMES` frames, or of the last ones.
            extra: arrays that are kept with them, in :attr:`extras`.

        Raises:
            ValueError: as :meth:`People.of_estimates`.
            OSError: the folder cannot be written.
        """
        people = People.of_estimates(estimates, self.skeleton, self.period, untracked=not self.tracked)
        given = np.array([np.nan if each.time is None else each.time for each in estimates], float)
        arrays = {key: getattr(people, key) for key in _OURS[1:-1] if getattr(people, key) is not None}
        arrays |= {"given": given, "errors": expected_errors(people), **extra}
        content = io.BytesIO()
        np.savez(content, **arrays)
        write_atomic(self._file(len(self._given)), content.getvalue())
        self._take(arrays)

    def emptied(self) -> "PeopleParts":
        """Remove the files of all parts, and return the parts of nobody."""
        for row in range(len(self._given)):
            self._file(row).unlink()
        return PeopleParts(self.folder, self.skeleton, self.period, tracked=self.tracked)

    @property
    def frames(self) -> int:
        """Number of frames that are written."""
        return sum(map(len, self._given))

    @property
    def times(self) -> Floats:
        """Time of each frame, (T,), seconds."""
        return frame_times(np.concatenate([np.zeros(0), *self._given]), self.period)

    @property
    def count(self) -> int:
        """Number of parts."""
        return len(self._given)

    @property
    def rate(self) -> float:
        """Frames per second, as :attr:`People.rate`."""
        return float(1.0 / np.median(np.diff(self.times))) if self.frames > 1 else 1.0 / self.period

    @property
    def ids(self) -> Integers:
        """Identities of the people, increasing; within the limits."""
        found = np.unique(np.concatenate([np.zeros(0, np.int64), *self._ids]))
        return found if self._kept is None else found[np.isin(found, list(self._kept))]

    @property
    def spans(self) -> list[dict[str, int]]:
        """First and last frame of each person within the limits, and the number of frames with it."""
        assert self._kept is not None, "limits come first"
        return [
            {"id": identity, "first_frame": first, "last_frame": first + len(mask) - 1, "frames": int(mask.sum())}
            for identity, (first, joints) in self._kept.items()
            for mask in [np.asarray(joints.any(axis=1))]
        ]

    def limit(self, limits: OutputLimits) -> LeftOut:
        """Leave out what is beyond limits from now on, and return what that is; see :func:`within_limits`."""
        kept, lefts = {}, []
        for identity in self.ids:
            person, left = within_limits(
                self.whole([identity], covariance=False), limits, tracked=self.tracked,
                errors=self._stacked("errors", np.array([identity]), np.arange(self.frames)),
            )  # fmt: skip
            lefts.append(left)
            if len(person):
                span = person.span(0)
                kept[int(identity)] = (span.start, person.present[span, 0])
        self._kept = kept
        if not lefts:
            return within_limits(self.whole(), limits)[1]
        keys = ("ids", "present", "frames")
        joined = {key: np.concatenate([getattr(each, key) for each in lefts]) for key in keys}
        return LeftOut(limits, counts=np.concatenate([each.counts for each in lefts], axis=1), **joined)

    def change(self, function: Callable[[People], People]) -> None:
        """Put the joints that a function makes of those of each person in the place of them; the parts stay.

        Args:
            function: from one person in all frames, without covariances, to the same person.
        """
        for identity in self.ids.tolist():
            joints = function(self.whole([identity], covariance=False)).joints[:, 0]
            np.save(self.folder / f"changed-{identity}.npy", joints)
        self._changed = True

    def parts(self) -> Iterator[People]:
        """Yield the people of one part after the other, within the limits; their frames are numbered through."""
        first, ids = 0, self.ids
        for given, there in zip(self._given, self._ids, strict=True):
            yield self.whole(there[np.isin(there, ids)], rows=np.arange(first, first + len(given)))
            first += len(given)

    def whole(self, ids: ArrayLike | None = None, *, covariance: bool = True, rows: Integers | None = None) -> People:
        """Return people in one, within the limits.

        Args:
            ids: identities to take, increasing; None: all.
            covariance: whether with covariances and degrees of freedom, which take most of the memory.
            rows: frames to take, increasing; None: all.
        """
        who = self.ids if ids is None else np.asarray(ids, np.int64)
        rows = np.arange(self.frames) if rows is None else rows
        shape = len(rows), len(who), len(self.skeleton)
        joints, scores = self._joints(who, rows), self._stacked("scores", who, rows)
        scores = np.zeros(shape) if scores is None else np.nan_to_num(scores)
        for column, identity in enumerate(who.tolist() if self._kept is not None else ()):
            first, mask = (self._kept or {})[identity]
            there = (rows >= first) & (rows < first + len(mask))
            scores[there, column] *= mask[rows[there] - first]
            scores[~there, column] = 0.0
        return People(
            self.times[rows],
            who,
            np.full((*shape, 3), np.nan) if joints is None else joints,
            scores,
            self._stacked("covariance", who, rows) if covariance else None,
            self.skeleton,
            self._stacked("freedom", who, rows) if covariance else None,
            rows,
        )

    def _joints(self, ids: Integers, rows: Integers) -> Floats | None:
        """Return the joints of some people in some frames, as they were changed; None where there are none."""
        if not self._changed or not len(ids):
            return self._stacked("joints", ids, rows)
        of_people = (np.load(self.folder / f"changed-{each}.npy", mmap_mode="r") for each in ids.tolist())
        return np.stack([joints[rows] for joints in of_people], axis=1)

    def _stacked(self, key: str, ids: Integers, rows: Integers) -> Floats | None:
        """Return an array of some people in some frames, NaN where they are not; None where no part has it."""
        result, first = None, 0
        for part, (given, there) in enumerate(zip(self._given, self._ids, strict=True)):
            here = slice(*np.searchsorted(rows, (first, first + len(given))))
            columns = np.flatnonzero(np.isin(ids, there))
            values = self._load(part, key).get(key) if len(columns) and here.stop > here.start else None
            if values is not None:
                if result is None:
                    result = np.full((len(rows), len(ids), *values.shape[2:]), np.nan)
                result[here, columns] = values[rows[here] - first][:, np.searchsorted(there, ids[columns])]
            first += len(given)
        return result

    def _file(self, row: int) -> Path:
        return self.folder / f"people-{row:06d}.npz"

    def _load(self, row: int, *only: str) -> dict[str, Any]:
        return arrays_of(read_bytes(self._file(row), what="people of an estimation"), only=only or None)

    def _take(self, arrays: Mapping[str, Any]) -> None:
        self._given.append(arrays["given"])
        self._ids.append(arrays["ids"])
        self.extras.append({key: value for key, value in arrays.items() if key not in _OURS})
