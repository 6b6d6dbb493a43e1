"""Joints, PCP and MPJPE of people under their identities.

A true person is found in a frame if the estimate of its identity over the whole sequence
(:func:`simharness.scoring.tracking.identity_scores.identity_scores`) is within the distance. An estimate under another
identity counts as missed, however near it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose.arrays import Floats
from mvpose.skeleton import HeadMapping
from simharness.scoring.frame_scores import on_shelf14
from simharness.scoring.pcp import part_states, percent
from simharness.scoring.score_registry import finite_mean
from simharness.scoring.tracking.identity_scores import IdentityScores, identity_scores
from simharness.scoring.tracking.tracked_frames import TrackedFrames


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
