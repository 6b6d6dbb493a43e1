"""Estimation stage: run every variant of the method on the detections of every frame."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mvpose import Detections, Estimate, Rig
from mvpose.pipeline import PRESETS, READ_HEATMAPS, Estimator
from simharness.runtime.errors import RunError

if TYPE_CHECKING:
    from simharness.detector.detect import Detected


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


@contextlib.contextmanager
def naming_frame(frame: int) -> Iterator[None]:
    """Prefix the errors of an estimator with the frame's index.

    Raises:
        RunError: in place of one.
    """
    try:
        yield
    except RunError as error:
        raise RunError(f"frame {frame}: {error}") from error
