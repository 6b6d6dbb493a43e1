"""Scores of the matching alone, over pairs of detections in different views.

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
    view = as_array(view, ("m",), "view", np.int64)
    labels = as_array(labels, view.shape, "labels", np.int64)
    person = as_array(person, view.shape, "person", np.int64)
    first, second = np.triu_indices(len(view), k=1)
    across = view[first] != view[second]
    first, second = first[across], second[across]
    said, true = _same(labels, first, second), _same(person, first, second)
    places = np.column_stack([person[first], np.sort(np.column_stack([view[first], view[second]]), axis=1)])
    lost = len(np.unique(places[true], axis=0)) - len(np.unique(places[true & said], axis=0))
    return PairCounts(int((said & true).sum()), int((said & ~true).sum()), lost)


def _same(group: NDArray[np.int64], first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.bool_]:
    return (group[first] == group[second]) & (group[first] >= 0)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def count_violations(view: ArrayLike, labels: ArrayLike) -> int:
    """Count the detections that share a person with another one of their own view: what a matching must never have.

    Args:
        view: camera of each detection, (m,).
        labels: ``Matching.labels``, (m,); -1 for unmatched.

    Raises:
        ValueError: lengths that differ.
    """
    view = as_array(view, ("m",), "view", np.int64)
    labels = as_array(labels, (len(view),), "labels", np.int64)
    pairs = np.column_stack([view, labels])[labels >= 0]
    return len(pairs) - len(np.unique(pairs, axis=0))
