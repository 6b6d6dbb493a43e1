"""HOTA: higher order tracking accuracy (Luiten et al., IJCV 2021), with its parts DetA, AssA and LocA.

At each of 19 thresholds of similarity, 0.05 to 0.95, people and estimates of a frame are paired one to one. DetA is the
Jaccard index of people and estimates, ``TP / (TP + FN + FP)``. AssA is the mean over all pairs, each of a person
and an identity, of the Jaccard index of the frames of both; frames where they are paired are common. HOTA is the
geometric mean of DetA and AssA, and LocA the mean similarity of pairs. Scores are means over the thresholds.

The pairs of a frame maximise the similarity, weighted by how well the whole tracks of the two agree (section 4.4 of the
paper). Ours are the numbers of ``trackeval``, also where it has a rule of its own: without any pair at a threshold LocA
is 1 there, and without any estimate, or any person, HOTA is 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Floats
from simharness.scoring.tracking.tracked_frames import TrackedFrames

THRESHOLDS: Floats = np.arange(0.05, 0.99, 0.05)
"""Thresholds of similarity, (19,)."""

_EPSILON = float(np.finfo(float).eps)  # a similarity at the threshold counts


@dataclass(frozen=True)
class Hota:
    """HOTA and its parts at each of the 19 thresholds, all 0 to 1 and (19,).

    Attributes:
        detection: DetA.
        association: AssA.
        location: LocA.
        pairs: number of pairs, TP.
    """

    detection: Floats
    association: Floats
    location: Floats
    pairs: NDArray[np.int64]

    @property
    def hota(self) -> Floats:
        """HOTA at each threshold."""
        return np.sqrt(self.detection * self.association)


def hota(frames: TrackedFrames, *, distance: float) -> Hota:
    """Return HOTA of estimated identities.

    Args:
        frames: people and identities.
        distance: distance at which the similarity is 0.5, metres.
    """
    people, tracks = frames.frames_of_people, frames.frames_of_tracks
    similarities = frames.similarities(distance)
    agreement = _agreement(frames, similarities)
    joint = np.zeros((len(THRESHOLDS), frames.people, len(frames.ids)))  # frames in which both are paired
    similarity_sum = np.zeros(len(THRESHOLDS))
    for present, track, similarity in zip(frames.present, frames.tracks, similarities, strict=True):
        rows, columns = linear_sum_assignment(-agreement[np.ix_(present, track)] * similarity)
        paired = similarity[rows, columns] >= THRESHOLDS[:, None] - _EPSILON
        joint[:, present[rows], track[columns]] += paired
        similarity_sum += paired @ similarity[rows, columns]
    pairs = joint.sum(axis=(1, 2))
    either = people[:, None] + tracks - joint
    association = (joint * joint / np.maximum(1.0, either)).sum(axis=(1, 2)) / np.maximum(1.0, pairs)
    return Hota(
        detection=pairs / np.maximum(1.0, people.sum() + tracks.sum() - pairs),
        association=association,
        location=np.maximum(1e-10, similarity_sum) / np.maximum(1e-10, pairs),
        pairs=pairs.astype(np.int64),
    )


def _agreement(frames: TrackedFrames, similarities: list[Floats]) -> Floats:
    """Return the soft Jaccard index of the tracks of each person and identity, before any pairs are made, (P, K)."""
    shared = np.zeros((frames.people, len(frames.ids)))
    for present, track, similarity in zip(frames.present, frames.tracks, similarities, strict=True):
        total = similarity.sum(axis=0) + similarity.sum(axis=1, keepdims=True) - similarity
        share = np.divide(similarity, total, out=np.zeros_like(similarity), where=total > _EPSILON)
        shared[np.ix_(present, track)] += share
    return shared / (frames.frames_of_people[:, None] + frames.frames_of_tracks - shared)
