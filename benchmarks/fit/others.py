"""Fits to halves of recordings of other detectors: does a fit say more of the other half than the shipped profile?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.fit.recordings import known_recording
from simharness.reality.detector_fit.half_check import check_halves
from simharness.scenario.presets import read_profile

DETECTORS = ("crowded", "movenet", "poor")
"""Shipped profiles of other detectors: people near each other, a network on pictures, and a bad one, bottom-up."""

CAMERAS = 4

_RESAMPLES = 100


def out_of_sample(detectors: Sequence[str] = DETECTORS, *, draw: int = 0) -> Iterator[str]:
    """Yield the lines of a table: how far off fits to one half and the shipped profile are in the other half."""
    yield "recording of    fit, squared deviations   shipped profile"
    for name in detectors:
        recording = known_recording(CAMERAS, annotated=True, draw=draw, detector=read_profile(name)).recording
        check = check_halves(recording, resamples=_RESAMPLES)
        fitted, shipped = (" and ".join(f"{each:.2f}" for each in both) for both in (check.fitted, check.shipped))
        yield f"{name:15s} {fitted:25s} {shipped} ({check.shipped_name}){' WORSE' if check.fit_is_worse else ''}"
