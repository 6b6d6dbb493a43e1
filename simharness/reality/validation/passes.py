"""Passes of the method over changed recordings: some cameras, or detections and calibrations with added errors.

One pass estimates every annotated frame of one changed recording by all variants. A validation is a list of passes,
which processes share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mvpose import preset
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.validation.score_sums import ScoreSums
from simharness.runtime.frame_pool import map_frames
from simharness.scoring.frame_scores import ByRule, score_by_rules
from simharness.trial.conditioned_trial import estimate_frames

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
    """Restriction of a recording to some cameras.

    Attributes:
        views: indices of the cameras.
    """

    views: tuple[int, ...]

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
            done.append({name: ScoreSums.of(frame_scores(changed, name), changed.scored) for name in self.variants})
        return done
