"""Evaluation of tracked people in files against the truth of a recording."""

from __future__ import annotations

import numpy as np

from mvpose import COCO17, Estimate, Matching
from mvpose.recording import People
from mvpose.skeleton import HeadMapping
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.evaluation import Evaluation, score_estimates

VARIANT = "files"
"""Name of the people of files in an evaluation."""


def evaluate_people(
    recording: AnnotatedRecording, people: People, *, first: int = 0, head: HeadMapping = "voxelpose"
) -> Evaluation:
    """Score tracked people on a recording.

    Args:
        recording: the recording of F frames.
        people: people of T frames.
        first: number that the recording gives to the first frame of the people.
        head: mapping to the head of SHELF14.

    Raises:
        ValueError: people on another skeleton than COCO-17, or without some frames of the recording.
    """
    rows = recording.frames - first
    if len(rows) and not 0 <= rows.min() <= rows.max() < people.frames:
        raise ValueError(
            f"the people are of {people.frames} frames, {first} to {first + people.frames - 1} of {recording.name}, "
            f"which has the frames {recording.frames.min()} to {recording.frames.max()}; estimate all of them, or give "
            "the number of the first estimated frame as --first"
        )
    return score_estimates(recording, {VARIANT: [_estimate(people, row) for row in rows.tolist()]}, head=head)


def _estimate(people: People, row: int) -> Estimate:
    """Return the people of a frame, with their identities."""
    if people.skeleton != COCO17:
        raise ValueError(f"people must be on the skeleton {COCO17.name}, got {people.skeleton.name}")
    here = people.present[row].any(axis=1)
    return Estimate(
        people.joints[row, here], people.scores[row, here], Matching(np.zeros(0, np.int64)), ids=people.ids[here]
    )
