"""Evaluation of methods, or of people in files, on recorded data by the published protocol.

Published scores on Campus and Shelf are those of tables 1 and 2 of

    Dong, Jiang, Huang, Bao, Zhou: Fast and Robust Multi-Person 3D Pose Estimation from Multiple Views, CVPR 2019.

They are percentages of correct parts (PCP). Those of Dong et al. were made with their detections and the head mapping
"2019"; the rows of other methods are as that paper quotes them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mvpose import COCO17, Detections, Estimate, Matching
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.files.input_files import parse_toml
from mvpose.recording import People
from mvpose.skeleton import HeadMapping
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.matching import count_violations
from simharness.scoring.score_summary import VariantScores, summarize
from simharness.scoring.tracking.identity_figures import tracking_of_some
from simharness.trial.conditioned_trial import estimate_frames

FILES = "files"
"""Name of the people of files in an evaluation."""


@dataclass(frozen=True)
class Evaluation:
    """Scores of variants on a recording."""

    name: str
    """Name of the recording."""
    head: HeadMapping
    """Mapping from COCO-17 to the head of SHELF14."""
    frames: int
    """Number of frames that the variants were given."""
    annotated: int
    """Number of these frames that have truth and are scored."""
    variants: Mapping[str, VariantScores]
    """Scores by variant."""
    violations: Mapping[str, int | None]
    """By variant, the number of detections that share a label with another detection of their view; None for a method
    that does not report which detections belong to its people."""
    actors: tuple[int, ...]
    """Indices of the actors whose PCP is averaged."""

    def summary(self) -> dict[str, Any]:
        """Return the summary, ready for JSON, with the keys of a run's ``summary.json``.

        Further keys: ``head``, ``frames_annotated``, and of every variant ``same_view_violations``, and ``tracking``
        where it has identities (:func:`simharness.scoring.tracking.identity_figures.tracking_of_some`).
        """
        summary = summarize(
            self.name,
            self.variants,
            frames=self.frames,
            seeds=0,
            actors=self.actors,
            head=self.head,
            frames_annotated=self.annotated,
        )
        for name, scores in summary["variants"].items():
            scores["same_view_violations"] = self.violations[name]
        return summary


def evaluate(
    recording: AnnotatedRecording,
    estimators: Mapping[str, Estimator],
    *,
    head: HeadMapping = "voxelpose",
    progress: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Run methods on the frames of a recording and score them.

    Frames without annotation are run and timed, but not scored, because they may contain people. Methods with memory
    get all frames in order, with their times. Each method first runs on the first frame or frames once more, so that
    timings exclude compilation.

    Args:
        recording: the recording.
        estimators: methods by name.
        head: mapping to the head of SHELF14.
        progress: called after every frame with the numbers of finished and of all frames.

    Raises:
        ValueError: an unknown head mapping, or no frames.
        RunError: a method with memory failed; the message names the frame.
    """
    if not len(recording):
        raise ValueError("no frames to evaluate")
    estimates: dict[str, list[Estimate]] = {}
    for number, (name, estimator) in enumerate(estimators.items()):

        def frames(before: int = number * len(recording)) -> Iterator[Detections]:
            for frame, detections in enumerate(recording.timed_detections, start=before):
                if progress is not None and frame > before:
                    progress(frame, len(estimators) * len(recording))
                yield detections
            if progress is not None:
                progress(before + len(recording), len(estimators) * len(recording))

        first = 3 if isinstance(estimator, SequenceEstimator) else 1
        estimate_frames(estimator, recording.rig, recording.timed_detections[:first])
        estimates[name] = estimate_frames(estimator, recording.rig, frames())
    return score_estimates(recording, estimates, head=head)


def score_estimates(
    recording: AnnotatedRecording, estimates: Mapping[str, Sequence[Estimate]], *, head: HeadMapping = "voxelpose"
) -> Evaluation:
    """Score the estimates of methods on a recording.

    Args:
        recording: the recording of F frames.
        estimates: estimates by method, F for each.
        head: mapping to the head of SHELF14.

    Raises:
        ValueError: an unknown head mapping, or another number of estimates.
    """
    annotated = np.any(np.isfinite(recording.truth), axis=(1, 2, 3))
    variants: dict[str, VariantScores] = {}
    violations: dict[str, int | None] = {}
    for name, of_frames in estimates.items():
        violations[name] = _violations(recording.detections, [estimate.matching for estimate in of_frames])
        rows = np.flatnonzero(annotated).tolist()
        scores = score_frames(recording.truth[annotated], [of_frames[row].joints for row in rows], head=head)
        scored = [estimate for estimate, known in zip(of_frames, annotated, strict=True) if known]
        variants[name] = VariantScores(
            scores,
            tuple(estimate.timings for estimate in of_frames),
            tracking_of_some(
                recording.truth[annotated], scored, recording.time[annotated], head=head, actors=recording.scored
            ),
        )
    return Evaluation(
        recording.name, head, len(recording), int(annotated.sum()), variants, violations, recording.scored
    )


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
    return score_estimates(recording, {FILES: [estimate_of(people, row) for row in rows.tolist()]}, head=head)


def estimate_of(people: People, row: int) -> Estimate:
    """Return the people of a frame, with their identities."""
    if people.skeleton != COCO17:
        raise ValueError(f"people must be on the skeleton {COCO17.name}, got {people.skeleton.name}")
    here = people.present[row].any(axis=1)
    return Estimate(
        people.joints[row, here], people.scores[row, here], Matching(np.zeros(0, np.int64)), ids=people.ids[here]
    )


def _violations(frames: Sequence[Detections], matchings: Sequence[Matching]) -> int | None:
    """Count the detections that share a label with another one of their view; None if labels are not reported."""
    pairs = list(zip(frames, matchings, strict=True))
    if not all(matching.covers(len(frame)) for frame, matching in pairs):
        return None
    return sum(count_violations(frame.view, matching.labels_of(len(frame))) for frame, matching in pairs)


class PublishedPcp(NamedTuple):
    """Row of a table: PCP in percent, as printed, with one digit after the decimal point."""

    actor_1: float
    actor_2: float
    actor_3: float
    average: float


def _published() -> dict[str, dict[str, PublishedPcp]]:
    text = (Path(__file__).parent / "data" / "published.toml").read_text(encoding="utf-8")
    return {
        name: {preset: PublishedPcp(*row) for preset, row in rows.items()} for name, rows in parse_toml(text).items()
    }


ABLATION = _published()
"""Table 2, by data set and by the equivalent preset of :class:`mvpose.Pipeline`."""
