"""What colours alone tell: a histogram of hue, saturation and value in stripes of a crop, the baseline to beat.

After Gray & Tao, "Viewpoint invariant pedestrian recognition", ECCV 2008, who describe six horizontal stripes.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_STRIPES = 6
_BINS = np.array([12, 4, 4])  # of hue, saturation, value
_RANGES = np.array([180, 256, 256])  # of them, as OpenCV counts
_MARGIN = 0.15  # of the width on either side, where there is mostly background


def describe(images: NDArray[np.uint8], *, balanced: bool = True) -> NDArray[np.float32]:
    """Unit descriptors (N, D) of crops (N, h, w, 3): roots of shares, so that distances are Hellinger's.

    Args:
        images: sRGB.
        balanced: grey-world white balance first, which takes a colour cast off.
    """
    height, width = images.shape[1:3]
    side = round(_MARGIN * width)
    rows = np.arange(height) * _STRIPES // height
    result = np.empty((len(images), _STRIPES * int(_BINS.prod())), np.float32)
    for k, image in enumerate(images):
        if balanced:
            mean = np.maximum(image.reshape(-1, 3).mean(axis=0), 1.0)
            image = np.clip(image * (mean.mean() / mean), 0, 255).astype(np.uint8)  # noqa: PLW2901
        hsv = cv2.cvtColor(image[:, side : width - side], cv2.COLOR_RGB2HSV).astype(int)
        hue, saturation, value = np.moveaxis(hsv * _BINS // _RANGES, -1, 0)
        cell = ((rows[:, None] * _BINS[0] + hue) * _BINS[1] + saturation) * _BINS[2] + value
        shares = np.bincount(cell.ravel(), minlength=result.shape[1]) / cell.size
        result[k] = np.sqrt(shares)
    return result
