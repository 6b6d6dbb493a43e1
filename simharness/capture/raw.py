"""Raw picture of an image sensor: light through the lens, colour filters, noise, and demosaicing.

The noise is that of photons that are counted and of the readout of the counts, in linear light before any tone curve.
Its variance is an affine function of the light, the photon transfer curve (EMVA Standard 1288, release 4.0, 2021,
section 2). The Poisson distribution of the counts is approximated by a normal one, as in A. Foi et al., "Practical
Poissonian-Gaussian noise modeling and fitting for single-image raw-data", IEEE Trans. Image Process. 17(10), 2008.

A lens that blurs by ``sigma`` pixels and images a colour ``shift`` pixels beside its place is one filter of three taps
along each axis, the only one with the sum 1, the mean ``shift`` and the variance ``sigma^2``.
"""

from functools import cache, lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mvpose.camera import Camera
from simharness.scenario.sections.cameras_section import SensorSection
from simharness.types.srgb import linear_table, rounded

Rgb = NDArray[np.uint8]

BLACK, WHITE = 1024, 65535
"""Raw values of no light, above 0 so that noise does not brighten dark places, and of the brightest light."""

_DRAWS = 1 << 12  # distinct values of a normal draw; the largest is 3.7
_TERMS = 8  # coefficients of the polynomial of the falloff: errors below 0.001 up to 75 degrees from the axis
_STEEPEST = 0.065  # cos^2 of these 75 degrees; beyond, the falloff goes on less exactly
_LARGEST = 0.8  # standard deviation of the blur that three taps make, pixels


def is_ideal(sensor: SensorSection) -> bool:
    """Return whether light reaches the picture unchanged: the dials of lens, colour filters and noise are zero."""
    light = (sensor.softness, sensor.vignetting, sensor.aberration, sensor.shot_noise, sensor.read_noise)
    return not any(light) and not sensor.mosaic


def raw_picture(
    rgb: Rgb, sensor: SensorSection, random: np.random.Generator, *, camera: Camera | None, exposure: float
) -> NDArray[np.uint16]:
    """Return the colours that a camera reads from its sensor, (h, w, 3), from ``BLACK`` to ``WHITE``.

    Args:
        rgb: ideal picture, (h, w, 3), sRGB.
        sensor: parameters of the sensor.
        random: random numbers of this picture.
        camera: camera of the picture, for its optical axis and focal length; None where neither vignetting nor
            aberration needs it.
        exposure: factor on the light.

    Raises:
        ValueError: vignetting or aberration without a camera.
    """
    if camera is None and (sensor.vignetting or sensor.aberration):
        raise ValueError("sensor.vignetting and sensor.aberration are about the optical axis: expected a camera")
    if sensor.softness > _LARGEST:
        rgb = _defocused(rgb, float(np.sqrt(sensor.softness**2 - _LARGEST**2)))
    height, width = rgb.shape[:2]
    shape = (1 if sensor.mosaic else 3, height, width)
    axis, variance = _axis(camera), np.float32(min(sensor.softness, _LARGEST) ** 2)
    aside, beside = np.arange(width, dtype=np.float32) - axis[0], np.arange(height, dtype=np.float32) - axis[1]
    share = _share(aside, beside, axis[2], (exposure * _falloff(sensor.vignetting)).astype(np.float32))
    light = np.empty((3, height, width), np.float32)
    for channel in range(3):
        magnified = np.float32((channel - 1) * np.float32(sensor.aberration))  # where the light of a pixel comes from
        seen = linear_table()[rgb[..., channel]]
        columns = _filtered(seen, beside * magnified, variance)
        light[channel] = share * _filtered(columns.T, aside * magnified, variance).T
    if sensor.mosaic:  # every pixel has one colour filter: red and green in even rows, green and blue in odd ones
        bayer = np.array([[0, 1], [1, 2]])[np.arange(height)[:, None] & 1, np.arange(width) & 1]
        light = np.take_along_axis(light, bayer[None], axis=0)
    if sensor.shot_noise > 0 or sensor.read_noise > 0:
        draws = _normals()[random.integers(0, 1 << 16, shape, np.uint16) >> 4]
        shot, read = np.float32(sensor.shot_noise**2), np.float32(sensor.read_noise**2)
        light += np.sqrt(shot * np.maximum(light, 0) + read) * draws
    values = light * np.float32(WHITE - BLACK) + np.float32(BLACK + 0.5)
    raw = np.clip(values, 0, WHITE).astype(np.uint16)
    return cv2.demosaicing(raw[0], cv2.COLOR_BayerRGGB2RGB) if sensor.mosaic else cv2.merge(tuple(raw))


def _share(
    aside: NDArray[np.float32], beside: NDArray[np.float32], curvature: np.float32, falloff: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the share of light that reaches each pixel, (h, w): a polynomial of the squared cosine of its angle.

    Args:
        aside: distance of the columns from the optical axis, (w,).
        beside: distance of the rows, (h,).
        curvature: 1 / focal length^2.
        falloff: coefficients of the polynomial, the highest power first.
    """
    if len(falloff) == 1:
        return falloff
    return np.asarray(np.polyval(falloff, 1 / (1 + (aside**2 + beside[:, None] ** 2) * curvature)), np.float32)


def _filtered(light: NDArray[np.float32], shift: NDArray[np.float32], variance: np.float32) -> NDArray[np.float32]:
    """Return light (n, m) that comes from ``shift`` (n,) rows beside each row, blurred across the rows."""
    if not variance and not shift.any():
        return light
    whole = np.floor(shift + np.float32(0.5))
    shift = shift - whole
    spread = variance + shift * shift
    shares = (spread - shift) / 2, 1 - spread, (spread + shift) / 2
    rows = np.arange(len(light)) + whole.astype(int)
    before, here, after = (
        share[:, None] * light[np.clip(rows + k, 0, len(light) - 1)]
        for k, share in zip((-1, 0, 1), shares, strict=True)
    )
    return np.asarray(before + here + after)


def _defocused(rgb: Rgb, deviation: float) -> Rgb:
    """Return a picture whose light is blurred with a standard deviation in pixels."""
    return rounded(cv2.GaussianBlur(cv2.LUT(rgb, linear_table()), (0, 0), deviation))


def _axis(camera: Camera | None) -> NDArray[np.float32]:
    """Return column and row of the optical axis and 1 / focal length^2."""
    if camera is None:
        return np.zeros(3, np.float32)
    K = camera.K
    return np.array([K[0, 2], K[1, 2], 1 / (K[0, 0] * K[1, 1])], np.float32)


@cache
def _normals() -> NDArray[np.float32]:
    """Return quantiles of the standard normal distribution, with variance 1."""
    values = ndtri((np.arange(_DRAWS) + 0.5) / _DRAWS)
    return (values / values.std()).astype(np.float32)


@lru_cache(maxsize=16)
def _falloff(vignetting: float) -> NDArray[np.float64]:
    """Return coefficients of (cos^2)^(2 vignetting) as a polynomial of cos^2, the highest power first.

    It is fitted with the value 1 on the axis, so that the middle of a picture keeps its brightness.
    """
    if not vignetting:
        return np.array([1.0])
    nodes = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    squared = _STEEPEST + (1 - _STEEPEST) * (nodes + 1) / 2
    lacking = squared[:, None] ** np.arange(1, _TERMS) - 1.0
    factors = np.linalg.lstsq(lacking, squared ** (2 * vignetting) - 1.0, rcond=None)[0]
    return np.concatenate([factors[::-1], [1.0 - factors.sum()]])
