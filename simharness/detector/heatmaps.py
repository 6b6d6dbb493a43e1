"""Heat maps from which the detections would have been read, drawn on request.

A top-down head sees a crop around the box of a person and gives for every joint and every cell of a grid how likely the
joint is there: a Gaussian about the keypoint, as high as its score. A network that is trained with the squared error
towards such Gaussians learns their mean over the possible positions of the joint: where it is right with probability
p, its map has a peak of height p, and a peak of height 1 - p at the one other place that competes. Joints with a rival
have these two peaks here.
"""

from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.checks import seal
from mvpose.heatmaps import Heatmaps
from mvpose.kernels import njit
from simharness.detector.detection_block import DetectionBlock
from simharness.detector.steps import Context, StepStage, step
from simharness.scenario.sections.detector_section import HeatmapHeadSection
from simharness.types.truth import KeypointError

ASPECT = 3 / 4
"""Width of a crop over its height, as of the maps."""

PADDING = 1.25
"""Size of a crop over the size of its box (Xiao, Wu & Wei, "Simple baselines", ECCV 2018, and most heads since)."""

_MIN_DISTANCE = 3.0  # widths from which a rival has a separate peak; a nearer one merges with the first
_FAINT = 0.5  # highest floor, as a share of the peak's height
_TILT = 0.1  # share of its height that the floor loses away from the peak: modes of a level floor are slow to search


@dataclass(frozen=True)
class Peaks:
    """Parameters of the heat maps of m detections of one frame: a few numbers for each joint."""

    boxes: Floats
    """x, y, width, height in pixels, (m, 4)."""
    keypoints: Floats
    """Pixels, (m, J, 2); NaN where a joint is not reported."""
    scores: Floats
    """Scores of keypoints, 0 to 1, (m, J); 0 where not reported."""
    rivals: Floats
    """Positions of second peaks, pixels, (m, J, 2); NaN where there is none."""
    config: HeatmapHeadSection
    """Parameters of the head."""

    def heatmaps(self) -> Heatmaps:
        """Draw the maps: the strongest modes are the keypoints, as high as their scores; the second are the rivals.

        A rival has the height 1 - score, at most ``config.rivals`` times the score: a joint of score 1 has none.
        Elsewhere the height of a map is about ``config.floor``, but less than half its peak and less than the cells
        around the peak. The map of a joint that is not reported, or not in the crop, is 0 everywhere: a floor alone
        would have a highest cell, from which a keypoint would be read.

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
        separate = np.linalg.norm(rivals - cells, axis=-1) >= _MIN_DISTANCE * self.config.width
        rest = np.minimum(1 - heights, self.config.rivals * heights)
        second = np.where(separate & _inside(self.rivals, corner, size), rest, 0.0)
        # The cells around the highest one locate the peak between cells; they are at most 1.5 and 0.5 cells away.
        beside = np.exp(-0.5 * (1.5**2 + 0.5**2) / self.config.width**2)
        floor = np.minimum(self.config.floor, min(_FAINT, beside) * heights)
        values = np.zeros((*heights.shape, rows, columns), np.float32)
        _draw(cells, heights, rivals, second, floor, self.config.width, values)
        seal(values)
        return Heatmaps(values, origin, stride)


@step("crops", stage=StepStage.DETECTIONS, sections=("heatmaps",))
def limit_to_crops(block: DetectionBlock, context: Context) -> DetectionBlock:
    """Drop keypoints outside the crops where keypoints are read from heat maps."""
    return block if context.config.heatmaps.size == "none" else drop_outside_crops(block)


def drop_outside_crops(block: DetectionBlock) -> DetectionBlock:
    """Return the block without keypoints outside the crop of their box: a top-down head sees only its crop."""
    corner, size = _crops(block.boxes)
    out = np.isfinite(block.keypoints[..., 0]) & ~_inside(block.keypoints, corner, size)
    if not out.any():
        return block
    scores = np.where(out, 0.0, block.scores)
    return replace(
        block,
        present=block.present & (scores > 0).any(axis=-1),
        keypoints=np.where(out[..., None], np.nan, block.keypoints),
        scores=scores,
        error=np.where(out, np.int8(KeypointError.ABSENT), block.error),
        guessed=block.guessed & ~out,
        rivals=np.where(out[..., None], np.nan, block.rivals),
    )


def _crops(boxes: Floats) -> tuple[Floats, Floats]:
    """Return the upper left corners and the sizes of the crops of boxes (..., 4), pixels, (..., 2) each."""
    center, size = boxes[..., :2] + 0.5 * boxes[..., 2:], boxes[..., 2:]
    height = PADDING * np.maximum(np.maximum(size[..., 1], size[..., 0] / ASPECT), 1.0)
    crop = np.stack([ASPECT * height, height], axis=-1)
    return center - 0.5 * crop, crop


def _inside(points: Floats, corner: Floats, size: Floats) -> Bools:
    """Return which points (..., J, 2) are in the crops, (..., J)."""
    low = corner[..., None, :]
    return np.all((points >= low) & (points <= low + size[..., None, :]), axis=-1)


@njit(cache=True)
def _draw(cells, heights, rivals, second, floors, width, values):
    """Fill zero maps (m, J, h, w) with the higher of floor and peaks; peaks at columns and rows (m, J, 2).

    A peak is the product of a horizontal and a vertical bell, the floor the sum of a horizontal and a vertical slope.
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
    """Fill ``bell`` with a Gaussian of height 1 about ``center``, in cells."""
    for c in range(len(bell)):
        bell[c] = np.exp(-0.5 * ((c - center) / width) ** 2)
