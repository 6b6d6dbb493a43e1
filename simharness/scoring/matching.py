"""Scores of the matching alone: pairs of detections in different views, and groups of detections.

A pair is positive if both detections show the same true person, and matched if both have the same label. Phantoms
(person -1) are in no positive pair, unmatched detections (label -1) in no matched one. A detector may detect a person
twice in one view, and a matching takes one of the two, so lost pairs are counted by person and view, not by detection.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.checks import as_array


@dataclass(frozen=True)
class PairCounts:
    """Counts of pairs of detections in different views; the counts of frames can be added."""

    correct: int
    """Matched pairs that show the same person."""
    wrong: int
    """Matched pairs that do not show the same person."""
    lost: int
    """Pairs of views in which a person is detected in both, but no pair of the person's detections is matched."""

    def __add__(self, other: "PairCounts") -> "PairCounts":
        return PairCounts(self.correct + other.correct, self.wrong + other.wrong, self.lost + other.lost)

    @property
    def precision(self) -> float | None:
        """Share of the matched pairs that show the same person; None without matched pairs."""
        return _share(self.correct, self.correct + self.wrong)

    @property
    def recall(self) -> float | None:
        """Share of the pairs of the same person that are matched; None without such pairs."""
        return _share(self.correct, self.correct + self.lost)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; None without pairs of either kind."""
        return _share(2 * self.correct, 2 * self.correct + self.wrong + self.lost)


def count_pairs(view: ArrayLike, labels: ArrayLike, person: ArrayLike) -> PairCounts:
    """Compare the matching of one frame with the truth.

    Args:
        view: camera of each detection, (m,).
        labels: label of each detection, ``Matching.labels``, (m,); -1 for unmatched.
        person: true person of each detection, (m,); -1 for a phantom.

    Raises:
        ValueError: different lengths.
    """
    table = _tabulate(view, labels, person)
    known = table[1:, 1:]
    correct = _pairs_across_views(known)
    detected = (table[:, 1:].sum(axis=0) > 0).astype(np.int64)  # (P, V)
    labelled = (known > 0).astype(np.int64).transpose(1, 2, 0)  # (P, V, L)
    joined = labelled @ labelled.transpose(0, 2, 1) > 0  # (P, V, V)
    lost = _pairs_across_views(detected) - int(np.triu(joined, k=1).sum())
    return PairCounts(correct, _pairs_across_views(table[1:].sum(axis=1)) - correct, lost)


@dataclass(frozen=True)
class GroupCounts:
    """Counts of how the detections of a frame are grouped into people."""

    merged: int
    """Groups with detections of two or more true people."""
    split: int
    """True people with matched detections in several groups, if no single group covers all views in which the person
    has matched detections. So a second detection of a person in one view is no split."""
    phantoms: int
    """Detections that show no person."""
    admitted: int
    """Phantoms that are in a group."""


def count_groups(view: ArrayLike, labels: ArrayLike, person: ArrayLike) -> GroupCounts:
    """Count merged groups, split people and phantoms of one frame; the arguments are those of :func:`count_pairs`."""
    table = _tabulate(view, labels, person)
    known = table[1:, 1:] > 0  # (L, P, V)
    merged = known.any(axis=2).sum(axis=1) >= 2
    views = known.sum(axis=2).max(axis=0, initial=0)
    split = known.any(axis=0).sum(axis=1) > views
    return GroupCounts(int(merged.sum()), int(split.sum()), int(table[:, 0].sum()), int(table[1:, 0].sum()))


def count_violations(view: ArrayLike, labels: ArrayLike) -> int:
    """Count the detections that share a label with another detection of their view; a valid matching has none.

    Args:
        view: camera of each detection, (m,).
        labels: label of each detection, ``Matching.labels``, (m,); -1 for unmatched.

    Raises:
        ValueError: different lengths.
    """
    view = as_array(view, ("m",), "view", np.int64)
    groups = _tabulate(view, labels, np.full(len(view), -1))[1:]
    return int((groups - (groups > 0)).sum())


def _tabulate(view: ArrayLike, labels: ArrayLike, person: ArrayLike) -> NDArray[np.int64]:
    """Count the detections by label, person and view, (L + 1, P + 1, V); the first label and person are -1."""
    view = as_array(view, ("m",), "view", np.int64)
    labels = as_array(labels, view.shape, "labels", np.int64)
    person = as_array(person, view.shape, "person", np.int64)
    shape = tuple(int(values.max(initial=-1)) + extra for values, extra in ((labels, 2), (person, 2), (view, 1)))
    index = ((labels + 1) * shape[1] + person + 1) * shape[2] + view
    return np.bincount(index, minlength=shape[0] * shape[1] * shape[2]).reshape(shape)


def _pairs_across_views(counts: NDArray[np.int64]) -> int:
    """Count the pairs of detections in different views within each row of counts (..., V)."""
    return int((counts.sum(axis=-1) ** 2 - (counts**2).sum(axis=-1)).sum()) // 2


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
