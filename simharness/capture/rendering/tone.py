"""Tone curve of the pictures of scenes with light sources: from linear light to sRGB of 8 bits.

The curve is Hable's ("Filmic tonemapping for real-time rendering", SIGGRAPH 2010 course; constants of the public
version) with a lower white, so that it is mild: a short toe, a nearly straight middle, and a shoulder that keeps lamps
and sunlit places from clipping. It is scaled to keep middle grey, 18 %, where it is.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from simharness.types.srgb import from_linear

STEPS = 4096
"""Entries of :func:`table`."""
BRIGHTEST = 16.0
"""Linear light of the last entry; what is brighter looks the same."""
DIMMED = 128
"""Steps of :func:`dimming` between darkness and full light."""

_A, _B, _C, _D, _E, _F = 0.22, 0.30, 0.10, 0.20, 0.01, 0.30
_WHITE = 6.0
_GREY = 0.18


def tone(light: ArrayLike) -> NDArray[np.float64]:
    """Return the linear value that a picture shows, 0 to 1, of linear light of at least 0."""
    return np.clip(_hable(_scale() * np.asarray(light, float)) / _hable(_WHITE), 0.0, 1.0)


def _hable(x: ArrayLike) -> NDArray[np.float64]:
    x = np.asarray(x, float)
    return (x * (_A * x + _C * _B) + _D * _E) / (x * (_A * x + _B) + _D * _F) - _E / _F


@cache
def _scale() -> float:
    """Return the factor before the curve that keeps middle grey."""
    return float(brentq(lambda factor: float(_hable(factor * _GREY) / _hable(_WHITE)) - _GREY, 0.0, 10.0, xtol=1e-15))


@cache
def table() -> NDArray[np.uint8]:
    """Return the value of 8 bits of linear light x, at index ``sqrt(x / BRIGHTEST) (STEPS - 1)``, (``STEPS``,)."""
    light = BRIGHTEST * (np.arange(STEPS) / (STEPS - 1)) ** 2
    return np.round(from_linear(tone(light))).astype(np.uint8)


@cache
def dimming() -> NDArray[np.uint8]:
    """Return what is left of a value of 8 bits at a share k / ``DIMMED`` of its light, (``DIMMED`` + 1, 256)."""
    light = np.linspace(0, np.sqrt(BRIGHTEST), 20_000) ** 2
    shown = from_linear(tone(light))
    inverse = np.interp(np.arange(256), shown, light)
    left = np.arange(DIMMED + 1)[:, None] / DIMMED * inverse
    result = np.round(from_linear(tone(left))).astype(np.uint8)
    result[DIMMED] = np.arange(256)
    return np.ascontiguousarray(result)
