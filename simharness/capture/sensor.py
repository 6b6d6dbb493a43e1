"""Image sensor: exposure, white balance, contrast, noise, compression and motion blur.

The geometry of the picture does not change, so its ground truth stays valid. Each camera has a response drawn once;
noise is drawn for every picture.
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

_GRAY = 0.5  # sRGB value that contrast leaves unchanged
_LEAST_CONTRAST = 0.2


@dataclass(frozen=True)
class Response:
    """Deviation of one camera from an ideal one.

    Attributes:
        contrast: slope of the response about middle gray; 1 is ideal.
        balance: factors of red, green and blue in linear light; green is 1.
        stops: overexposure as a power of two.
    """

    contrast: float = 1.0
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    stops: float = 0.0


def draw_response(sensor: Sensor, *, seed: int, view: int) -> Response:
    """Draw the response of camera ``view``; each parameter scales a separate draw, so none shifts another."""
    contrast, red, blue, stops = stream(seed, "sensor", "character", view).standard_normal(4).tolist()
    return Response(
        contrast=max(1.0 + sensor.gain * contrast, _LEAST_CONTRAST),
        balance=(float(np.exp(sensor.white_balance * red)), 1.0, float(np.exp(sensor.white_balance * blue))),
        stops=sensor.exposure * stops,
    )


def develop(rgb: Rgb, sensor: Sensor, *, seed: int, view: int, frame: int) -> Rgb:
    """Apply the sensor of camera ``view`` to a picture; with all parameters at zero the picture is unchanged.

    The order is that of a camera: white balance and exposure of the light, which clips; contrast; noise; compression.
    Motion blur comes before, from several pictures: :func:`blur`.

    Args:
        rgb: ideal picture, (h, w, 3) uint8, sRGB.
        sensor: parameters of the sensor.
        seed: seed of the scenario.
        view: index of the camera.
        frame: index of the frame in which the picture was taken.
    """
    response = draw_response(sensor, seed=seed, view=view)
    table = _lookup_table(response)
    result = rgb
    if sensor.noise:
        # Drawn at unit strength and then scaled: a larger parameter gives the same noise, only stronger.
        noise = stream(seed, "sensor", "noise", view, frame).standard_normal(rgb.shape, np.float32)
        exact = np.stack([table[k, rgb[..., k]] for k in range(3)], axis=-1)
        result = np.clip(exact + np.float32(sensor.noise) * noise + np.float32(0.5), 0, 255).astype(np.uint8)
    elif response != Response():
        rounded = np.clip(table + 0.5, 0, 255).astype(np.uint8)
        result = cv2.LUT(rgb, np.ascontiguousarray(rounded.T)[:, None]).astype(np.uint8, copy=False)
    return compressed(result, sensor.jpeg) if sensor.jpeg else result


def blur(pictures: Iterable[Rgb]) -> Rgb:
    """Return an exposure that sees all ``pictures`` (h, w, 3) for equally long: their mean in linear light.

    Raises:
        ValueError: no pictures are given.
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
    """Return the picture after JPEG compression with ``quality`` 1 to 100."""
    success, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR) if success else None
    if decoded is None:
        raise RuntimeError(f"JPEG compression with quality {quality} failed for a picture of shape {rgb.shape}")
    return np.ascontiguousarray(decoded[..., ::-1]).astype(np.uint8, copy=False)


def to_linear(values: NDArray) -> NDArray[np.floating]:
    """Convert sRGB values 0 to 255 to linear light 0 to 1 (IEC 61966-2-1)."""
    share = np.asarray(values) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def from_linear(light: NDArray) -> NDArray[np.floating]:
    """Convert linear light 0 to 1 to sRGB values 0 to 255; brighter light gives values above 255."""
    light = np.maximum(light, 0)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def _lookup_table(response: Response) -> NDArray[np.float32]:
    """Return the output for each value 0 to 255 of red, green and blue, (3, 256); neither rounded nor clipped."""
    if response == Response():
        return np.tile(np.arange(256, dtype=np.float32), (3, 1))  # exact
    factors = np.array(response.balance)[:, None] * 2.0**response.stops
    values = np.minimum(from_linear(to_linear(np.arange(256.0)) * factors), 255)
    return (255 * _GRAY + response.contrast * (values - 255 * _GRAY)).astype(np.float32)
