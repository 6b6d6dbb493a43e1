"""Raw picture of an image sensor: light through the lens, colour filters, noise, and demosaicing.

The noise is that of photons that are counted and of the readout of the counts, in linear light before any tone curve.
Its variance is an affine function of the light, the photon transfer curve (EMVA Standard 1288, release 4.0, 2021,
section 2). The Poisson distribution of the counts is approximated by a normal one, as in A. Foi et al., "Practical
Poissonian-Gaussian noise modeling and fitting for single-image raw-data", IEEE Trans. Image Process. 17(10), 2008.

A lens that blurs by ``sigma`` pixels and images a colour ``shift`` pixels beside its place is one filter of three taps
along each axis, the only one with the sum 1, the mean ``shift`` and the variance ``sigma^2``. All work of the kernel is
done in loops along rows without branches, on slices of equal length, so that the compiler vectorises them.
"""

import math
from functools import cache, lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mvpose.camera import Camera
from mvpose.kernels import njit
from simharness.scenario.sections.cameras_section import SensorSection
from simharness.types.srgb import linear_table, rounded

Rgb = NDArray[np.uint8]

BLACK, WHITE = 1024, 65535
"""Raw values of no light, above 0 so that noise does not brighten dark places, and of the brightest light."""

_DRAWS = 1 << 12  # distinct values of a normal draw, as the kernel takes them; the largest is 3.7
_TERMS = 8  # coefficients of the polynomial of the falloff: errors below 0.001 up to 75 degrees from the axis
_STEEPEST = 0.065  # cos^2 of these 75 degrees; beyond, the falloff goes on less exactly
_LARGEST = 0.8  # standard deviation of the blur that the kernel's three taps make, pixels


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
    shape = (1 if sensor.mosaic else 3, *rgb.shape[:2])
    noisy = sensor.shot_noise > 0 or sensor.read_noise > 0
    raw = np.empty(shape, np.uint16)
    optics = Optics(
        _axis(camera),
        (exposure * _falloff(sensor.vignetting)).astype(np.float32),
        np.float32(min(sensor.softness, _LARGEST) ** 2),
        np.float32(sensor.aberration),
    )
    words = random.integers(0, 1 << 16, shape, np.uint16) if noisy else np.empty((0, *shape[1:]), np.uint16)
    noise = SensorNoise(words, _normals(), np.float32(sensor.shot_noise**2), np.float32(sensor.read_noise**2))
    expose(np.ascontiguousarray(rgb), linear_table(), optics, noise, sensor.mosaic, raw)
    return cv2.demosaicing(raw[0], cv2.COLOR_BayerRGGB2RGB) if sensor.mosaic else cv2.merge(tuple(raw))


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


class Optics(NamedTuple):
    """Lens of a sensor."""

    axis: NDArray[np.float32]
    """Column and row of the optical axis, and 1 / focal length^2, pixels, (3,) float32."""
    falloff: NDArray[np.float32]
    """Coefficients of the polynomial of cos^2 that gives the share of light far from the axis, (k,) float32, the
    highest power first."""
    variance: np.float32
    """Variance of the blur along each axis, pixels^2."""
    aberration: np.float32
    """Magnification of red over that of green, less 1; that of blue is as much smaller."""


class SensorNoise(NamedTuple):
    """Noise of one picture."""

    words: NDArray[np.uint16]
    """Random numbers, (c, h, w) uint16; no elements for no noise."""
    normals: NDArray[np.float32]
    """Quantiles of the standard normal distribution, (4096,) float32."""
    shot: np.float32
    """Variance of the noise of light at white."""
    read: np.float32
    """Variance of the noise of the readout."""


@njit(cache=True)
def expose(rgb, linear, optics, noise, mosaic, raw):
    """Write the values that a sensor reads.

    Args:
        rgb: the picture, (h, w, 3) uint8.
        linear: light that its values stand for, (256,) float32, 1 is white.
        optics: the lens.
        noise: the noise.
        mosaic: whether every pixel has one colour filter, red and green in even rows, green and blue in odd ones.
        raw: the result, (c, h, w) uint16, c is 1 for a mosaic, else 3.
    """
    axis, falloff, variance, aberration = optics
    height, width = rgb.shape[:2]
    aside = np.empty(width, np.float32)
    for x in range(width):
        aside[x] = np.float32(x) - axis[0]
    pad = math.ceil(abs(aberration) * max(abs(aside[0]), abs(aside[-1]))) + 2
    column = np.empty(width + 2 * pad, np.float32)
    share, cosine, rows = np.empty(width, np.float32), np.empty(width, np.float32), np.empty((3, width), np.float32)
    lines, held = np.empty((3, 3, width), np.float32), np.zeros((3, 3), np.int64)  # the last rows of light, and which
    mixed = np.empty(width, np.float32)
    for y in range(height):
        beside = np.float32(y) - axis[1]
        _falloff_of_row(aside, beside * beside, axis[2], falloff, cosine, share)
        for channel in range(3):
            if not mosaic or channel == 1 or channel == 2 * (y & 1):
                magnified = np.float32(channel - 1) * aberration  # where the light of a pixel comes from
                shift = beside * magnified
                whole = math.floor(shift + np.float32(0.5))
                middle = min(max(y + int(whole), 0), height - 1)
                above, below = max(middle - 1, 0), min(middle + 1, height - 1)
                for line in range(above, below + 1):
                    if held[channel, line % 3] != 1 + line:
                        _read_light(rgb[line], channel, linear, lines[channel, line % 3])
                        held[channel, line % 3] = 1 + line
                _filter_column(
                    lines[channel, above % 3],
                    lines[channel, middle % 3],
                    lines[channel, below % 3],
                    shift - np.float32(whole),
                    variance,
                    column[pad : pad + width],
                )
                column[:pad] = column[pad]
                column[pad + width :] = column[pad + width - 1]
                _filter_row(column, pad, aside, magnified, variance, share, rows[channel])
        if mosaic:
            _interleave(rows[y & 1], rows[1 + (y & 1)], mixed)
        for channel in range(len(raw)):
            row = mixed if mosaic else rows[channel]
            _read_row(row, noise, y, channel, raw[channel, y])


@njit(cache=True)
def _falloff_of_row(aside, beside, curvature, falloff, cosine, share):
    """Write the share of light that reaches each pixel of a row: a polynomial of the squared cosine of its angle."""
    for x in range(len(share)):
        cosine[x] = np.float32(1) / (np.float32(1) + (aside[x] * aside[x] + beside) * curvature)
    share[:] = falloff[0]
    for k in range(1, len(falloff)):
        factor = falloff[k]
        for x in range(len(share)):
            share[x] = share[x] * cosine[x] + factor


@njit(cache=True)
def _read_light(line, channel, linear, light):
    """Write the light of one row of a picture and one colour."""
    for x in range(len(light)):
        light[x] = linear[line[x, channel]]


@njit(cache=True)
def _filter_column(above, same, below, shift, variance, row):
    """Write a row of light, filtered along the columns."""
    half, one = np.float32(0.5), np.float32(1)
    spread = variance + shift * shift
    before, here, after = half * (spread - shift), one - spread, half * (spread + shift)
    for x in range(len(row)):
        row[x] = before * above[x] + here * same[x] + after * below[x]


@njit(cache=True)
def _filter_row(column, pad, aside, magnified, variance, share, row):
    """Write the light on one row, filtered along the row; the shift grows with the distance from the axis."""
    half = np.float32(0.5)
    start, width = 0, len(row)
    while start < width:  # stretches in which the nearest pixel is equally far away
        offset = math.floor(aside[start] * magnified + half)
        end = width
        if magnified != 0 and math.floor(aside[width - 1] * magnified + half) != offset:
            end = start + 1
            while end < width and math.floor(aside[end] * magnified + half) == offset:
                end += 1
        first = pad + start + int(offset)
        _filter_stretch(
            column[first - 1 : first - 1 + end - start],
            column[first : first + end - start],
            column[first + 1 : first + 1 + end - start],
            aside[start:end],
            magnified,
            np.float32(offset),
            variance,
            share[start:end],
            row[start:end],
        )
        start = end


@njit(cache=True)
def _filter_stretch(left, same, right, aside, magnified, offset, variance, share, row):
    half, one = np.float32(0.5), np.float32(1)
    for x in range(len(row)):
        shift = aside[x] * magnified - offset
        spread = variance + shift * shift
        value = half * (spread - shift) * left[x] + (one - spread) * same[x] + half * (spread + shift) * right[x]
        row[x] = share[x] * value


@njit(cache=True)
def _interleave(even, odd, row):
    """Write the pixels of even columns from one row and those of odd columns from another."""
    for x in range(len(row)):
        row[x] = odd[x] if x & 1 else even[x]


@njit(cache=True)
def _read_row(row, noise, y, channel, raw):
    """Write light as numbers with noise, whose variance grows with the light: the counted photons, and the readout."""
    words, normals, shot, read = noise
    if words.size:
        draws = words[channel, y]
        for x in range(len(row)):
            light = row[x] if row[x] > 0 else np.float32(0)
            row[x] += math.sqrt(shot * light + read) * normals[draws[x] >> 4]
    scale, bias, top = np.float32(WHITE) - np.float32(BLACK), np.float32(BLACK) + np.float32(0.5), np.float32(WHITE)
    for x in range(len(row)):
        value = row[x] * scale + bias
        value = value if value > 0 else np.float32(0)
        raw[x] = np.uint16(value if value < top else top)


@njit(cache=True)
def look_up(raw, table, rgb):
    """Write the colours ``rgb`` (h, w, 3) uint8 that a table (3, n) has for raw values (h, w, 3) uint16."""
    red, green, blue = table[0], table[1], table[2]
    for y in range(raw.shape[0]):
        for x in range(raw.shape[1]):
            rgb[y, x, 0] = red[raw[y, x, 0]]
            rgb[y, x, 1] = green[raw[y, x, 1]]
            rgb[y, x, 2] = blue[raw[y, x, 2]]
