"""Estimation stage: run every variant of the method on the detections of every frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mvpose import Detections, Estimate, Rig
from mvpose.pipeline import PRESETS, READ_HEATMAPS, Estimator
from simharness.runtime.errors import naming_frame
from simharness.runtime.frame_pool import map_frames
from simharness.runtime.stages import Stages

if TYPE_CHECKING:
    from simharness.detector.detect import Detected
    from simharness.trial.stages.detected_sequence import DetectedSequence


@dataclass(frozen=True)
class EstimateFrames:
    """Frame function that runs variants on frames. Heat maps are drawn frame by frame, for variants that read them.

    Attributes:
        rig: the believed cameras.
        detected: all frames.
        pipelines: variants by name.
    """

    rig: Rig
    detected: tuple[Detected, ...]
    pipelines: Mapping[str, Estimator]

    def __call__(self, frames: range) -> dict[str, list[Estimate]]:
        """Return the estimates of each variant for these frames."""
        self._warm_up()
        estimates: dict[str, list[Estimate]] = {name: [] for name in self.pipelines}
        for frame in frames:
            for name, detections in self._inputs(frame, self.pipelines):
                with naming_frame(frame):
                    estimates[name].append(self.pipelines[name].estimate(self.rig, detections))
        return estimates

    def input_of(self, frame: int, variant: str) -> Detections:
        """Return the detections of a frame as a variant gets them, with or without heat maps."""
        return dict(self._inputs(frame, (variant,)))[variant]

    def _inputs(self, frame: int, names: Iterable[str]) -> Iterator[tuple[str, Detections]]:
        mapped = plain = self.detected[frame].detections
        peaks = self.detected[frame].peaks
        if plain.likelihoods is not None:
            plain = replace(plain, likelihoods=None)
        elif peaks is not None and set(names) - _IGNORE_HEATMAPS:
            mapped = replace(plain, likelihoods=peaks.heatmaps())
        for name in names:
            yield name, plain if name in _IGNORE_HEATMAPS else mapped

    def _warm_up(self) -> None:
        """Run each variant once per process: compilation and loading are no part of the time of a frame."""
        fresh = [name for name in self.pipelines if name not in _warm]
        fullest = max(range(len(self.detected)), key=lambda frame: len(self.detected[frame].detections))
        for name, detections in self._inputs(fullest, fresh):
            with naming_frame(fullest):
                self.pipelines[name].estimate(self.rig, detections)
        _warm.update(fresh)


_warm: set[str] = set()  # variants that this process has run
_IGNORE_HEATMAPS = PRESETS.keys() - READ_HEATMAPS


def estimate_variants(
    detected: DetectedSequence,
    pipelines: Mapping[str, Estimator],
    stages: Stages,
    *,
    known: Mapping[str, Sequence[Estimate]],
    workers: int = 1,
) -> dict[str, tuple[Estimate, ...]]:
    """Return the estimates of all variants for all frames.

    Args:
        detected: the detections.
        pipelines: variants by name.
        stages: timer and reporter of the stage ``estimate``.
        known: estimates of variants that need not run again.
        workers: number of processes that share the frames.
    """
    missing = {name: pipeline for name, pipeline in pipelines.items() if name not in known}
    estimates = {name: tuple(frames) for name, frames in known.items()}
    if missing:
        indices = range(len(detected.frames))
        with stages.stage("estimate", len(indices)) as advance:
            estimation = EstimateFrames(detected.rig, detected.frames, missing)
            parts = map_frames(estimation, indices, workers=workers, progress=advance)
            estimates |= {name: tuple(each for part in parts for each in part[name]) for name in missing}
    return {name: estimates[name] for name in pipelines}
