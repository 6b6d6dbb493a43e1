"""Prediction of what one set of cameras makes of the people in a volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats


@dataclass(frozen=True)
class Figure:
    """Expected value with its 90 % interval.

    Attributes:
        value: expected value.
        low, high: interval in which the figure of one recording lies with probability 0.9.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Prediction:
    """Maps of a set of cameras over P places, NaN where nothing is known.

    Attributes:
        places: (P, 2), metres.
        pcp: percentage of correct parts, 0 to 100, (P,).
        recall: probability that a person is found, (P,).
        error_mm: expected error of the joints of people who are found, millimetres, (P,).
        views: mean number of cameras that see a person whole, (P,).
        ellipse: covariance of a joint of the trunk on the floor, (P, 2, 2), square metres.
        risk: probability that a person's detections are not matched rightly, (P,); NaN where matching was not tried.
        person_pcp: percentage of correct parts of everyone in every scene, (S, Q); NaN for absent people.
        person_error_mm: mean error of the joints of everyone, (S, Q), millimetres; NaN for people not found.
    """

    places: Floats
    pcp: Floats
    recall: Floats
    error_mm: Floats
    views: Floats
    ellipse: Floats
    risk: Floats
    person_pcp: Floats
    person_error_mm: Floats

    def summary(self) -> dict[str, Figure]:
        """Return ``pcp`` and ``mpjpe_mm`` of the volume, with 90 % intervals."""
        return {"pcp": _figure(self.person_pcp, top=100.0), "mpjpe_mm": _figure(self.person_error_mm)}


def _figure(values: Floats, *, top: float = np.inf) -> Figure:
    """Return the mean of values of people (S, Q) and the interval of recordings."""
    known = np.isfinite(values).any(axis=1)
    if not known.any():
        return Figure(np.nan, np.nan, np.nan)
    scenes = np.nanmean(values[known], axis=1)
    mean = float(np.nanmean(values))
    spread = 1.645 * float(scenes.std()) / np.sqrt(_INDEPENDENT)
    return Figure(mean, max(mean - spread, 0.0), min(mean + spread, top))


_INDEPENDENT = 8.0  # independent moments of a recording of ten seconds
