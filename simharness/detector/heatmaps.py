"""The heat maps that detections would have been read from, made when they are asked for.

A top-down head looks at a crop about the box of a person, and says for every joint how much each cell of a grid looks
like it: a Gaussian about the keypoint, as high as its score. A network that is trained with the squared error towards
such Gaussians learns their mean over what the joint could be: where it is right with probability p, its maps have a
peak of p, and where one other place competes one of 1 - p there. So has a joint with a rival here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from mvpose.arrays import Bools, Floats
from mvpose.checks import seal
from mvpose.heatmaps import Heatmaps
from simharness.detector.detection_block import Found
from simharness.scenario.sections.detector import HeatmapHead
from simharness.types.truth import KeypointError

ASPECT = 3 / 4
"""Width of a crop over its height: that of the maps."""

PADDING = 1.25
"""Size of a crop over that of the box in it (Xiao, Wu & Wei, "Simple baselines", ECCV 2018, and most heads since)."""

_APART = 3.0  # widths from which a rival has a peak of its own; a nearer one is one with the keypoint's
_FAINT = 0.5  # of a peak's height that the floor has at most
_TILT = 0.1  # of its height the floor loses away from the peak: a level one takes long to search for modes


@dataclass(frozen=True)
class Peaks:
    """What the heat maps of one frame's m detections are made of: a few numbers a joint.

    Attributes:
        boxes: x, y, width, height in pixels, (m, 4).
        keypoints: pixels, (m, J, 2); NaN where a joint is not reported.
        scores: of keypoints, 0 to 1, (m, J); 0 where not reported.
        rivals: where another place competes, pixels, (m, J, 2); NaN where none does.
        config: the head.
    """

    boxes: Floats
    keypoints: Floats
    scores: Floats
    rivals: Floats
    config: HeatmapHead

    def heatmaps(self) -> Heatmaps:
        """Draw the maps: the strongest modes are the keypoints, as high as the scores; the second ones are the rivals.

        A rival is as high as 1 - score, at most ``config.rivals`` of the score: a sure joint has none. Elsewhere a map
        is about ``config.floor`` high, but lower than half its peak and the cells around it. The map of a joint that is
        not reported, or not in the crop, is 0 throughout: a floor alone would have a highest cell, and a keypoint would
        be read from it.

        Raises:
            ValueError: the head is "none".
        """
        if self.config.size == "none":
            raise ValueError('detector.heatmaps.size must be "64x48" or "96x72" for maps to be drawn, got "none"')
        rows, columns = (int(cells) for cells in self.config.size.split("x"))
        corner, size = _crops(self.boxes)
        stride = size / (columns, rows)
        origin = corner + 0.5 * stride
        cells, rivals = ((each - origin[:, None]) / stride[:, None] for each in (self.keypoints, self.rivals))
        heights = np.where(_inside(self.keypoints, corner, size), self.scores, 0.0)
        apart = np.linalg.norm(rivals - cells, axis=-1) >= _APART * self.config.width
        rest = np.minimum(1 - heights, self.config.rivals * heights)
        second = np.where(apart & _inside(self.rivals, corner, size), rest, 0.0)
        # The cells around the highest one say where between cells the peak is: they are 1.5 and 0.5 away at most.
        beside = np.exp(-0.5 * (1.5**2 + 0.5**2) / self.config.width**2)
        floor = np.minimum(self.config.floor, min(_FAINT, beside) * heights)
        values = np.zeros((*heights.shape, rows, columns), np.float32)
        _draw(cells, heights, rivals, second, floor, self.config.width, values)
        seal(values)
        return Heatmaps(values, origin, stride)


def in_crops(found: Found) -> Found:
    """What a head reports that sees its crop alone: keypoints outside it are absent."""
    corner, size = _crops(found.boxes)
    out = np.isfinite(found.keypoints[..., 0]) & ~_inside(found.keypoints, corner, size)
    if not out.any():
        return found
    scores = np.where(out, 0.0, found.scores)
    return replace(
        found,
        there=found.there & (scores > 0).any(axis=-1),
        keypoints=np.where(out[..., None], np.nan, found.keypoints),
        scores=scores,
        error=np.where(out, np.int8(KeypointError.ABSENT), found.error),
        rivals=np.where(out[..., None], np.nan, found.rivals),
    )


def _crops(boxes: Floats) -> tuple[Floats, Floats]:
    """Upper left corners and sizes of the crops of boxes (..., 4), pixels, (..., 2) each."""
    center, size = boxes[..., :2] + 0.5 * boxes[..., 2:], boxes[..., 2:]
    height = PADDING * np.maximum(np.maximum(size[..., 1], size[..., 0] / ASPECT), 1.0)
    crop = np.stack([ASPECT * height, height], axis=-1)
    return center - 0.5 * crop, crop


def _inside(points: Floats, corner: Floats, size: Floats) -> Bools:
    """Which points (..., J, 2) are in the crops, (..., J)."""
    low = corner[..., None, :]
    return np.all((points >= low) & (points <= low + size[..., None, :]), axis=-1)


@njit(cache=True)
def _draw(cells, heights, rivals, second, floors, width, values):
    """Draw maps (m, J, h, w) that are all 0: the higher of floor and peaks, these at columns and rows (m, J, 2).

    A bell is the product of one across and one down, and the floor the sum of a slope across and one down.
    """
    m, joints, h, w = values.shape
    bell, slope = np.empty(w, np.float32), np.empty(w, np.float32)
    for d in range(m):
        for j in range(joints):
            if heights[d, j] <= 0.0:
                continue
            x, y, floor = cells[d, j, 0], cells[d, j, 1], floors[d, j]
            fall = floor * _TILT / (h + w)
            _bell(x, width, bell)
            for c in range(w):
                slope[c] = fall * abs(c - x)
            for r in range(h):
                row = values[d, j, r]
                most = np.float32(heights[d, j] * np.exp(-0.5 * ((r - y) / width) ** 2))
                level = np.float32(floor - fall * abs(r - y))
                for c in range(w):
                    row[c] = max(most * bell[c], level - slope[c])
            if second[d, j] > 0.0:
                _bell(rivals[d, j, 0], width, bell)
                for r in range(h):
                    row = values[d, j, r]
                    most = np.float32(second[d, j] * np.exp(-0.5 * ((r - rivals[d, j, 1]) / width) ** 2))
                    for c in range(w):
                        row[c] = max(row[c], most * bell[c])


@njit(cache=True)
def _bell(center, width, bell):
    for c in range(len(bell)):
        bell[c] = np.exp(-0.5 * ((c - center) / width) ** 2)
