"""Passes of the method over changed recordings: some cameras, or detections and calibrations with added errors.

One pass estimates every annotated frame of one changed recording by all variants. A validation is a list of passes,
which processes share.

Sums of their scores over frames give the figures of a recording, and of its bootstrap resamples.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from mvpose import preset
from mvpose.arrays import Floats
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.runtime.frame_pool import map_frames
from simharness.scoring.frame_scores import RULES, ByRule, HeadRule, score_by_rules
from simharness.scoring.pcp import Part
from simharness.statistics.resampling import resampled
from simharness.trial.conditioned_trial import estimate_frames

DEFAULT_RULE = RULES[0]


@dataclass(frozen=True)
class ScoreSums:
    """Sums of a variant's scores over frames, by the H rules of ``RULES``.

    The leading axes (...) are the frames, the resamples of a bootstrap, or absent.
    """

    correct: Floats
    """Number of correct parts of each scored actor, (..., H, S)."""
    defined: Floats
    """Number of parts that the truth defines, (..., H, S)."""
    error: Floats
    """Sum over pairs of the MPJPE, (..., H), mm."""
    found: Floats
    """Number of pairs of true and estimated people, (..., H)."""
    people: Floats
    """Number of annotated people, (...)."""
    estimates: Floats
    """Number of estimates, (...)."""
    frames: Floats
    """Number of frames, (...)."""

    @classmethod
    def of_scores(cls, scores: ByRule, actors: Sequence[int]) -> "ScoreSums":
        """Return the sums of each frame alone.

        Args:
            scores: scores of F frames by rule.
            actors: indices of the S actors whose PCP is averaged.
        """
        by_rule = [scores[rule] for rule in RULES]
        first = by_rule[0]  # who is there, and how many estimates, does not depend on the rule
        parts = np.stack([each.parts[:, list(actors)] for each in by_rule], axis=1)
        error = np.stack([np.where(each.found, each.error, 0.0) for each in by_rule])
        return cls(
            correct=(parts == Part.CORRECT).sum(axis=-1, dtype=float),
            defined=(parts != Part.UNDEFINED).sum(axis=-1, dtype=float),
            error=1000.0 * error.sum(axis=-1).T,
            found=np.stack([each.found.sum(axis=-1, dtype=float) for each in by_rule], axis=-1),
            people=first.present.sum(axis=-1, dtype=float),
            estimates=first.estimates.astype(float),
            frames=np.ones(len(first)),
        )

    def total(self) -> "ScoreSums":
        """Return the sums over the first axis."""
        return ScoreSums(*(getattr(self, field.name).sum(axis=0) for field in fields(self)))

    def resampled(self, weights: Floats) -> "ScoreSums":
        """Return the sums of R resamples of F frames, from :func:`~simharness.statistics.resampling.block_weights`."""
        return ScoreSums(*(resampled(getattr(self, field.name), weights) for field in fields(self)))

    def pcp(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return PCP, percent (...), mean over the scored actors who are annotated in some frame."""
        at = RULES.index(rule)
        return mean_known(100.0 * safe_ratio(self.correct[..., at, :], self.defined[..., at, :]))

    def mpjpe(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the mean over pairs of the mean joint error, mm (...)."""
        at = RULES.index(rule)
        return safe_ratio(self.error[..., at], self.found[..., at])

    def recall(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the share of annotated people with a pair, 0 to 1 (...)."""
        return safe_ratio(self.found[..., RULES.index(rule)], self.people)

    def precision(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the share of estimates with a pair, 0 to 1 (...)."""
        return safe_ratio(self.found[..., RULES.index(rule)], self.estimates)

    def ghosts(self, rule: HeadRule = DEFAULT_RULE) -> Floats:
        """Return the number of estimates without a pair, per frame (...)."""
        return safe_ratio(self.estimates - self.found[..., RULES.index(rule)], self.frames)


def safe_ratio(numerator: Floats, denominator: Floats) -> Floats:
    """Return the ratio; NaN where the denominator is 0."""
    return np.where(denominator > 0, numerator / np.where(denominator > 0, denominator, 1.0), np.nan)


def mean_known(values: Floats) -> Floats:
    """Return the mean over the last axis without NaN; NaN where all are NaN."""
    known = np.isfinite(values)
    return safe_ratio(np.where(known, values, 0.0).sum(axis=-1), known.sum(axis=-1).astype(float))


VARIANTS = ("full", "fast", "no-3dps", "no-matching")
"""Presets of :class:`mvpose.Pipeline` that a validation compares."""


class RecordingChange(Protocol):
    """Change of a recording: frozen, so that it can be sent to other processes and be the key of a result."""

    def __call__(self, recording: AnnotatedRecording) -> AnnotatedRecording:
        """Return the changed recording, with the same frames and the same truth."""
        ...


@dataclass(frozen=True)
class Unchanged:
    """No change."""

    def __call__(self, recording: AnnotatedRecording) -> AnnotatedRecording:
        """Return the recording."""
        return recording


@dataclass(frozen=True)
class CameraSubset:
    """Restriction of a recording to some cameras."""

    views: tuple[int, ...]
    """Indices of the cameras."""

    def __call__(self, recording: AnnotatedRecording) -> AnnotatedRecording:
        """Return the recording of these cameras."""
        return recording.subset(self.views)


def annotated(recording: AnnotatedRecording, *, every: int = 1) -> AnnotatedRecording:
    """Return every n-th of the frames in which somebody is annotated; only these are scored."""
    rows = np.flatnonzero(np.isfinite(recording.truth).any(axis=(1, 2, 3)))
    return recording.during(rows[::every])


def frame_scores(recording: AnnotatedRecording, variant: str) -> ByRule:
    """Return the scores of a variant in all frames of a recording.

    Args:
        recording: the recording.
        variant: name of a preset of :class:`mvpose.Pipeline`.

    Raises:
        ValueError: an unknown preset.
    """
    estimates = estimate_frames(preset(variant), recording.rig, recording.detections)
    return score_by_rules(recording.truth, [each.joints for each in estimates])


def score_recordings(
    recordings: Sequence[AnnotatedRecording],
    *,
    variants: Sequence[str] = VARIANTS,
    workers: int = 1,
    progress: Callable[[int], None] = lambda recordings: None,
) -> list[dict[str, ByRule]]:
    """Return the scores of all frames by variant, for each recording.

    Args:
        recordings: recordings, for example those of :func:`annotated`.
        variants: names of presets.
        workers: number of processes; the result does not depend on it.
        progress: called with the number of finished recordings.
    """
    function = _Scores(tuple(recordings), tuple(variants))
    chunks = map_frames(function, range(len(recordings)), workers=workers, progress=progress)
    return [each for chunk in chunks for each in chunk]


Tallies = Mapping[str, ScoreSums]
"""Tallies of the frames of a recording by variant."""


def run_passes(
    recordings: Sequence[AnnotatedRecording],
    changes: Sequence[RecordingChange],
    *,
    variants: Sequence[str] = VARIANTS,
    workers: int = 1,
    progress: Callable[[int], None] = lambda passes: None,
) -> list[dict[RecordingChange, Tallies]]:
    """Return, for each recording, the tallies by change.

    Args:
        recordings: recordings, for example those of :func:`annotated`.
        changes: changes, each made to every recording.
        variants: names of presets.
        workers: number of processes; the result does not depend on it.
        progress: called with the number of finished passes.
    """
    passes = _Passes(tuple(recordings), tuple(changes), tuple(variants))
    chunks = map_frames(passes, range(len(passes)), workers=workers, progress=progress)
    done = [each for chunk in chunks for each in chunk]
    # Recordings vary fastest, so that processes share the long and the short passes evenly.
    return [dict(zip(changes, done[index :: len(recordings)], strict=True)) for index in range(len(recordings))]


@dataclass(frozen=True)
class _Scores:
    """Scores of recordings by index."""

    recordings: tuple[AnnotatedRecording, ...]
    variants: tuple[str, ...]

    def __call__(self, frames: range, /) -> list[dict[str, ByRule]]:
        """Return the scores of these recordings."""
        return [{name: frame_scores(self.recordings[index], name) for name in self.variants} for index in frames]


@dataclass(frozen=True)
class _Passes:
    """Passes by index: all recordings with the first change, then with the second."""

    recordings: tuple[AnnotatedRecording, ...]
    changes: tuple[RecordingChange, ...]
    variants: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.recordings) * len(self.changes)

    def __call__(self, frames: range, /) -> list[dict[str, ScoreSums]]:
        """Return the tallies of these passes."""
        done = []
        for index in frames:
            change, recording = divmod(index, len(self.recordings))
            changed = self.changes[change](self.recordings[recording])
            scores = {name: frame_scores(changed, name) for name in self.variants}
            done.append({name: ScoreSums.of_scores(each, changed.scored) for name, each in scores.items()})
        return done
