"""Calibration of measured errors by simulation, so that a twin measures as its recording does.

The consensus of the other views is not the true place of a joint: it has noise, and errors of other views in it, so
that measured scatter and rates of errors are larger than the parameters behind them. Indirect inference (Gourieroux,
Monfort & Renault, Journal of Applied Econometrics 1993) removes this without a formula for each value: twins are
simulated with the current parameters and measured in the same way as the recording, and each parameter moves by the
difference of the two measurements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from simharness.reality.detector_fit.detector_measurement import point_estimates
from simharness.reality.detector_fit.sample import Sample

ROUNDS = 3

SHARES = (
    "keypoints.jitter",
    "keypoints.miss",
    "keypoints.face",
    "keypoints.guess.self_occluded",
    "keypoints.guess.occluded",
    "correlation.scatter_near",
)
"""Calibrated shares, by the beginning of their keys."""

FACTORS = ("keypoints.scatter", "keypoints.self_occluded", "keypoints.occluded", "correlation.scatter_life")
"""Calibrated amounts, by the beginning of their keys."""

_LEAST = 2e-4  # of a share; counts of a recording say nothing below it
_STEP = 1.0  # largest change of a logit or a logarithm in a round
_FARTHEST = 1.6  # largest change of a logit or a logarithm in all: what is measured is near the parameter


def calibrate(
    real: Mapping[str, float], simulate: Callable[[Mapping[str, float]], Sequence[Sample]], *, rounds: int = ROUNDS
) -> dict[str, float]:
    """Return the parameters at which simulated samples measure as the real one.

    Args:
        real: measured values by key; those that are no parameters of SHARES and FACTORS, or are NaN, stay.
        simulate: function from parameters to samples of twins.
        rounds: number of rounds.
    """
    moved = {
        key: 0.0
        for key, value in real.items()
        if (key.startswith(SHARES) and value > _LEAST) or (key.startswith(FACTORS) and value > 0)
    }
    for _ in range(rounds):
        measured = [point_estimates(sample) for sample in simulate(_at(real, moved))]
        for key, before in moved.items():
            twins = np.array([each.get(key, np.nan) for each in measured])
            if np.isfinite(twins).any():
                scale = _logit if key.startswith(SHARES) else _log
                step = np.clip(scale(real[key]) - scale(float(np.nanmean(twins))), -_STEP, _STEP)
                moved[key] = float(np.clip(before + step, -_FARTHEST, _FARTHEST))
    return _at(real, moved)


def _at(real: Mapping[str, float], moved: Mapping[str, float]) -> dict[str, float]:
    """Return the values, moved on the scale of each: logit for shares, logarithm for amounts."""
    result = dict(real)
    for key, change in moved.items():
        share = key.startswith(SHARES)
        result[key] = float(1 / (1 + np.exp(-_logit(real[key]) - change)) if share else real[key] * np.exp(change))
    return result


def _logit(share: float) -> float:
    share = min(max(share, _LEAST), 1 - _LEAST)
    return float(np.log(share / (1 - share)))


def _log(amount: float) -> float:
    return float(np.log(max(amount, 1e-3)))
