"""What a camera's electronics make of the light: exposure, colour, contrast, noise, compression and motion blur.

Nothing moves in the picture: the truth about it stays. Every camera has a character of its own, drawn once; noise is
drawn for every picture.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from simharness.scenario.sections.cameras import Sensor
from simharness.types.random_streams import stream

Rgb = NDArray[np.uint8]

_GRAY = 0.5  # sRGB: contrast turns about it
_LEAST_CONTRAST = 0.2


@dataclass(frozen=True)
class Character:
    """How one camera differs from a perfect one.

    Attributes:
        contrast: slope of the response about middle gray; 1 is faithful.
        balance: factor of red, green and blue in linear light; green stays.
        stops: how much longer than right it exposes, as a power of two.
    """

    contrast: float = 1.0
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    stops: float = 0.0


def character(sensor: Sensor, *, seed: int, view: int) -> Character:
    """Draw the character of camera ``view``; every dial scales a draw of its own, so none shifts another."""
    contrast, red, blue, stops = stream(seed, "sensor", "character", view).standard_normal(4).tolist()
    return Character(
        contrast=max(1.0 + sensor.gain * contrast, _LEAST_CONTRAST),
        balance=(float(np.exp(sensor.white_balance * red)), 1.0, float(np.exp(sensor.white_balance * blue))),
        stops=sensor.exposure * stops,
    )


def develop(rgb: Rgb, sensor: Sensor, *, seed: int, view: int, frame: int) -> Rgb:
    """What camera ``view`` delivers of a picture in frame ``frame``; with all dials at zero the picture itself.

    In the order of a camera: white balance and exposure of the light, which clips; contrast; noise; compression. Motion
    blur is made before, from several pictures: :func:`blur`.

    Args:
        rgb: (h, w, 3) uint8, sRGB.
        sensor: the dials.
        seed: of the scenario.
        view: index of the camera.
        frame: index of the frame in which the picture was taken.
    """
    own = character(sensor, seed=seed, view=view)
    table = _response(own)
    result = rgb
    if sensor.noise:
        # Drawn whole and then scaled: more noise is the same noise, only stronger.
        noise = stream(seed, "sensor", "noise", view, frame).standard_normal(rgb.shape, np.float32)
        exact = np.stack([table[k, rgb[..., k]] for k in range(3)], axis=-1)
        result = np.clip(exact + np.float32(sensor.noise) * noise + np.float32(0.5), 0, 255).astype(np.uint8)
    elif own != Character():
        rounded = np.clip(table + 0.5, 0, 255).astype(np.uint8)
        result = cv2.LUT(rgb, np.ascontiguousarray(rounded.T)[:, None]).astype(np.uint8, copy=False)
    return compressed(result, sensor.jpeg) if sensor.jpeg else result


def blur(pictures: Iterable[Rgb]) -> Rgb:
    """One exposure during which all ``pictures`` (h, w, 3) were seen for equally long: their mean in linear light.

    Raises:
        ValueError: no pictures.
    """
    total, count = None, 0
    linear = to_linear(np.arange(256)).astype(np.float32)
    for picture in pictures:
        light = linear[picture]
        total = light if total is None else total + light
        count += 1
    if total is None:
        raise ValueError("an exposure needs at least one picture, got none")
    return np.clip(from_linear(total / count) + 0.5, 0, 255).astype(np.uint8)


def compressed(rgb: Rgb, quality: int) -> Rgb:
    """The picture after JPEG of ``quality`` 1 to 100."""
    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    back = cv2.imdecode(data, cv2.IMREAD_COLOR) if done else None
    if back is None:
        raise RuntimeError(f"JPEG of quality {quality} failed on a picture of {rgb.shape}")
    return np.ascontiguousarray(back[..., ::-1]).astype(np.uint8, copy=False)


def to_linear(values: NDArray) -> NDArray[np.floating]:
    """Light, 0 to 1, of sRGB values 0 to 255 (IEC 61966-2-1)."""
    share = np.asarray(values) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def from_linear(light: NDArray) -> NDArray[np.floating]:
    """SRGB values, 0 to 255, of light 0 to 1; what is brighter goes on beyond 255."""
    light = np.maximum(light, 0)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def _response(own: Character) -> NDArray[np.float32]:
    """What each value 0..255 of red, green and blue becomes, (3, 256) of 255; not rounded, nor clipped."""
    if own == Character():
        return np.tile(np.arange(256, dtype=np.float32), (3, 1))  # to the last digit
    factors = np.array(own.balance)[:, None] * 2.0**own.stops
    values = np.minimum(from_linear(to_linear(np.arange(256.0)) * factors), 255)
    return (255 * _GRAY + own.contrast * (values - 255 * _GRAY)).astype(np.float32)
