"""Prediction of what one set of cameras makes of the people in a volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.types.random_streams import stream


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
        risk: probability of a wrong match, (P,): a person has a detection of somebody else, or is two people
            in the end; NaN where matching was not tried.
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

    def summary(self, *, seconds: float = 10.0) -> dict[str, Figure]:
        """Return ``pcp`` and ``mpjpe_mm`` of the volume, with the 90 % intervals of a recording of some seconds.

        The interval is that of the mean over as many moments as are independent in so many seconds: people stay
        where they are for a while, and so do the errors of the detector.
        """
        moments = _FIRST_MOMENTS + seconds / _MOMENT
        return {
            "pcp": _figure(self.person_pcp, moments),
            "mpjpe_mm": _figure(self.person_error_mm, moments),
        }


_FIRST_MOMENTS, _MOMENT = 1.0, 1.0
"""Independent moments of a short recording, and seconds until the next one. Fitted on 32 simulated recordings of 8 s,
seeds 1000 to 1017 and 1300 to 1313 of ``benchmarks.planning.simulated_rigs``, of which the intervals then hold 90 %."""

_RESAMPLES = 2000


def _figure(values: Floats, moments: float) -> Figure:
    """Return the mean of values of people (S, Q) and the interval of the mean of some scenes, drawn from all."""
    known = np.isfinite(values).any(axis=1)
    if not known.any():
        return Figure(np.nan, np.nan, np.nan)
    scenes = np.nanmean(values[known], axis=1)
    drawn = stream(0, "planning", "interval").choice(scenes, (_RESAMPLES, max(round(moments), 1))).mean(axis=1)
    low, high = np.quantile(drawn, [0.05, 0.95])
    return Figure(float(np.nanmean(values)), float(low), float(high))
