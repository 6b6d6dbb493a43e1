"""Measurements of a recording beside those of its twins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.validation.detection_figures import Measurements, Ratio, bone_variation
from simharness.reality.validation.evidence import Compared, compared
from simharness.statistics.resampling import resampled


def compare_measurements(real: Measurements, twins: Sequence[Measurements], weights: Floats) -> dict[str, Compared]:
    """Return all measurements of a recording beside those of its twins, by the keys of ``Measurements.values``.

    Args:
        real: measurements of the recording of F frames.
        twins: measurements of the twins.
        weights: bootstrap weights of the recording's frames, (R, F).
    """
    resamples: dict[str, Floats] = {key: _ratio(ratio, weights) for key, ratio in real.ratios.items()}
    for name, lengths in (("bones", real.bones), ("true_bones", real.true_bones)):
        drawn = np.stack([bone_variation(np.repeat(lengths, row.astype(int), axis=0)) for row in weights], axis=-1)
        keys = [key for key in real.values() if key.startswith(f"{name}.")]
        resamples |= dict(zip(keys, drawn, strict=True))
    values, of_twins = real.values(), [each.values() for each in twins]
    return {
        key: compared(value, resamples.get(key, np.array([np.nan])), [twin[key] for twin in of_twins])
        for key, value in values.items()
    }


def _ratio(ratio: Ratio, weights: Floats) -> Floats:
    numerator, denominator = resampled(ratio.numerator, weights), resampled(ratio.denominator, weights)
    return np.where(denominator > 0, numerator / np.where(denominator > 0, denominator, 1.0), np.nan)
