"""What errors have to do with each other, from how often they come together.

The simulated detector draws an error as a standard normal number under a quantile. Two errors of chances p and q whose
numbers have correlation rho come together with the chance Phi2(Phi^-1(p), Phi^-1(q); rho): so many are expected over
all pairs, and rho is where as many were seen (the tetrachoric correlation, one for many pairs of chances).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from mvpose.arrays import Floats

_TURNS = np.linspace(0.0, np.arcsin(0.9995), 81)  # rho = sin(turn), in which the density is smooth
_LIVES = np.geomspace(0.2, 4000.0, 240)  # frames


def together(p: ArrayLike, q: ArrayLike) -> Floats:
    """Chances that two events of chances ``p`` and ``q`` (...) come together, (..., G), for correlations :func:`grid`.

    By the derivative of the bivariate normal distribution (Plackett, Biometrika 1954), summed over the correlation.
    """
    p, q = np.broadcast_arrays(np.asarray(p, float), np.asarray(q, float))
    with np.errstate(invalid="ignore"):
        h, k = (ndtri(np.clip(each, 1e-12, 1 - 1e-12))[..., None] for each in (p, q))
        sin, cos = np.sin(_TURNS), np.cos(_TURNS)
        density = np.exp(-(h * h + k * k - 2 * h * k * sin) / (2 * cos**2)) / (2 * np.pi)
    steps = np.diff(_TURNS) * (density[..., 1:] + density[..., :-1]) / 2
    grown = np.concatenate([np.zeros((*p.shape, 1)), np.cumsum(steps, axis=-1)], axis=-1)
    return ndtr(h) * ndtr(k) + grown


def grid() -> Floats:
    """The correlations of :func:`together`, (G,): 0 to almost 1."""
    return np.sin(_TURNS)


def correlation(both: Floats, expected: Floats) -> Floats:
    """The correlation, 0 to 1, of what lies behind events that come in pairs, (R,); NaN where none is expected.

    Args:
        both: in how many pairs both happened, (R,).
        expected: in how many they would have for each of :func:`grid`, (R, G), rising.
    """
    found = np.array([np.interp(each, row, grid()) for each, row in zip(both, expected, strict=True)])
    return np.where(expected[:, -1] > expected[:, 0], found, np.nan)


def life(lags: ArrayLike, step: float, remembered: Floats, weight: Floats) -> Floats:
    """The life, seconds, with which ``exp(-lag / life)`` is nearest to what is remembered, (R,); NaN without weight.

    Args:
        lags: frames, (L,).
        step: seconds from one frame to the next.
        remembered: autocorrelations, (R, L).
        weight: of each, (R, L).
    """
    lags = np.asarray(lags, float)
    lives = np.concatenate([[0.0], _LIVES])
    with np.errstate(divide="ignore"):
        curves = np.exp(-lags / lives[:, None])
    weight = np.where(np.isfinite(remembered), weight, 0.0)
    values = np.nan_to_num(remembered)
    # sum of w (r - e)², without the (R, lives, L) array; the first term is the same for all lives.
    cost = weight @ (curves**2).T - 2 * (weight * values) @ curves.T
    return np.where(weight.sum(axis=-1) > 0, lives[cost.argmin(axis=-1)] * step, np.nan)
