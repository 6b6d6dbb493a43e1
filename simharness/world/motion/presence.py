"""Presence: the times at which a person is in the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.checks import as_array


@dataclass(frozen=True)
class Presence:
    """Times at which a person is in the scene, as closed intervals; at all other times the person is absent.

    Attributes:
        intervals: start and end of each stay, (n, 2) seconds, ascending; infinite for a stay without start or end.

    Raises:
        ValueError: a wrong shape, or stays that overlap or end before they start.
    """

    intervals: Floats

    def __post_init__(self) -> None:
        intervals = as_array(self.intervals, ("n", 2), "presence intervals")
        if np.isnan(intervals).any() or (np.diff(intervals.ravel()) < 0).any():
            raise ValueError(f"presence intervals must be ascending seconds, got {intervals.tolist()}")
        object.__setattr__(self, "intervals", intervals)

    @property
    def always(self) -> bool:
        """Whether the person is never absent."""
        return bool((np.isneginf(self.intervals[:, 0]) & np.isposinf(self.intervals[:, 1])).any())

    def at(self, time: ArrayLike) -> Bools:
        """Return whether the person is present at times (...) in seconds, (...)."""
        time = np.asarray(time, float)[..., None]
        return np.asarray(((self.intervals[:, 0] <= time) & (time <= self.intervals[:, 1])).any(axis=-1))


ALWAYS = Presence(np.array([[-np.inf, np.inf]]))
"""Presence of a person who neither comes nor goes."""


def held(values: Floats, present: Bools) -> Floats:
    """Return values (T, ...) of one person in which those of absent times are those of the nearest present time.

    Args:
        values: values over time.
        present: presence over time, (T,); if it is nowhere true, the values are returned as they are.
    """
    known = np.flatnonzero(present)
    if len(known) in (0, len(present)):
        return values
    after = np.searchsorted(known, np.arange(len(present))).clip(0, len(known) - 1)
    before = (after - 1).clip(0)
    rows = np.arange(len(present))
    nearest = np.where(np.abs(known[before] - rows) <= np.abs(known[after] - rows), known[before], known[after])
    return values[nearest]


def presence_at(presence: Sequence[Presence], time: ArrayLike) -> Bools:
    """Return who is present at times (...), (..., P)."""
    time = np.asarray(time, float)
    if not presence:
        return np.zeros((*time.shape, 0), bool)
    return np.stack([each.at(time) for each in presence], axis=-1)
