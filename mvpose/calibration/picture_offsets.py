"""Crops of pictures and turns of cameras, which are searched on a grid of offsets of the picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.file_mistakes import CROPPED, TURNED, Mistake
from mvpose.calibration.reading_changes import Change, Size, changed, shifted_picture, turned_by_picture

_LEAST_OFFSET = 0.06  # of the size of the picture: nobody crops less, and smaller turns are found by the cameras' fit
_SUSPECT = 0.6  # a camera that agrees less than this share of the median is searched for crops and turns
EXPLAINED = 0.7
"""Agreement, of all cameras and of the worst one over the median, from which no crop and no turn is searched."""

_OFFSETS = [
    (dx, dy)
    for dx in np.arange(-0.40, 0.41, 0.04).round(2)
    for dy in np.arange(-0.40, 0.41, 0.04).round(2)
    if max(abs(dx), abs(dy)) >= _LEAST_OFFSET
]


def offset_pictures(
    consistency: Consistency, reading: Reading, sizes: Sequence[Size]
) -> Iterator[tuple[Mistake, Reading]]:
    """Yield for cameras that agree badly with the rest their likeliest crop and their likeliest turn."""
    agrees, views = consistency.agreement(reading), len(sizes)
    suspects = agrees < max(_SUSPECT * float(np.median(agrees)), EXPLAINED)
    chosen_sets: list[tuple[int, ...]] = [(int(view),) for view in np.flatnonzero(suspects)] if views > 2 else []
    if suspects.sum() > 0.5 * views:
        chosen_sets.append(tuple(range(views)))
    for chosen in chosen_sets:
        for mistake, change in ((CROPPED, shifted_picture), (TURNED, turned_by_picture)):
            if mistake is TURNED and len(chosen) > 1:
                continue
            found, (dx, dy) = _best_offset(consistency, reading, sizes, chosen, change)
            if max(abs(dx), abs(dy)) < _LEAST_OFFSET:
                continue
            width, height = sizes[chosen[0]]
            size = (("x_px", dx * width), ("y_px", dy * height)) if mistake is CROPPED else ()
            yield replace(mistake, views=chosen, size=size), found


def _best_offset(
    consistency: Consistency,
    reading: Reading,
    sizes: Sequence[Size],
    views: tuple[int, ...],
    change: Callable[[float, float], Change],
) -> tuple[Reading, tuple[float, float]]:
    """Return the likeliest reading with an offset of pictures, by shares of their size, and the offset."""

    def at(offset: tuple[float, float]) -> tuple[float, Reading, tuple[float, float]]:
        other = changed(reading, sizes, change(*offset), views) or reading
        return float(consistency(other).sum()), other, offset

    best = max((at(offset) for offset in _OFFSETS), key=lambda each: each[0])
    for step in (0.02, 0.01, 0.01, 0.005, 0.0025):
        x, y = best[2]
        around = [(x + i * step, y + j * step) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        best = max([best, *(at(offset) for offset in around)], key=lambda each: each[0])
    return best[1], best[2]
