"""Sheets of pictures that two versions of the code made of the same scenes, each pair in a row."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.report.overlay import mosaic

Rgb = NDArray[np.uint8]


def comparison_sheet(rows: Sequence[tuple[str, Rgb, Rgb]], *, width: int) -> Rgb:
    """Return pairs of pictures below each other, ``before`` on the left.

    Args:
        rows: what is shown, and the picture of each version, both of one size.
        width: width of the sheet, pixels.

    Raises:
        ValueError: the pictures of a pair differ in size.
    """
    sheets = []
    for text, before, after in rows:
        if before.shape != after.shape:
            raise ValueError(f"{text}: pictures of one size expected, got {before.shape} and {after.shape}")
        pair = mosaic([before, after], [f"{text}, before", "after"])
        height = round(pair.shape[0] * width / pair.shape[1])
        sheets.append(cv2.resize(pair, (width, height), interpolation=cv2.INTER_AREA))
    return np.concatenate(sheets).astype(np.uint8)
