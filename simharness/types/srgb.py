"""sRGB values and the linear light for which they stand (IEC 61966-2-1)."""

import numpy as np
from numpy.typing import NDArray

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue in luminance (Rec. 709)."""


def to_linear(values: NDArray) -> NDArray[np.floating]:
    """Convert sRGB values 0 to 255 to linear light 0 to 1."""
    share = np.asarray(values) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def from_linear(light: NDArray) -> NDArray[np.floating]:
    """Convert linear light 0 to 1 to sRGB values 0 to 255; brighter light gives values above 255."""
    light = np.maximum(light, 0)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def linear_table() -> NDArray[np.float32]:
    """Return the light of each value 0 to 255, (256,)."""
    return to_linear(np.arange(256)).astype(np.float32)


def rounded(light: NDArray) -> NDArray[np.uint8]:
    """Return the nearest sRGB values of linear light; light above 1 gives 255."""
    return np.clip(from_linear(light) + 0.5, 0, 255).astype(np.uint8)
