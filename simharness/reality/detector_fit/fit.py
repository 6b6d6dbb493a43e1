"""From a recording to a profile, and from the profile to its simulated twin."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

from simharness.reality.detector_fit.measure import RESAMPLES, Measurement, measure
from simharness.reality.detector_fit.profile import NAME, as_toml, settings
from simharness.reality.detector_fit.sample import Sample
from simharness.reality.detector_fit.shelf_twin import film_twin
from simharness.scenario.sections.detector import Detector

DIALS = ("keypoints", "bias", "correlation", "scores", "boxes", "phantoms")
"""The sections of figures that are the detector's own. Other figures (share, size) depend on the scene, too."""

_TWIN = "simulated with the fitted profile"


@dataclass(frozen=True)
class Fit:
    """A fitted detector.

    Attributes:
        real: what was measured.
        profile: [detector] settings at which the simulated one errs alike.
        text: the same as a file.
    """

    real: Measurement
    profile: Detector
    text: str


def fit(sample: Sample, *, name: str = NAME, command: str = "", resamples: int = RESAMPLES, seed: int = 0) -> Fit:
    """Measure a detector and write its profile.

    Args:
        sample: the recording.
        name: of the profile.
        command: that made it, to be written into it.
        resamples: of the bootstrap.
        seed: of its draws.

    Raises:
        ValueError: as of :func:`measure`.
    """
    real = measure(sample, resamples=resamples, seed=seed)
    profile = Detector.model_validate(settings(real, name=name))
    return Fit(real, profile, as_toml(real, name=name, command=command))


def write_profile(fitted: Fit, path: str | Path) -> None:
    """Write the profile, by rename: a file that is there is whole.

    Raises:
        ValueError: it cannot be written.
    """
    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(fitted.text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise ValueError(f"--out {path}: cannot be written: {error.strerror}") from None


def twin_of(fitted: Fit, sample: Sample, *, seed: int = 0, resamples: int = RESAMPLES) -> Measurement:
    """The simulated twin of a recording, measured the same way: as long, and as many of its people known."""
    twin = film_twin(seconds=len(sample) * sample.step, seed=seed)
    # Shelf does not annotate everybody in every frame, and what it does not tell of its twin is not told either.
    known = sample.known if sample.known.shape == (len(twin.sequence), twin.sequence.joints.shape[1]) else None
    simulated = replace(twin.detected(fitted.profile, seed=seed, known=known), name=_TWIN)
    return measure(simulated, resamples=resamples, seed=seed)


def agreement(real: Measurement, simulated: Measurement) -> tuple[list[str], int]:
    """In which dials two measurements differ by more than their intervals allow, and how many were compared.

    Of figures that are equal, 5 % or so differ by more.
    """
    compared = [
        key for key, each in real.figures.items() if key.split(".")[0] in DIALS and each.known and simulated[key].known
    ]
    return [key for key in compared if not real[key].agrees(simulated[key])], len(compared)
