"""What tracked people look like, and how much it says about who has come back.

A track keeps the mean of the unit descriptors of its detections. The inner product of two means is the mean cosine over
all pairs of their detections, so distances have the scale of :class:`mvpose.affinity.AppearanceAffinity` for single
pairs, however many detections there are. As in :class:`mvpose.affinity.FusedAffinity`, the distance that counts as
large depends on the people: where somebody else, who was seen at the same time, looks as much like a person as that
person does, appearance says nothing.
"""

import numpy as np

from mvpose.affinity import AppearanceAffinity
from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.tracking.tracks import Tracks

_MEMORY = 60.0  # seconds that a mean covers: in a minute people show all their sides
_LONGEST = 1.0  # seconds for which one frame counts at most


def scale_of(affinity: object) -> AppearanceAffinity:
    """Return the scale of descriptor distances of an affinity; the general one if it has none."""
    for each in (affinity, getattr(affinity, "appearance", None)):
        if isinstance(each, AppearanceAffinity):
            return each
    return AppearanceAffinity()


@njit(cache=True)
def learn_looks(looks, described, owner, descriptors, elapsed):
    """Update what n tracks look like by the descriptors of m detections, in place; return their number, (n,).

    Args:
        looks: mean unit descriptors, (n, D).
        described: seconds that each mean covers, (n,).
        owner: track of each detection, (m,), or -1.
        descriptors: of any length, (m, D); NaN or zero for none.
        elapsed: seconds since the previous frame.
    """
    n, dimensions = looks.shape
    sums, count = np.zeros((n, dimensions)), np.zeros(n, np.int64)
    for d in range(len(owner)):
        square = 0.0
        for k in range(dimensions):
            square += descriptors[d, k] * descriptors[d, k]
        if owner[d] >= 0 and 0.0 < square < np.inf:
            count[owner[d]] += 1
            for k in range(dimensions):
                sums[owner[d], k] += descriptors[d, k] / np.sqrt(square)
    weight = min(max(elapsed, 1e-3), _LONGEST)
    for t in range(n):
        if count[t]:
            share = weight / (described[t] + weight)
            described[t] = min(described[t] + weight, _MEMORY)
            for k in range(dimensions):
                looks[t, k] += share * (sums[t, k] / count[t] - looks[t, k])
    return count


@njit(cache=True)
def look_distances(one, other):
    """Return the distances (n, k) of unit vectors whose cosines are those of means (n, D) and (k, D)."""
    distance = np.empty((len(one), len(other)))
    for i in range(len(one)):
        for k in range(len(other)):
            cosine = 0.0
            for d in range(one.shape[1]):
                cosine += one[i, d] * other[k, d]
            distance[i, k] = np.sqrt(max(2.0 - 2.0 * cosine, 0.0))
    return distance


def nearest_rival(tracks: Tracks, others: Tracks) -> Floats:
    """Return the least distance of each track (n,) to one of the others who was there at the same time.

    Only tracks that were people count, because the detections of a ghost may be torn from a person's. Infinite where
    there is none.
    """
    if not len(tracks) or not len(others) or not tracks.looks.shape[1]:
        return np.full(len(tracks), np.inf)
    together = (others.born_at < tracks.seen[:, None]) & (tracks.born_at[:, None] < others.seen)
    counts = others.reported & (others.described > 0.0) & (others.ids != tracks.ids[:, None])
    distance = look_distances(tracks.looks, others.looks)
    return np.where(together & counts, distance, np.inf).min(axis=1)


def evidence_of_looks(
    born: Tracks, lost: Tracks, present: Tracks, witnesses: Integers, scale: AppearanceAffinity
) -> Floats:
    """Return the log-likelihood ratio of being the same person and somebody new, (n, k); 0 where nothing is known.

    Args:
        born: n new tracks.
        lost: k lost ones.
        present: people who are followed, none of whom is a new or a lost one.
        witnesses: descriptors of each new track, (n,). The views show the same clothes, so the evidence grows with the
            root of their number.
        scale: scale of descriptor distances.
    """
    if not len(born) or not len(lost) or not born.looks.shape[1]:
        return np.zeros((len(born), len(lost)))
    distance = look_distances(born.looks, lost.looks)
    rival = np.minimum(scale.midpoint, np.minimum(lost.rival, nearest_rival(lost, present)))[None, :]
    here = present.reported & (present.described > 0.0)
    for others, counts in ((present.looks, here), (born.looks, born.described > 0.0)):
        away = np.where(counts, look_distances(born.looks, others), np.inf)
        if others is born.looks:
            np.fill_diagonal(away, np.inf)
        rival = np.minimum(rival, away.min(axis=1, initial=np.inf)[:, None])
    nats = np.maximum(rival - distance, 0.0) - np.maximum(distance - scale.midpoint, 0.0)
    known = (born.described > 0.0)[:, None] & (lost.described > 0.0)
    return np.where(known, nats / scale.slope * np.sqrt(witnesses)[:, None], 0.0)
