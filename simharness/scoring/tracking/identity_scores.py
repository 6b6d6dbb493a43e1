"""IDF1, IDP and IDR, and the identity of each true person (Ristani et al., ECCV workshops 2016).

Over the whole sequence each true person gets at most one identity, and each identity at most one person, so that the
estimate of a person's identity is within the distance in as many frames as possible. Every other frame of a person is
missed, and every other estimate is false: a person whose identity changes halfway is missed half of the time. Joints,
PCP and MPJPE of people under their identities count alike: an estimate under another identity is missed, however near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Floats
from mvpose.skeleton import HeadMapping
from simharness.scoring.frame_scores import on_shelf14
from simharness.scoring.pcp import part_states, percent
from simharness.scoring.score_registry import finite_mean
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


def tracked_joints(
    frames: TrackedFrames, identities: IdentityScores, joints: Sequence[Floats], *, distance: float
) -> Floats:
    """Return the joints of each true person's estimate under its identity, (T, P, J, 3), metres; NaN where missed.

    Args:
        frames: people and identities.
        identities: identity of each true person.
        joints: joints of the estimates of each frame, (k, J, 3), metres.
        distance: largest distance between a person and its estimate, metres.
    """
    size = joints[0].shape[1:] if len(joints) else (0, 3)
    placed = np.full((len(frames), frames.people, *size), np.nan)
    for row, present, track, apart, estimated in zip(
        placed, frames.present, frames.tracks, frames.distances, joints, strict=True
    ):
        own = (identities.track[present, None] == track) & (apart <= distance)
        people, estimates = np.nonzero(own)
        row[present[people]] = estimated[estimates]
    return placed


def pose_figures(
    frames: TrackedFrames,
    truth: Floats,
    joints: Sequence[Floats],
    *,
    distance: float,
    head: HeadMapping = "voxelpose",
    actors: Sequence[int] | None = None,
) -> dict[str, float | None]:
    """Return PCP (percent) and MPJPE (mm) under identities; None without any defined part, or if nobody is found.

    As for PCP all people have equal weight, in however many frames they are present.

    Args:
        frames: people and identities.
        truth: true joints on COCO17 or SHELF14, (T, P, J, 3), metres; NaN where undefined.
        joints: joints of the estimates of each frame on the same skeleton, (k, J, 3), metres.
        distance: largest distance between a person and its estimate, metres.
        head: mapping of COCO17 to the head of SHELF14, on which PCP is computed.
        actors: indices of the people whose PCP is averaged; None: all.
    """
    placed = tracked_joints(frames, identity_scores(frames, distance=distance), joints, distance=distance)
    parts = part_states(on_shelf14(truth, head, "truth"), on_shelf14(placed, head, "estimate"))
    chosen = range(frames.people) if actors is None else actors
    shares = [share for actor in chosen if (share := percent(parts[:, actor])) is not None]
    error = 1000.0 * np.linalg.norm(placed - truth, axis=-1)
    known = np.isfinite(error)
    of_person = np.where(known, error, 0.0).sum(axis=-1) / np.maximum(1, known.sum(axis=-1))
    return {
        "pcp_tracked": finite_mean(np.array(shares, float)),
        "mpjpe_tracked_mm": finite_mean(of_person[known.any(axis=-1)]),
    }
