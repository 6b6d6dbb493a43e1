"""IDF1, IDP and IDR, and the identity of each true person (Ristani et al., ECCV workshops 2016).

Over the whole sequence each true person gets at most one identity, and each identity at most one person, so that the
estimate of a person's identity is within the distance in as many frames as possible. Every other frame of a person is
missed, and every other estimate is false: a person whose identity changes halfway is missed half of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from simharness.scoring.tracking.tracked_frames import TrackedFrames

_THRESHOLD = 0.5  # of similarity: the estimate is within the distance


@dataclass(frozen=True)
class IdentityScores:
    """Identities of the true people over the whole sequence.

    Attributes:
        track: index into ``TrackedFrames.ids`` of the identity of each true person, (P,); -1 for none.
        right: number of frames in which the estimate of a person's identity is within the distance (IDTP).
        missed: number of all other frames of true people (IDFN).
        false: number of all other estimates (IDFP).
    """

    track: NDArray[np.int64]
    right: int
    missed: int
    false: int

    @property
    def f1(self) -> float:
        """IDF1, 0 to 1: harmonic mean of precision and recall; 0 without people and estimates."""
        return self.right / max(1.0, self.right + 0.5 * self.false + 0.5 * self.missed)

    @property
    def precision(self) -> float:
        """IDP, 0 to 1: share of the estimates that are right; 0 without estimates."""
        return self.right / max(1, self.right + self.false)

    @property
    def recall(self) -> float:
        """IDR, 0 to 1: share of the frames of true people in which their identity is right; 0 without people."""
        return self.right / max(1, self.right + self.missed)


def identity_scores(frames: TrackedFrames, *, distance: float) -> IdentityScores:
    """Return the identities of the true people, and in how many frames they are right.

    Of several assignments that are right in equally many frames, the one with the largest sum of similarities is taken.

    Args:
        frames: people and identities.
        distance: largest distance of an estimate that is right, metres.
    """
    near, similarity_sum = np.zeros((2, frames.people, len(frames.ids)))
    for present, track, similarity in zip(frames.present, frames.tracks, frames.similarities(distance), strict=True):
        within = similarity >= _THRESHOLD
        near[np.ix_(present, track)] += within
        similarity_sum[np.ix_(present, track)] += within * similarity
    people, tracks = int(frames.frames_of_people.sum()), int(frames.frames_of_tracks.sum())
    # The sum of similarities is at most the number of people in all frames: it decides only between equal numbers.
    rows, columns = linear_sum_assignment(near + similarity_sum / (people + 1.0), maximize=True)
    assigned = near[rows, columns] > 0
    track = np.full(frames.people, -1)
    track[rows[assigned]] = columns[assigned]
    right = int(near[rows, columns].sum())
    return IdentityScores(track, right, people - right, tracks - right)
