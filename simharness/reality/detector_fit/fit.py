"""Fit of a detector profile to a recording, and the measurement of its simulated twin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from simharness.reality.detector_fit.measure import RESAMPLES, Measurement, measure
from simharness.reality.detector_fit.profile import NAME, as_toml, settings
from simharness.reality.detector_fit.sample import Sample
from simharness.reality.detector_fit.shelf_twin import film_shelf_twin
from simharness.runtime.atomic_files import write_atomic
from simharness.scenario.sections.detector import Detector

FITTED_SECTIONS = ("keypoints", "bias", "correlation", "scores", "boxes", "phantoms")
"""Sections of measured values that describe the detector. The others (share, size) also depend on the scene."""

_TWIN = "simulated with the fitted profile"


@dataclass(frozen=True)
class Fit:
    """Fitted detector.

    Attributes:
        real: measurement of the real detector.
        profile: [detector] parameters at which the simulated detector errs alike.
        text: the profile as a file.
    """

    real: Measurement
    profile: Detector
    text: str


def fit(sample: Sample, *, name: str = NAME, command: str = "", resamples: int = RESAMPLES, seed: int = 0) -> Fit:
    """Measure a detector and return its profile.

    Args:
        sample: the recording.
        name: name of the profile.
        command: command that made the profile, to be written into its file.
        resamples: number of resamples of the bootstrap.
        seed: seed of the resamples.

    Raises:
        ValueError: see :func:`~simharness.reality.detector_fit.measure.measure`.
    """
    real = measure(sample, resamples=resamples, seed=seed)
    profile = Detector.model_validate(settings(real, name=name))
    return Fit(real, profile, as_toml(real, name=name, command=command))


def write_profile(fitted: Fit, path: str | Path) -> None:
    """Write the profile; the file is complete or unchanged.

    Raises:
        ValueError: it cannot be written.
    """
    try:
        write_atomic(Path(path), fitted.text.encode())
    except OSError as error:
        raise ValueError(f"--out {path}: cannot be written: {error.strerror}") from None


def twin_of(fitted: Fit, sample: Sample, *, seed: int = 0, resamples: int = RESAMPLES) -> Measurement:
    """Measure the simulated twin of a recording: as long, with as many known people.

    Args:
        fitted: profile of the twin's detector.
        sample: the recording.
        seed: seed of the twin.
        resamples: number of resamples of the bootstrap.
    """
    twin = film_shelf_twin(seconds=len(sample) * sample.step, seed=seed)
    # Shelf does not annotate all people in every frame; the same people are unknown in its twin.
    known = sample.known if sample.known.shape == (len(twin.sequence), twin.sequence.joints.shape[1]) else None
    simulated = replace(twin.detected(fitted.profile, seed=seed, known=known), name=_TWIN)
    return measure(simulated, resamples=resamples, seed=seed)


def agreement(real: Measurement, simulated: Measurement) -> tuple[list[str], int]:
    """Return the parameters that differ by more than their intervals allow, and the number of parameters compared.

    About 5 % of equal parameters differ by more.
    """
    compared = [
        key
        for key, each in real.values.items()
        if key.split(".")[0] in FITTED_SECTIONS and each.known and simulated[key].known
    ]
    return [key for key in compared if not real[key].agrees(simulated[key])], len(compared)
