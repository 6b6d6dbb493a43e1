"""CLEAR MOT: MOTA, identity switches and fragmentations (Bernardin & Stiefelhagen, EURASIP JIVP 2008).

In each frame people and estimates within the distance are paired one to one: pairs of the frame before are kept, and
else the sum of similarities is largest. A person's identity switches where it is paired with another identity than the
last time, however long ago that was. A track is fragmented where a person is paired again after frames without a pair.

Ours are the numbers of ``trackeval``, also where it has a rule of its own: frames without any person or without any
estimate are passed over, so that a gap of all people at once is no fragmentation; and a person who was absent and comes
back starts a fragment as one who was missed does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from simharness.scoring.tracking.tracked_frames import TrackedFrames

ABSENT, MISSED = -2, -1
"""Entries of :attr:`ClearMot.track` without a pair."""

_THRESHOLD = 0.5  # of similarity: the estimate is within the distance
_KEPT = 1000.0  # weight of a pair of the frame before: more than all similarities of a frame
_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class ClearMot:
    """Pairs of people and identities in each frame, and what they count.

    Attributes:
        track: index into ``TrackedFrames.ids`` of the identity that each true person is paired with, (T, P);
            :data:`MISSED` where it has none, :data:`ABSENT` where the person is not there.
        switched: where a person's identity is another one than the last time, (T, P).
        fragmentations: how often people are paired again after frames without a pair.
        missed: number of people without a pair in all frames.
        false: number of estimates without a pair in all frames.
    """

    track: NDArray[np.int64]
    switched: NDArray[np.bool_]
    fragmentations: int
    missed: int
    false: int

    @property
    def switches(self) -> int:
        """Number of identity switches."""
        return int(self.switched.sum())

    @property
    def interruptions(self) -> int:
        """Number of times that a person is paired again after frames in which it was there without a pair.

        Unlike :attr:`fragmentations`, times of absence do not interrupt a track, and those without any estimate do.
        """
        count = 0
        for person in self.track.T:
            paired = person[person != ABSENT] >= 0
            count += int((np.diff(np.flatnonzero(paired)) > 1).sum())
        return count

    @property
    def mota(self) -> float:
        """MOTA, at most 1: 1 - (missed + false + switches) / people; 0 without people or without estimates."""
        pairs = int((self.track >= 0).sum())
        people = pairs + self.missed
        return (pairs - self.false - self.switches) / people if people and pairs + self.false else 0.0


def clear_mot(frames: TrackedFrames, *, distance: float) -> ClearMot:
    """Return the pairs of people and identities of each frame.

    Args:
        frames: people and identities.
        distance: largest distance of a pair, metres.
    """
    track = np.full((len(frames), frames.people), ABSENT)
    switched = np.zeros(track.shape, bool)
    before, last = np.full((2, frames.people), MISSED)  # identity in the frame before, and in the last frame with one
    fragments = np.zeros(frames.people, np.int64)
    for frame, (present, tracks, similarity) in enumerate(
        zip(frames.present, frames.tracks, frames.similarities(distance), strict=True)
    ):
        track[frame, present] = MISSED
        if not similarity.size:
            continue
        weight = np.where(tracks == before[present, None], _KEPT + similarity, similarity)
        weight[similarity < _THRESHOLD - _EPSILON] = 0.0
        rows, columns = linear_sum_assignment(weight, maximize=True)
        paired = weight[rows, columns] > 0.0
        people, identities = present[rows[paired]], tracks[columns[paired]]
        switched[frame, people] = (last[people] >= 0) & (last[people] != identities)
        fragments[people] += before[people] < 0
        last[people] = identities
        before[:] = MISSED
        before[people] = identities
        track[frame, people] = identities
    pairs = int((track >= 0).sum())
    return ClearMot(
        track=track,
        switched=switched,
        fragmentations=int(np.maximum(fragments - 1, 0).sum()),
        missed=int(frames.frames_of_people.sum()) - pairs,
        false=int(frames.frames_of_tracks.sum()) - pairs,
    )
