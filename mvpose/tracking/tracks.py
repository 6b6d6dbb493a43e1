"""Tracked people as arrays, the lost ones who may come back, and what a tracker knows after a frame."""

from copy import copy as shallow_copy
from dataclasses import dataclass, fields, replace
from typing import NamedTuple, Self

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.reconstruction.poses import Poses
from mvpose.tracking.bones import BonePrior, scaled_lengths


class TrackedPoses(NamedTuple):
    """Poses of n tracks as kernels take them: fields of :class:`Tracks`, in place."""

    state: Floats
    """Position and velocity of every joint, (n, J, 6), metres and m/s; NaN for an unknown joint."""
    covariance: Floats
    """Their covariances, (n, J, 6, 6)."""
    scores: Floats
    """Confidence of every joint, (n, J), 0 to 1."""
    length: Floats
    """Bone lengths, (n, B), metres."""
    variance: Floats
    """Variances of the bone lengths, (n, B), square metres."""


@dataclass
class Tracks:
    """State of n tracks with J joints, B bones and V cameras, as arrays that kernels update in place."""

    ids: Integers
    """Identities, (n,), numbered from 0 in the order of birth."""
    state: Floats
    """Position and velocity of every joint, (n, J, 6), metres and m/s; NaN for an unknown joint."""
    covariance: Floats
    """Their covariances, (n, J, 6, 6)."""
    scores: Floats
    """Confidence of every joint, (n, J), 0 to 1."""
    length: Floats
    """Bone lengths, (n, B), metres."""
    variance: Floats
    """Variances of the bone lengths, (n, B), square metres."""
    span: Floats
    """Time before its birth in which each may have come, (n,), seconds."""
    born_at: Floats
    """Time of birth, (n,), seconds."""
    origin: Bools
    """Views that the track was born from, (n, V)."""
    hits: Floats
    """Effective number of pictures of each camera that found the person, (n, V)."""
    misses: Floats
    """Effective number of pictures that should have and did not, (n, V)."""
    absent: Floats
    """Effective number of pictures that should have found the person since one last did, (n, V)."""
    found: Floats
    """Time at which each camera last found the track, (n, V), seconds; -inf if none ever did."""
    anchor: Floats
    """Place of each joint when it was first known, (n, J, 3), metres; NaN before."""
    moved: Floats
    """How far the body as a whole has been from there, (n,), metres."""
    reported: Bools
    """Whether the track has ever been reported as a person, (n,)."""
    looks: Floats
    """Mean of the unit descriptors of the track's detections, (n, D), zeros before there is any."""
    described: Floats
    """Seconds of detections with descriptors in this mean, (n,), 0 for none."""
    rival: Floats
    """Least distance to the descriptors of anybody else who was there at the same time, (n,), infinite where nobody is
    known; see :mod:`mvpose.tracking.reappearance`."""

    @classmethod
    def none(cls, *, joints: int, bones: int, cameras: int, dimensions: int = 0) -> Self:
        """Return an empty set of tracks."""
        scores, places = np.empty((0, joints)), np.empty((0, joints, 3))
        poses, ids = Poses(places, scores, np.empty((0, joints, 3, 3)), scores), np.empty(0, np.int64)
        prior = BonePrior(np.zeros((bones, 2), np.int64), np.ones(bones), np.ones(bones))
        speed, sizes = np.zeros(joints), {"cameras": cameras, "dimensions": dimensions}
        return cls.born(poses, ids=ids, time=0.0, span=0.0, speed=speed, bones=prior, **sizes)

    @classmethod
    def born(
        cls,
        poses: Poses,
        *,
        ids: Integers,
        time: float,
        span: float,
        speed: Floats,
        bones: BonePrior,
        cameras: int,
        dimensions: int = 0,
    ) -> Self:
        """Return tracks of n people who are seen for the first time.

        Args:
            poses: their poses.
            ids: identities, (n,).
            time: seconds.
            span: time in which they may have come, seconds.
            speed: standard deviation of a velocity component, (J,), m/s.
            bones: bones of the skeleton.
            cameras: number of cameras, V.
            dimensions: length of descriptors, D.
        """
        joints = poses.joints
        n, count = joints.shape[:2]
        moments = np.zeros((n, count, 6, 6))
        moments[:, :, :3, :3] = poses.covariance
        moments[:, :, range(3, 6), range(3, 6)] = (speed**2)[:, None]
        return cls(
            ids=np.asarray(ids, np.int64),
            state=np.concatenate([joints, np.where(np.isnan(joints), np.nan, 0.0)], axis=2),
            covariance=moments,
            scores=poses.scores.copy(),
            length=scaled_lengths(joints, bones),
            variance=np.tile(bones.variance, (n, 1)),
            span=np.full(n, span),
            born_at=np.full(n, time),
            origin=np.zeros((n, cameras), np.bool_),
            hits=np.zeros((n, cameras)),
            misses=np.zeros((n, cameras)),
            absent=np.zeros((n, cameras)),
            found=np.full((n, cameras), -np.inf),
            anchor=np.full((n, count, 3), np.nan),
            moved=np.zeros(n),
            reported=np.zeros(n, np.bool_),
            looks=np.zeros((n, dimensions)),
            described=np.zeros(n),
            rival=np.full(n, np.inf),
        )

    @property
    def poses(self) -> TrackedPoses:
        """The poses of the tracks, whose arrays they share."""
        return TrackedPoses(self.state, self.covariance, self.scores, self.length, self.variance)

    @property
    def seen(self) -> Floats:
        """Time at which any camera last found each track, (n,), seconds."""
        return self.found.max(axis=1)

    @property
    def agreed(self) -> Floats:
        """Time since which no two cameras have found the track, (n,), seconds."""
        return np.sort(self.found, axis=1)[:, -2]

    def resume(self, k: int, lost: Self, other: int) -> None:
        """Give track k the bone lengths and the looks that a lost one of its identity had learned."""
        self.length[k], self.variance[k] = lost.length[other], lost.variance[other]
        self.born_at[k] = lost.born_at[other]
        self.rival[k] = lost.rival[other]
        if lost.described[other] > 0.0:
            self.looks[k], self.described[k] = lost.looks[other], lost.described[other]

    def __len__(self) -> int:
        return len(self.ids)

    def select(self, which: Bools | Integers) -> Self:
        """Return copies of some tracks, given by a mask (n,) or by indices."""
        return type(self)(*(getattr(self, field.name)[which] for field in fields(self)))

    def widened(self, dimensions: int) -> Self:
        """Return these tracks, which have no descriptors, with room for some of this length."""
        return replace(self, looks=np.zeros((len(self), dimensions)))

    def snapshot(self) -> Self:
        """Return these tracks with copies of what an estimate needs; later frames change all else."""
        kept = shallow_copy(self)
        for name in ("state", "covariance", "scores", "length", "variance"):
            setattr(kept, name, getattr(self, name).copy())
        return kept

    def join(self, others: Self) -> Self:
        """Return these tracks followed by others."""
        if not len(others):
            return self
        return type(self)(
            *(np.concatenate([getattr(self, field.name), getattr(others, field.name)]) for field in fields(self))
        )


@dataclass
class Moment:
    """What a tracker knows after a frame, for its estimate and for smoothing."""

    time: float
    """Time of the frame, seconds; NaN before the first picture."""
    elapsed: float
    """Time since the previous frame, seconds."""
    tracks: Tracks
    """Tracks after the frame, with those that end here."""
    predicted: tuple[Floats, Floats] | None
    """State of each track before the frame, (n, J, 6), and its covariance, (n, J, 6, 6); NaN for new tracks. None where
    nobody smooths."""
    odds: Floats
    """Log-odds that each track is a person, (n,)."""
    presence: Floats
    """Log-odds that this person is still here, (n,)."""
    shown: Bools
    """Whether each track is reported, (n,)."""
    owner: Integers
    """Track of each detection that took part, (k,), or -1."""
    chosen: Integers
    """Indices of these detections, (k,)."""
    detections: int
    """Number of detections of the frame."""
    poses: Poses | None
    """Poses of the tracks as the pipeline gives them, where the frame is the first."""
    timings: dict[str, float]
    """Seconds by stage."""
    link: tuple[Integers, Floats] | None = None
    """Row of each track in the next moment and the gains of the smoother, where they are known already."""
