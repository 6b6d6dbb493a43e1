"""Out-of-sample check of a fit: does it say more about the other half of a recording than the shipped profile?"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.detector_fit.detector_measurement import point_estimates
from simharness.reality.detector_fit.fit import DetectorFit, filmed_twin, fit
from simharness.reality.detector_fit.inference import misfit
from simharness.reality.detector_fit.profile import PRIORS
from simharness.reality.detector_fit.sample import sample_of
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector_section import DetectorSection

_TWINS = 2  # of each half and profile


@dataclass(frozen=True)
class HalfCheck:
    """How far measured values of a detector in simulation are off those of a recording that no fit has seen.

    Mean squares in standard deviations of the measured values, of which each counts 9 at most; 1 if all is right.

    Attributes:
        shipped_name: name of the shipped profile.
        fitted: by the fit to the other half, for each half.
        shipped: by the shipped profile, for each half.
    """

    shipped_name: str
    fitted: tuple[float, ...]
    shipped: tuple[float, ...]

    @property
    def fit_is_worse(self) -> bool:
        """Whether the shipped profile predicts the halves better."""
        return float(np.mean(self.fitted)) > float(np.mean(self.shipped))

    def __str__(self) -> str:
        fitted, shipped = float(np.mean(self.fitted)), float(np.mean(self.shipped))
        said = (
            f"measured values of each half are {fitted:.1f} squared deviations off by a fit to the other half, and "
            f"{shipped:.1f} by the shipped profile {self.shipped_name}"
        )
        if self.fit_is_worse:
            return f'use "{self.shipped_name}" instead of the fit: {said}'
        return f"the fit predicts better than the shipped profile: {said}"

    def summary(self) -> dict[str, Any]:
        """Return all numbers ready for JSON."""
        return {"worse": self.fit_is_worse, **asdict(self)}


def check_halves(recording: AnnotatedRecording, *, resamples: int = 200) -> HalfCheck:
    """Fit to each half of a recording, and predict what is measured in the other.

    Where people are comes from the predicted half.

    Args:
        recording: the recording.
        resamples: number of resamples of each measurement.

    Raises:
        ValueError: a half in which nobody stays for a second or longer; see also :func:`.fit`.
    """
    rows = np.arange(len(recording))
    parts = [recording.during(half) for half in np.array_split(rows, 2)]
    fits = [fit(part, resamples=resamples) for part in parts]
    name = PRIORS[recording.kind]
    fitted = tuple(_misfit(part, own, other.profile) for part, own, other in zip(parts, fits, fits[::-1], strict=True))
    shipped = tuple(_misfit(part, own, read_profile(name)) for part, own in zip(parts, fits, strict=True))
    return HalfCheck(name, fitted, shipped)


def _misfit(part: AnnotatedRecording, own: DetectorFit, profile: DetectorSection) -> float:
    """Return the misfit of simulated detections of a profile to the measured values of a half."""
    profile = profile.model_copy(update={"kind": part.kind})
    twins = (filmed_twin(part, film, profile, seed=200 + k) for k, film in enumerate(own.films[:_TWINS]))
    simulated = (point_estimates(sample_of(twin, own.people, own.films[0])) for twin in twins)
    return float(np.mean([misfit(own.real.values, each) for each in simulated]))
