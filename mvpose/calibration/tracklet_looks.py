"""Evidence of appearance that two tracklets show one person."""

from __future__ import annotations

import numpy as np

from mvpose.affinity.appearance import AppearanceAffinity
from mvpose.arrays import Bools, Floats
from mvpose.calibration.tracklets import Tracklets


def mean_looks(tracklets: Tracklets) -> tuple[Floats, Bools]:
    """Return the mean unit descriptor of each tracklet, (tracklets, D), and whether it has one, (tracklets,)."""
    count = len(tracklets)
    descriptors = tracklets.descriptors
    if descriptors is None or not descriptors.shape[1]:
        return np.zeros((count, 0)), np.zeros(count, np.bool_)
    length = np.linalg.norm(descriptors, axis=1)
    described = np.isfinite(length) & (length > 0.0)
    unit = descriptors[described] / length[described, None]
    total, number = np.zeros((count, descriptors.shape[1])), np.bincount(tracklets.tracklet[described], minlength=count)
    np.add.at(total, tracklets.tracklet[described], unit)
    return total / np.maximum(number, 1)[:, None], number > 0


def evidence_of_looks(tracklets: Tracklets, apart: Bools, *, scale: AppearanceAffinity | None = None) -> Floats:
    """Return the log-likelihood ratio that two tracklets show one person or two, (n, n); 0 without descriptors.

    As in tracking (:func:`mvpose.tracking.looks.evidence_of_looks`), looks speak for one person by as much as they are
    more alike than those of people who are known to be others: in one uniform they are no evidence. They speak against
    it where they are farther apart than those of one person.

    Args:
        tracklets: tracklets of all views.
        apart: which tracklets are known to show different people, or to be the same one, (n, n).
        scale: scale of descriptor distances.
    """
    scale = scale or AppearanceAffinity()
    looks, described = mean_looks(tracklets)
    if not described.any():
        return np.zeros(apart.shape)
    distance = np.sqrt(np.maximum(2.0 - 2.0 * looks @ looks.T, 0.0))
    other = apart & ~np.eye(len(apart), dtype=bool) & described
    rival = np.full(apart.shape, scale.midpoint)
    for each in np.flatnonzero(other.any(axis=1)):  # somebody else, seen beside this one
        rival[:, each] = np.minimum(rival[:, each], distance[:, other[each]].min(axis=1))
    rival = np.minimum(rival, rival.T)
    nats = np.maximum(rival - distance, 0.0) - np.maximum(distance - scale.midpoint, 0.0)
    return np.where(described[:, None] & described, nats / scale.slope, 0.0)
