"""Figures of identities at one distance, and None where one does not apply."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.scoring.tracking.clear_mot import clear_mot
from simharness.scoring.tracking.hota import hota
from simharness.scoring.tracking.identity_scores import identity_scores
from simharness.scoring.tracking.tracked_frames import TrackedFrames

Figures = dict[str, float | None]

SHARES = ("hota", "deta", "assa", "loca", "idf1", "idp", "idr", "mota")
COUNTS = ("id_switches", "fragmentations", "interruptions", "switches_per_minute")

OF_SOME_PEOPLE = ("idr", "id_switches", "interruptions", "switches_per_minute")
"""Figures that hold where some people are annotated, in some frames: all others count the estimates of the rest as
false, or the other frames as gaps."""


def identity_figures(frames: TrackedFrames, time: Floats, *, distance: float) -> Figures:
    """Return HOTA, DetA, AssA, LocA, IDF1, IDP, IDR and MOTA as shares, and numbers of switches and gaps.

    All are None without true people; IDP without estimates, LocA without pairs, switches a minute with one frame alone.

    Args:
        frames: people and identities.
        time: times of the frames, (T,), seconds.
        distance: distance at which the similarity is 0.5, and largest distance of a pair, metres.
    """
    people = int(frames.frames_of_people.sum())
    if not people:
        return dict.fromkeys((*SHARES, *COUNTS))
    higher = hota(frames, distance=distance)
    names = identity_scores(frames, distance=distance)
    pairs = clear_mot(frames, distance=distance)
    minutes = people * float(np.median(np.diff(time))) / 60.0 if len(time) > 1 else 0.0
    return {
        "hota": float(higher.hota.mean()),
        "deta": float(higher.detection.mean()),
        "assa": float(higher.association.mean()),
        "loca": float(higher.location.mean()) if higher.pairs.any() else None,
        "idf1": names.f1,
        "idp": names.precision if frames.frames_of_tracks.any() else None,
        "idr": names.recall,
        "mota": pairs.mota,
        "id_switches": float(pairs.switches),
        "fragmentations": float(pairs.fragmentations),
        "interruptions": float(pairs.interruptions),
        "switches_per_minute": pairs.switches / minutes if minutes else None,
    }
