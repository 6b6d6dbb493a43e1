"""Scores of identities: IDF1, CLEAR MOT and HOTA. Ours are the numbers of ``trackeval``.

IDF1, IDP and IDR, and the identity of each true person (Ristani et al., ECCV workshops 2016): over the whole sequence
each true person gets at most one identity, and each identity at most one person, so that the estimate of a person's
identity is within the distance in as many frames as possible. Every other frame of a person is missed, and every other
estimate is false: a person whose identity changes halfway is missed half of the time. Joints, PCP and MPJPE of people
under their identities count alike: an estimate under another identity is missed, however near.

HOTA: higher order tracking accuracy (Luiten et al., IJCV 2021), with its parts DetA, AssA and LocA. At each of 19
thresholds of similarity, 0.05 to 0.95, people and estimates of a frame are paired one to one. DetA is the Jaccard index
of people and estimates, ``TP / (TP + FN + FP)``. AssA is the mean over all pairs, each of a person and an identity, of
the Jaccard index of the frames of both; frames where they are paired are common. HOTA is the geometric mean of DetA and
AssA, and LocA the mean similarity of pairs. Scores are means over the thresholds. The pairs of a frame maximise the
similarity, weighted by how well the whole tracks of the two agree (section 4.4 of the paper). Without any pair at a
threshold LocA is 1 there, and without any estimate, or any person, HOTA is 0.

CLEAR MOT: MOTA, identity switches and fragmentations (Bernardin & Stiefelhagen, EURASIP JIVP 2008). In each frame
people and estimates within the distance are paired one to one: pairs of the frame before are kept, and else the sum of
similarities is largest. A person's identity switches where it is paired with another identity than the last time,
however long ago that was. A track is fragmented where a person is paired again after frames without a pair. Frames
without any person or without any estimate are passed over, so that a gap of all people at once is no fragmentation; and
a person who was absent and comes back starts a fragment as one who was missed does.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from mvpose.arrays import Bools, Floats, Integers
from simharness.scoring.frame_scores import on_shelf14
from simharness.scoring.pcp import part_states, percent
from simharness.scoring.score_registry import finite_mean
from simharness.scoring.tracking.tracked_frames import TrackedFrames

_THRESHOLD = 0.5  # of similarity: the estimate is within the distance
_EPSILON = float(np.finfo(float).eps)  # a similarity at the threshold counts


@dataclass(frozen=True)
class IdentityScores:
    """Identities of the true people over the whole sequence."""

    track: Integers
    """Index into ``TrackedFrames.ids`` of the identity of each true person, (P,); -1 for none."""
    right: int
    """Number of frames in which the estimate of a person's identity is within the distance (IDTP)."""
    missed: int
    """Number of all other frames of true people (IDFN)."""
    false: int
    """Number of all other estimates (IDFP)."""

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
    actors: Sequence[int] | None = None,
) -> dict[str, float | None]:
    """Return PCP (percent) and MPJPE (mm) under identities; None without any defined part, or if nobody is found.

    As for PCP all people have equal weight, in however many frames they are present.

    Args:
        frames: people and identities.
        truth: true joints on COCO17 or SHELF14, (T, P, J, 3), metres; NaN where undefined.
        joints: joints of the estimates of each frame on the same skeleton, (k, J, 3), metres.
        distance: largest distance between a person and its estimate, metres.
        actors: indices of the people whose PCP is averaged; None: all.
    """
    placed = tracked_joints(frames, identity_scores(frames, distance=distance), joints, distance=distance)
    parts = part_states(on_shelf14(truth, "voxelpose", "truth"), on_shelf14(placed, "voxelpose", "estimate"))
    chosen = range(frames.people) if actors is None else actors
    shares = [share for actor in chosen if (share := percent(parts[:, actor])) is not None]
    error = 1000.0 * np.linalg.norm(placed - truth, axis=-1)
    known = np.isfinite(error)
    of_person = np.where(known, error, 0.0).sum(axis=-1) / np.maximum(1, known.sum(axis=-1))
    return {
        "pcp_tracked": finite_mean(np.array(shares, float)),
        "mpjpe_tracked_mm": finite_mean(of_person[known.any(axis=-1)]),
    }


THRESHOLDS: Floats = np.arange(0.05, 0.99, 0.05)
"""Thresholds of similarity, (19,)."""


@dataclass(frozen=True)
class Hota:
    """HOTA and its parts at each of the 19 thresholds, all 0 to 1 and (19,)."""

    detection: Floats
    """DetA."""
    association: Floats
    """AssA."""
    location: Floats
    """LocA."""
    pairs: Integers
    """Number of pairs, TP."""

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


ABSENT, MISSED = -2, -1
"""Entries of :attr:`ClearMot.track` without a pair."""

_KEPT = 1000.0  # weight of a pair of the frame before: more than all similarities of a frame


@dataclass(frozen=True)
class ClearMot:
    """Pairs of people and identities in each frame, and what they count."""

    track: Integers
    """Index into ``TrackedFrames.ids`` of the identity that each true person is paired with, (T, P); :data:`MISSED`
    where it has none, :data:`ABSENT` where the person is not there."""
    switched: Bools
    """Where a person's identity is another one than the last time, (T, P)."""
    fragmentations: int
    """How often people are paired again after frames without a pair."""
    missed: int
    """Number of people without a pair in all frames."""
    false: int
    """Number of estimates without a pair in all frames."""

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
