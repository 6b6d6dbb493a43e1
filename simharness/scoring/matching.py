"""Scores of the matching alone: pairs of detections in different views, and groups of detections.

A pair is positive where both detections show one true person; the method says so where both carry one label.
Phantoms (person -1) and unmatched detections (label -1) are in no positive pair. A detector may find a person twice in
one view; a matching takes one of the two, so what is lost is counted by people and views, not by detections.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array


@dataclass(frozen=True)
class PairCounts:
    """Pairs of detections in different views; frames add up.

    Attributes:
        correct: pairs of one person that were matched.
        wrong: pairs that were matched and are not one person.
        lost: pairs of views in which one person is found, with no pair of detections there matched.
    """

    correct: int
    wrong: int
    lost: int

    def __add__(self, other: PairCounts) -> PairCounts:
        return PairCounts(self.correct + other.correct, self.wrong + other.wrong, self.lost + other.lost)

    @property
    def precision(self) -> float | None:
        """Share of the matched pairs that are one person; None where nothing was matched."""
        return _share(self.correct, self.correct + self.wrong)

    @property
    def recall(self) -> float | None:
        """Share of the pairs of one person that were matched; None where there is no such pair."""
        return _share(self.correct, self.correct + self.lost)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; None where there is no pair of either kind."""
        return _share(2 * self.correct, 2 * self.correct + self.wrong + self.lost)


def count_pairs(view: ArrayLike, labels: ArrayLike, person: ArrayLike) -> PairCounts:
    """Compare the matching of one frame with the truth.

    Args:
        view: camera of each detection, (m,).
        labels: what the method says, ``Matching.labels``, (m,); -1 for unmatched.
        person: true person of each detection, (m,); -1 for a phantom.

    Raises:
        ValueError: lengths that differ.
    """
    table = _tabulate(view, labels, person)
    known = table[1:, 1:]
    correct = _across(known)
    found = (table[:, 1:].sum(axis=0) > 0).astype(np.int64)  # (P, V)
    in_one = (known > 0).astype(np.int64).transpose(1, 2, 0)  # (P, V, L)
    joined = in_one @ in_one.transpose(0, 2, 1) > 0  # (P, V, V)
    lost = _across(found) - int(np.triu(joined, k=1).sum())
    return PairCounts(correct, _across(table[1:].sum(axis=1)) - correct, lost)


@dataclass(frozen=True)
class GroupCounts:
    """How the detections of a frame were grouped into people.

    Attributes:
        merged: groups with detections of two true people or more.
        split: true people whose matched detections are in several groups, none of which holds one from every view that
            has any. So a second detection of a person in one view makes no split.
        phantoms: detections of nobody.
        admitted: detections of nobody that are in a group.
    """

    merged: int
    split: int
    phantoms: int
    admitted: int


def count_groups(view: ArrayLike, labels: ArrayLike, person: ArrayLike) -> GroupCounts:
    """Count what went wrong with whole groups and people; the arguments are those of :func:`count_pairs`."""
    table = _tabulate(view, labels, person)
    known = table[1:, 1:] > 0  # (L, P, V)
    merged = known.any(axis=2).sum(axis=1) >= 2
    views = known.sum(axis=2).max(axis=0, initial=0)
    split = known.any(axis=0).sum(axis=1) > views
    return GroupCounts(int(merged.sum()), int(split.sum()), int(table[:, 0].sum()), int(table[1:, 0].sum()))


def count_violations(view: ArrayLike, labels: ArrayLike) -> int:
    """Count the detections that share a person with another one of their own view: what a matching must never have.

    Args:
        view: camera of each detection, (m,).
        labels: ``Matching.labels``, (m,); -1 for unmatched.

    Raises:
        ValueError: lengths that differ.
    """
    view = as_array(view, ("m",), "view", np.int64)
    groups = _tabulate(view, labels, np.full(len(view), -1))[1:]
    return int((groups - (groups > 0)).sum())


def _tabulate(view: ArrayLike, labels: ArrayLike, person: ArrayLike) -> NDArray[np.int64]:
    """Count the detections by label, person and view, (L + 1, P + 1, V); the first of both is for -1."""
    view = as_array(view, ("m",), "view", np.int64)
    labels = as_array(labels, view.shape, "labels", np.int64)
    person = as_array(person, view.shape, "person", np.int64)
    shape = tuple(int(index.max(initial=-1)) + extra for index, extra in ((labels, 2), (person, 2), (view, 1)))
    places = ((labels + 1) * shape[1] + person + 1) * shape[2] + view
    return np.bincount(places, minlength=shape[0] * shape[1] * shape[2]).reshape(shape)


def _across(counts: NDArray[np.int64]) -> int:
    """Pairs of detections in different views, of counts (..., V); those in different rows are no pair."""
    return int((counts.sum(axis=-1) ** 2 - (counts**2).sum(axis=-1)).sum()) // 2


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
