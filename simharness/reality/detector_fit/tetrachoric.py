"""Tetrachoric correlation and lifetime of errors, from how often they occur together.

The simulated detector draws an error as a standard normal number below a quantile. Two errors of probabilities p and q
whose numbers have the correlation rho occur together with probability Phi2(Phi^-1(p), Phi^-1(q); rho). Summed over all
pairs this is the expected number of joint occurrences; the estimate is the rho at which it equals the observed number
(the tetrachoric correlation, one value for many pairs of probabilities).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from mvpose.arrays import Floats

# rho = sin(angle), in which the density is smooth. Measured correlations may be below 0 by chance.
_ANGLES = np.concatenate([np.linspace(-np.arcsin(0.6), 0.0, 21)[:-1], np.linspace(0.0, np.arcsin(0.9995), 81)])
_NONE = 20  # index of the angle 0
_LIVES = np.geomspace(0.2, 4000.0, 240)  # frames


def joint_probability(p: ArrayLike, q: ArrayLike) -> Floats:
    """Return the probability that two events of probabilities ``p`` and ``q`` (...) occur together, (..., G).

    One value for each correlation of :func:`correlation_grid`, by integrating the derivative of the bivariate normal
    distribution with respect to the correlation (Plackett, Biometrika 1954).
    """
    p, q = np.broadcast_arrays(np.asarray(p, float), np.asarray(q, float))
    with np.errstate(invalid="ignore"):
        h, k = (ndtri(np.clip(each, 1e-12, 1 - 1e-12))[..., None] for each in (p, q))
        sin, cos = np.sin(_ANGLES), np.cos(_ANGLES)
        density = np.exp(-(h * h + k * k - 2 * h * k * sin) / (2 * cos**2)) / (2 * np.pi)
    steps = np.diff(_ANGLES) * (density[..., 1:] + density[..., :-1]) / 2
    integral = np.concatenate([np.zeros((*p.shape, 1)), np.cumsum(steps, axis=-1)], axis=-1)
    return np.maximum(ndtr(h) * ndtr(k) + integral - integral[..., _NONE, None], 0.0)


def correlation_grid() -> Floats:
    """Return the correlations of :func:`joint_probability`, (G,): -0.6 to almost 1."""
    return np.sin(_ANGLES)


def tetrachoric_correlation(both: Floats, expected: Floats) -> Floats:
    """Return the correlation, -0.6 to 1, of the latent numbers behind pairs of events, (R,); NaN if no pair is
    expected.

    Args:
        both: observed number of pairs in which both events occurred, (R,).
        expected: expected number for each correlation of :func:`correlation_grid`, (R, G), rising.
    """
    estimate = np.array([np.interp(each, row, correlation_grid()) for each, row in zip(both, expected, strict=True)])
    return np.where(expected[:, -1] > expected[:, 0], estimate, np.nan)


def fit_life(lags: ArrayLike, step: float, autocorrelation: Floats, weight: Floats) -> Floats:
    """Return the life, seconds, that fits ``exp(-lag / life)`` to autocorrelations, (R,); NaN without any weight.

    Args:
        lags: frames, (L,).
        step: seconds between consecutive frames.
        autocorrelation: autocorrelations at the lags, (R, L).
        weight: weights of the least squares, (R, L).
    """
    return _fit(lags, step, autocorrelation, weight, np.concatenate([[0.0], _LIVES]), least=1.0)[0]


def fit_noisy_life(lags: ArrayLike, step: float, autocorrelation: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Return life, seconds, and share of white noise that fit ``(1 - noise) exp(-lag / life)``, (R,) each.

    Arguments as of :func:`fit_life`; NaN without any weight.
    """
    return _fit(lags, step, autocorrelation, weight, _LIVES, least=0.0)


def _fit(
    lags: ArrayLike, step: float, autocorrelation: Floats, weight: Floats, lives: Floats, *, least: float
) -> tuple[Floats, Floats]:
    """Return the fit with a share of ``least`` or more that lasts."""
    with np.errstate(divide="ignore"):
        curves = np.exp(-np.asarray(lags, float) / lives[:, None])
    weight = np.where(np.isfinite(autocorrelation), weight, 0.0)
    # Sums of w (r - e)² without an (R, lives, L) array; the term w r² is left out, as it is the same for all lives.
    square, product = weight @ (curves**2).T, (weight * np.nan_to_num(autocorrelation)) @ curves.T
    kept = np.clip(np.divide(product, square, out=np.zeros_like(square), where=square > 0), least, 1.0)
    best = (kept**2 * square - 2 * kept * product).argmin(axis=-1)
    known = weight.sum(axis=-1) > 0
    kept = np.take_along_axis(kept, best[:, None], axis=-1)[:, 0]
    return np.where(known, lives[best] * step, np.nan), np.where(known, 1 - kept, np.nan)
