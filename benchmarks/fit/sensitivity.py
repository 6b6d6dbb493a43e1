"""Sensitivity of a fit to the constants of its inference: each is halved and doubled, and the fit repeated."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fit.loop import RESAMPLES, kept_film
from benchmarks.fit.recordings import DETECTOR, known_recording
from simharness.reality.detector_fit import inference
from simharness.reality.detector_fit.annotation_fit import annotation_offsets, common_bias
from simharness.reality.detector_fit.detector_measurement import MeasuredDetector, measure_detector, point_estimates
from simharness.reality.detector_fit.fit import filmed_twin
from simharness.reality.detector_fit.joint_labels import label_joints
from simharness.reality.detector_fit.profile import prior_of, settings
from simharness.reality.detector_fit.sample import sample_of
from simharness.reality.people_tracks import track_people
from simharness.scenario.sections.detector_section import DetectorSection

CONSTANTS = (
    *("_WIDTHS", "_WIDTH", "_PERTURBATIONS", "_APART", "_NOISE", "_NOISE_ANEW", "_STEP", "_LASTING", "_LEAST"),
    *("_SMALLEST", "_OWN", "_STEEPEST", "_SPREAD", "_KIND_SPREAD", "_LINEAR_STEP"),
)
"""Constants of the inference. The others are levels of intervals and bounds of what is told."""

CAMERAS, DRAW = 4, 0

_NORMAL = 1.96  # deviations from the mean to the end of a 95 % interval


def sensitivity(films: Path) -> Iterator[str]:
    """Yield the lines of a table: by how many of their deviations fitted values change, and how wide intervals are."""
    measured, simulate = _problem(films)
    prior = prior_of(measured.kind)

    def fitted() -> tuple[np.ndarray, np.ndarray]:
        found = inference.infer(measured.values, simulate, prior)
        chosen = [each for key, each in found.items() if key.startswith(sum(inference.SCALES.values(), ()))]
        values = np.array([[each.value, each.low, each.high] for each in chosen])
        return values[:, 0], np.where(values[:, 2] > values[:, 1], values[:, 2] - values[:, 1], np.nan)

    before, width = fitted()
    yield "constant          times   change of values, deviations: median   largest   width of intervals"
    for name in CONSTANTS:
        kept = getattr(inference, name)
        for factor in (0.5, 2.0):
            setattr(inference, name, _times(kept, factor))
            try:
                after, wide = fitted()
            finally:
                setattr(inference, name, kept)
            change = np.abs(after - before) / width * 2 * _NORMAL
            yield (
                f"{name:17s} {factor:5.1f} {np.nanmedian(change):39.2f} {np.nanmax(change):9.2f} "
                f"{np.nanmedian(wide / width):20.2f}"
            )


def _times(value: Any, factor: float) -> Any:
    """Return a number, or all numbers of a tuple or mapping, times a factor."""
    if isinstance(value, Mapping):
        return {key: _times(each, factor) for key, each in value.items()}
    return tuple(_times(each, factor) for each in value) if isinstance(value, tuple) else factor * value


def _problem(films: Path) -> tuple[MeasuredDetector, Callable[[Mapping[str, float], int], Mapping[str, float]]]:
    """Return what is measured of a recording of the known detector, and its simulation, as in a fit."""
    recording = known_recording(CAMERAS, annotated=True, draw=DRAW).recording
    people = track_people(recording)
    kept = [kept_film(recording, people, films, seed=seed) for seed in (0, 1)]
    sample = sample_of(recording, people, kept[0])
    labels = label_joints(sample)
    measured = measure_detector(sample, labels=labels, resamples=RESAMPLES)
    bias = common_bias(annotation_offsets(recording.truth, people, labels.consensus))

    def simulate(values: Mapping[str, float], draw: int) -> dict[str, float]:
        found = settings(measured.with_values(values), name=DETECTOR.name, bias=bias)
        one, other = kept[draw % 2], kept[(draw + 1) % 2]
        twin = filmed_twin(recording, one, DetectorSection.model_validate(found), seed=1 + draw)
        return point_estimates(sample_of(twin, people, other))

    return measured, simulate
