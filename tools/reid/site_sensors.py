"""Sensors of the filming sites: drawn around the sensor profiles of scenarios."""

from __future__ import annotations

from functools import cache

import numpy as np

from simharness.scenario.layers import SENSORS
from simharness.scenario.presets import read_preset
from simharness.scenario.sections.cameras_section import SensorSection

PROFILES = {"machine-vision": 0.3, "webcam": 0.25, "phone": 0.2, "action": 0.15, "perfect": 0.1}
"""Fraction of sites whose cameras are like those of a profile."""

SENSOR_SPREAD = SensorSection(gain=0.10, white_balance=0.12, exposure=0.35)
"""Differences between cameras of one site: contrast 10 %, red and blue 12 %, exposure a third of a stop.

They are larger than those of any profile, as between cameras of several makers or that expose for themselves.
"""

_VARIED = ("shot_noise", "read_noise", "softness", "vignetting", "aberration", "tone", "sharpening")
_SPREAD = 0.35  # standard deviation of the logarithm of the factor on each of them
_NOISE, _NOISY = (0.0, 5.0), 0.3  # additional noise of a pixel, and the fraction of cameras that have it
_JPEG = 7.0  # standard deviation of the quality of JPEG compression
_WORST = 45  # least quality of JPEG compression


def draw_profile(rng: np.random.Generator) -> str:
    """Draw the profile of the cameras of a site."""
    return str(rng.choice(list(PROFILES), p=list(PROFILES.values())))


def draw_sensor(rng: np.random.Generator, profile: str, strength: float) -> SensorSection:
    """Draw a sensor around a profile, with ``strength`` times :data:`SENSOR_SPREAD` as the spread of its response.

    Pictures of video are compressed by more than the profiles' JPEG, so the quality varies; cameras without
    compression keep it off.
    """
    base = shipped_sensor(profile)
    values: dict[str, float | int | bool] = {
        key: min(getattr(base, key) * float(factor), 1.0)
        for key, factor in zip(_VARIED, np.exp(rng.normal(0.0, _SPREAD, len(_VARIED))), strict=True)
    }
    quality, noise, is_noisy = rng.normal(base.jpeg, _JPEG), rng.uniform(*_NOISE), rng.random() < _NOISY
    return SensorSection(
        **values,
        mosaic=base.mosaic,
        jpeg=int(np.clip(quality, _WORST, 97)) if base.jpeg else 0,
        noise=float(noise) if is_noisy and base.jpeg else 0.0,
        gain=strength * SENSOR_SPREAD.gain,
        white_balance=strength * SENSOR_SPREAD.white_balance,
        exposure=strength * SENSOR_SPREAD.exposure,
    )


@cache
def shipped_sensor(profile: str) -> SensorSection:
    """Return a shipped sensor profile."""
    return SensorSection(**read_preset(SENSORS, SENSORS.shipped / f"{profile}.toml"))
