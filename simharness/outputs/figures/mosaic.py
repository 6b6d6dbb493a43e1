"""Mosaic of pictures: a grid of titled tiles, and a legend that fits into a tile."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.report.palette import PAPER, Color
from simharness.outputs.figures.overlay import Overlay, text_mask

Mark = Literal["skeleton", "limbs", "box", "none"]

_TITLE = 24.0  # height in pixels for a picture 600 pixels high: legible when three tiles share the width of a page
_ZIGZAG = ((0, 1), (1, 2))


def mosaic(
    images: Sequence[NDArray[np.uint8]], titles: Sequence[str], *, columns: int | None = None, gap: int | None = None
) -> NDArray[np.uint8]:
    """Arrange pictures row by row, each below its title.

    All tiles have the size of the largest picture; a smaller picture is enlarged to fit its tile and keeps its aspect
    ratio.

    Args:
        images: pictures, each (h, w, 3) uint8.
        titles: one title for each picture.
        columns: tiles in a row; by default about as many as there are rows (five pictures: three and two).
        gap: pixels between tiles and around them; by default a 60th of the picture height.

    Returns:
        (H, W, 3) uint8.

    Raises:
        ValueError: there is no picture, or there are not as many titles as pictures.
    """
    if not images or len(images) != len(titles):
        raise ValueError(
            f"a mosaic needs one picture or more and one title for each, got {len(images)} pictures and {len(titles)} "
            "titles"
        )
    height, width = max(picture.shape[0] for picture in images), max(picture.shape[1] for picture in images)
    gap = max(2, height // 60) if gap is None else gap
    columns = _columns(len(images)) if columns is None else columns
    rows = math.ceil(len(images) / columns)
    scale = height / 600
    band = text_mask("", _TITLE * scale).shape[0] + round(8 * scale)
    sheet = np.full(
        (rows * (height + band) + (rows + 1) * gap, columns * width + (columns + 1) * gap, 3), PAPER, np.uint8
    )
    paper = Overlay(sheet, scale=scale)
    for k, (picture, title) in enumerate(zip(images, titles, strict=True)):
        top, left = gap + k // columns * (height + band + gap), gap + k % columns * (width + gap)
        fitted = _fitted(picture, height, width)
        down, right = top + band + (height - fitted.shape[0]) // 2, left + (width - fitted.shape[1]) // 2
        paper.rgb[down : down + fitted.shape[0], right : right + fitted.shape[1]] = fitted
        paper.text(title, at=(left + 2 * scale, top), size=_TITLE)
    return paper.rgb


def rooms_in_grid(count: int) -> int:
    """Return the number of tiles, empty ones included, of a mosaic of ``count`` pictures: 6 of 5."""
    columns = _columns(count)
    return columns * math.ceil(count / columns)


def _columns(count: int) -> int:
    return math.ceil(math.sqrt(count))


def _fitted(picture: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Return the picture scaled to the largest size that fits into a tile."""
    scale = min(height / picture.shape[0], width / picture.shape[1])
    if scale == 1.0:
        return picture
    size = (min(width, round(scale * picture.shape[1])), min(height, round(scale * picture.shape[0])))
    return cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR).astype(np.uint8, copy=False)


def legend(entries: Sequence[tuple[Mark, Color, str]], *, size: tuple[int, int], title: str = "") -> NDArray[np.uint8]:
    """Draw a legend as a picture, (height, width, 3) uint8.

    Args:
        entries: mark ("skeleton": thin with a dark rim, "limbs": thick and translucent, "box", or "none": text alone),
            colour and meaning of each entry.
        size: width and height of the picture in pixels.
        title: heading.
    """
    width, height = size
    paper = Overlay(np.full((height, width, 3), PAPER, np.uint8))
    scale = paper.scale
    left, indent, line = 30.0, 72.0, min(56.0, 520.0 / (len(entries) + 2))
    room = width / scale - 2 * left - indent
    longest = max((text_mask(meaning, 100).shape[1] / 100 for _, _, meaning in entries), default=1.0)
    letters = min(_TITLE, 0.55 * line, room / longest)
    y = 36.0
    if title:
        paper.text(title, at=(left * scale, y * scale), size=1.2 * _TITLE)
        y += 1.5 * line
    for mark, color, meaning in entries:
        middle = y + line / 2
        ends = np.array([[left, middle + 7], [left + 26, middle - 7], [left + 52, middle + 5]]) * scale
        if mark == "skeleton":
            paper.skeleton(ends, color=color, edges=_ZIGZAG, outline=1.0, width=2, dots=3)
        elif mark == "limbs":
            paper.skeleton(ends, color=color, edges=_ZIGZAG, width=9, dots=0, opacity=0.55)
        elif mark == "box":
            paper.box(np.array([left + 6, middle - 12, 40, 24]) * scale, color=color, width=2.5)
        paper.text(meaning, at=((left + indent) * scale, (middle - 0.62 * letters) * scale), size=letters)
        y += line
    return paper.rgb
