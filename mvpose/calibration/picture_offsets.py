"""Crops of pictures and turns of cameras: searched on a grid of offsets of the picture, then refined.

The grid is searched on few frames and with errors of keypoints that are as large as its cells, so that the best offset
is found although no point of the grid is near enough to it for the true errors.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.file_mistakes import CROPPED, TURNED, Mistake
from mvpose.calibration.pieces import Pieces
from mvpose.calibration.reading_changes import Change, Size, changed, shifted_picture, turned_by_picture

_LEAST_OFFSET = 0.06  # of the size of the picture: smaller crops are rare, smaller turns are found by the camera fit
_SUSPECT = 0.6  # a camera that agrees less than this share of the median is searched for crops and turns
EXPLAINED = 0.7
"""Agreement, of all cameras and of the worst one over the median, from which no crop and no turn is searched."""

COARSE_SPACING = 0.8
"""Seconds between the frames of the search on the grid."""

_CELL = 0.05  # of the size of the picture
_OFFSETS = tuple(
    (float(dx), float(dy)) for dx in np.arange(-8, 9) * _CELL for dy in np.arange(-8, 9) * _CELL if dx or dy
)
_STARTS = 3  # points of the grid that are refined
_COARSE_STEPS = (0.025, 0.0125)
_STEPS = (0.01, 0.005, 0.0025)

Offset = tuple[float, float]
Shift = Callable[[float, float], Change]
Trial = tuple[float, Reading, Offset]


@dataclass(frozen=True)
class OffsetSearch:
    """Search of crops and turns."""

    consistency: Consistency
    """Evidence for readings of the detections."""
    coarse: Consistency
    """Evidence on the frames and with the errors of the grid (:func:`blurred`)."""
    sizes: Sequence[Size]
    """Width and height of the pictures of each camera, pixels."""

    def candidates(self, reading: Reading) -> Iterator[tuple[Mistake, Reading]]:
        """Yield for cameras that agree badly with the rest their likeliest crop and their likeliest turn."""
        agrees, views = self.consistency.agreement(reading), len(self.sizes)
        suspects = agrees < max(_SUSPECT * float(np.median(agrees)), EXPLAINED)
        chosen_sets: list[tuple[int, ...]] = [(int(view),) for view in np.flatnonzero(suspects)] if views > 2 else []
        if suspects.sum() > 0.5 * views:
            chosen_sets.append(tuple(range(views)))
        for chosen in chosen_sets:
            starts = self._on_grid(reading, chosen)
            for mistake, change in ((CROPPED, shifted_picture), (TURNED, turned_by_picture)):
                if mistake is TURNED and len(chosen) > 1:
                    continue
                found, (dx, dy) = self._refined(reading, chosen, change, starts)
                if max(abs(dx), abs(dy)) < _LEAST_OFFSET:
                    continue
                width, height = self.sizes[chosen[0]]
                if mistake is CROPPED:
                    size = (("x_px", dx * width), ("y_px", dy * height))
                    crop = f"crop:{dx * width:.6g},{dy * height:.6g}"
                    yield replace(mistake, views=chosen, size=size, mend=crop), found
                else:
                    yield replace(mistake, views=chosen), found

    def _on_grid(self, reading: Reading, views: tuple[int, ...]) -> list[Offset]:
        """Return the likeliest offsets of the grid, shares of the size of the picture, none beside another."""
        trial = self._trials(self.coarse, reading, views, shifted_picture)
        scores = [trial(offset)[0] for offset in _OFFSETS]
        starts: list[Offset] = []
        for index in np.argsort(scores)[::-1]:
            x, y = _OFFSETS[index]
            if all(max(abs(x - a), abs(y - b)) > 1.5 * _CELL for a, b in starts):
                starts.append((x, y))
            if len(starts) == _STARTS:
                break
        return starts

    def _refined(
        self, reading: Reading, views: tuple[int, ...], change: Shift, starts: Sequence[Offset]
    ) -> tuple[Reading, Offset]:
        """Return the likeliest reading with an offset near some others, and the offset."""
        coarse = self._trials(self.coarse, reading, views, change)
        best = max((_climbed(coarse, start, _COARSE_STEPS) for start in starts), key=lambda each: each[0])
        _, found, offset = _climbed(self._trials(self.consistency, reading, views, change), best[2], _STEPS)
        return found, offset

    def _trials(
        self, consistency: Consistency, reading: Reading, views: tuple[int, ...], change: Shift
    ) -> Callable[[Offset], Trial]:
        """Return a function of an offset that gives the evidence of the reading with it, the reading, and itself."""

        def trial(offset: Offset) -> Trial:
            other = changed(reading, self.sizes, change(*offset), views) or reading
            return float(consistency(other).sum()), other, offset

        return trial


def _climbed(trial: Callable[[Offset], Trial], start: Offset, steps: Sequence[float]) -> Trial:
    """Return evidence, reading and offset at the end of steps to the likeliest of eight neighbours."""
    best = trial(start)
    for step in steps:
        for _ in range(2):
            x, y = best[2]
            around = [(x + i * step, y + j * step) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
            before = best
            best = max([best, *map(trial, around)], key=lambda each: each[0])
            if best is before:
                break
    return best


def blurred(pieces: Pieces, sizes: Sequence[Size]) -> Pieces:
    """Return the detections with errors of the size of a cell of the grid.

    Args:
        pieces: detections in windows of time.
        sizes: width and height of the pictures of each camera, pixels.
    """
    cell = _CELL / np.sqrt(12.0) * np.array([max(size) for size in sizes])  # standard deviation within a cell
    return replace(pieces, sigma=np.hypot(pieces.sigma, cell[pieces.view][:, None]))
