"""Identities of a run through time, ready for plots: who has which, when, in which colour, and where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17, Estimate
from mvpose.arrays import Floats
from mvpose.report.palette import UNMATCHED, css, identity_color
from mvpose.report.svg_plots import Color
from simharness.scoring.tracking.clear_mot import ClearMot, clear_mot
from simharness.scoring.tracking.identity_figures import DISTANCE
from simharness.scoring.tracking.identity_scores import identity_scores
from simharness.scoring.tracking.tracked_frames import TrackedFrames, ids_of, roots, tracked_frames

Labels = NDArray[np.int64]


@dataclass(frozen=True)
class Identities:
    """Identities of one variant.

    Attributes:
        time: times of the frames, (T,), seconds.
        frames: people and identities.
        pairs: the pairs of both in each frame, by which switches are counted.
        paths: roots of the true people from above, (T, P, 2), metres; NaN where absent.
        places: roots of the estimates of each frame from above, (k, 2), metres.
        colors: colour of each of the K identities: that of the person that it stands for, others after those; grey for
            an identity that never is a person's.
    """

    time: Floats
    frames: TrackedFrames
    pairs: ClearMot
    paths: Floats
    places: tuple[Floats, ...]
    colors: tuple[Color, ...]

    @property
    def ghosts(self) -> list[tuple[int, Labels]]:
        """Index of each identity that has estimates without a person, and the frames of these, ascending by time."""
        found: dict[int, list[int]] = {}
        for frame, (tracks, paired) in enumerate(zip(self.frames.tracks, self.pairs.track, strict=True)):
            for track in np.setdiff1d(tracks, paired).tolist():
                found.setdefault(track, []).append(frame)
        return [(track, np.array(frames)) for track, frames in found.items()]

    @property
    def stretches(self) -> list[tuple[int, Floats]]:
        """Paths from above in the order of identities: the index of an identity, and its places, (k, 2), metres.

        An identity has several where it is missing for some frames, or goes over to another person.
        """
        person = {
            (frame, track): people
            for frame, row in enumerate(self.pairs.track.tolist())
            for people, track in enumerate(row)
            if track >= 0
        }
        parts: dict[int, list[list[Floats]]] = {}
        last: dict[int, tuple[int, int]] = {}  # frame and person of each identity
        for frame, (tracks, places) in enumerate(zip(self.frames.tracks, self.places, strict=True)):
            for track, place in zip(tracks.tolist(), places, strict=True):
                before, whose = last.get(track, (-2, -1))
                now = person.get((frame, track), whose)
                if before < frame - 1 or now != whose >= 0:
                    parts.setdefault(track, []).append([])
                parts[track][-1].append(place)
                last[track] = (frame, now)
        return [(track, np.array(part)) for track in sorted(parts) for part in parts[track]]


def identities_of(truth: Floats, estimates: Sequence[Estimate], time: Floats) -> Identities | None:
    """Return the identities of a variant; None if it does not track people.

    Args:
        truth: true joints, (T, P, 17, 3), metres; NaN where a person is absent.
        estimates: estimates, T.
        time: times of the frames, (T,), seconds.
    """
    ids = ids_of(estimates)
    if ids is None:
        return None
    frames = tracked_frames(truth, [estimate.joints for estimate in estimates], ids, skeleton=COCO17)
    pairs = clear_mot(frames, distance=DISTANCE)
    return Identities(
        time=time,
        frames=frames,
        pairs=pairs,
        paths=roots(truth, COCO17)[..., 0, :2],
        places=tuple(roots(estimate.joints, COCO17)[:, 0, :2] for estimate in estimates),
        colors=_colors(frames, pairs),
    )


def _colors(frames: TrackedFrames, pairs: ClearMot) -> tuple[Color, ...]:
    index = np.full(len(frames.ids), -1)
    own = identity_scores(frames, distance=DISTANCE).track
    index[own[own >= 0]] = np.flatnonzero(own >= 0)
    spare = frames.people
    for track in dict.fromkeys(pairs.track[pairs.track >= 0].tolist()):  # in the order of time
        if index[track] < 0:
            index[track], spare = spare, spare + 1
    return tuple(css(UNMATCHED) if each < 0 else identity_color(each) for each in index.tolist())
