"""Scores of all frames of a recording at once.

They equal those of :func:`simharness.scoring.frame.score_frame`, at a tenth of its time: a validation scores more than
a million frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from mvpose.skeleton import COCO17, HeadMapping, coco17_to_shelf14
from simharness.reality.validation.head_joints import fill_face
from simharness.scoring.pairing import assign, mean_where_shared
from simharness.scoring.pcp import part_states


@dataclass(frozen=True)
class HeadRule:
    """Rule for the head joints of estimates.

    Attributes:
        mapping: mapping from COCO-17 to the head of SHELF14.
        filled: whether missing joints of the face are first completed from the others (``fill_face``).
    """

    mapping: HeadMapping
    filled: bool = False

    def __str__(self) -> str:
        return f"{self.mapping}, filled" if self.filled else self.mapping


RULES = (HeadRule("voxelpose"), HeadRule("2019"), HeadRule("voxelpose", filled=True), HeadRule("2019", filled=True))
"""Rules that every estimate is scored by, in the order of the axes of scores."""


@dataclass(frozen=True)
class FrameScores:
    """Scores of a variant in F annotated frames with A actors, by the H = 4 rules of :data:`RULES`.

    Attributes:
        parts: state of every part, :class:`simharness.scoring.pcp.Part`, (H, F, A, 10).
        errors: distance of every joint from the estimate paired one to one with its actor, (H, F, A, 14), metres; NaN
            without a pair, or where the truth or the estimate lacks the joint.
        found: which actors have a pair, (H, F, A).
        present: which actors are annotated, (F, A).
        estimates: number of estimates, (F,).
    """

    parts: NDArray[np.int8]
    errors: Floats
    found: Bools
    present: Bools
    estimates: NDArray[np.int64]


def score_frames(truth: Floats, estimates: Sequence[Floats]) -> FrameScores:
    """Score the estimates of F frames.

    Args:
        truth: joints of the actors on SHELF14, (F, A, 14, 3), metres; NaN where not annotated.
        estimates: joints of the estimates of each frame on COCO17, F arrays (n, 17, 3), metres; NaN where missing.
    """
    counts = np.array([len(each) for each in estimates], np.int64)
    joints = np.full((len(truth), max(1, counts.max(initial=0)), len(COCO17), 3), np.nan)
    for frame, each in enumerate(estimates):
        joints[frame, : len(each)] = each
    filled = fill_face(joints)
    scored = [
        _score(truth, coco17_to_shelf14(filled if rule.filled else joints, head=rule.mapping), counts) for rule in RULES
    ]
    parts, errors, found = (np.stack(each) for each in zip(*scored, strict=True))
    present: Bools = np.any(np.isfinite(truth).all(axis=-1), axis=-1)
    return FrameScores(parts, errors, found, present, counts)


def _score(truth: Floats, joints: Floats, counts: NDArray[np.int64]) -> tuple[NDArray[np.int8], Floats, Bools]:
    """Return parts (F, A, 10), joint errors (F, A, 14) and found actors (F, A) of estimates (F, N, 14, 3)."""
    away = np.linalg.norm(truth[:, :, None] - joints[:, None], axis=-1)  # (F, A, N, 14)
    distance = mean_where_shared(away)
    nearest = np.where(np.isfinite(distance).any(axis=-1), distance.argmin(axis=-1), -1)
    compared = np.where(
        nearest[..., None, None] >= 0,
        np.take_along_axis(joints, np.maximum(nearest, 0)[..., None, None], axis=1),
        np.nan,
    )
    partner = np.full(nearest.shape, -1)
    for frame in np.flatnonzero(counts):
        partner[frame] = assign(distance[frame, :, : counts[frame]])
    found = partner >= 0
    errors = np.take_along_axis(away, np.maximum(partner, 0)[..., None, None], axis=2)[:, :, 0]
    return part_states(truth, compared), np.where(found[..., None], errors, np.nan), found
