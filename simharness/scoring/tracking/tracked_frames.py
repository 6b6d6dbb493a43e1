"""True people and estimated identities of each frame, with the distances between them: the input of all scores of
identities.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from mvpose import Estimate, Skeleton
from mvpose.arrays import Floats, Integers
from mvpose.checks import as_array
from simharness.scoring.pairing import mean_distances

Place = Literal["mean_joint", "root"]
"""What the distance between a true and an estimated person is: the mean distance of the joints that both have, or the
distance between the roots, the middles of the hips."""

PLACES: tuple[Place, ...] = get_args(Place)

DISTANCES = (0.25, 0.5, 1.0)
"""Distances at which the similarity is 0.5, metres."""


@dataclass(frozen=True)
class TrackedFrames:
    """True people and estimated identities of T frames."""

    people: int
    """Number of true people P, present or not."""
    ids: Integers
    """The K different identities in ascending order, (K,)."""
    present: tuple[Integers, ...]
    """For each frame, the g true people who are in it, (g,), ascending."""
    tracks: tuple[Integers, ...]
    """For each frame, the index into ``ids`` of each of its k estimates, (k,), all different."""
    distances: tuple[Floats, ...]
    """For each frame, distances between them, (g, k), metres; infinite where they cannot be compared."""

    def __len__(self) -> int:
        """T, the number of frames."""
        return len(self.present)

    @property
    def frames_of_people(self) -> Integers:
        """Number of frames in which each true person is present, (P,)."""
        return np.bincount(np.concatenate([_NOBODY, *self.present]), minlength=self.people)

    @property
    def frames_of_tracks(self) -> Integers:
        """Number of frames in which each identity has an estimate, (K,)."""
        return np.bincount(np.concatenate([_NOBODY, *self.tracks]), minlength=len(self.ids))

    def similarities(self, distance: float) -> list[Floats]:
        """Return the similarities of each frame, (g, k): 1 at no distance, 0.5 at this one, 0 from twice this one on.

        Args:
            distance: distance at which the similarity is 0.5, metres.
        """
        return [np.maximum(0.0, 1.0 - each / (2.0 * distance)) for each in self.distances]


_NOBODY = np.zeros(0, np.int64)


def tracked_frames(
    truth: ArrayLike,
    joints: Sequence[ArrayLike],
    ids: Sequence[ArrayLike],
    *,
    skeleton: Skeleton,
    place: Place = "mean_joint",
) -> TrackedFrames:
    """Compare the true people and the estimates of every frame.

    Args:
        truth: true joints, (T, P, J, 3), metres; NaN where undefined. A person is absent from a frame without any
            defined joint, or without a hip where roots are compared.
        joints: joints of the estimates of each frame, (k, J, 3), metres; NaN where missing.
        ids: identity of each of these estimates, (k,).
        skeleton: skeleton of the J joints.
        place: what is compared.

    Raises:
        ValueError: shapes that differ, an identity that two estimates of a frame share, or an unknown place.
    """
    if place not in PLACES:
        raise ValueError(f"place must be one of {', '.join(PLACES)}, got {place!r}")
    truth = as_array(truth, ("T", "P", len(skeleton), 3), "truth")
    if not len(truth) == len(joints) == len(ids):
        raise ValueError(f"expected joints and ids of {len(truth)} frames, got {len(joints)} and {len(ids)}")
    estimated = [as_array(each, ("k", len(skeleton), 3), "joints") for each in joints]
    named = [
        as_array(each, (len(frame),), f"ids of frame {number}", np.int64)
        for number, (frame, each) in enumerate(zip(estimated, ids, strict=True))
    ]
    for number, each in enumerate(named):
        values, counts = np.unique(each, return_counts=True)
        if (counts > 1).any():
            raise ValueError(
                f"the identities of a frame must differ, but frame {number} has {counts.max()} estimates "
                f"of identity {values[counts.argmax()]}"
            )
    if place == "root":
        truth = roots(truth, skeleton)
        estimated = [roots(each, skeleton) for each in estimated]
    known = np.unique(np.concatenate([_NOBODY, *named]))
    present = [np.flatnonzero(np.isfinite(people).all(axis=-1).any(axis=-1)) for people in truth]
    return TrackedFrames(
        people=truth.shape[1],
        ids=known,
        present=tuple(present),
        tracks=tuple(np.searchsorted(known, each) for each in named),
        distances=tuple(
            mean_distances(true[people], frame) for true, people, frame in zip(truth, present, estimated, strict=True)
        ),
    )


def ids_of(estimates: Sequence[Estimate]) -> list[Integers] | None:
    """Return the identities of each frame, (k,); None without frames, or if people are not tracked in one of them."""
    ids = [estimate.ids for estimate in estimates if estimate.ids is not None]
    return ids if ids and len(ids) == len(estimates) else None


def roots(joints: Floats, skeleton: Skeleton) -> Floats:
    """Return the middle of the hips of people, (..., 1, 3), from their joints (..., J, 3); NaN without both hips."""
    hips = [skeleton.index("left_hip"), skeleton.index("right_hip")]
    return joints[..., hips, :].mean(axis=-2, keepdims=True)
