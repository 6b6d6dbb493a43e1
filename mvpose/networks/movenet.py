"""People in pictures by MoveNet (Google, 2021): CenterNet's heads, decoded for any number of people and any size.

The network gives on a grid of every fourth pixel where centres of people are, and of every joint where it is; at each
centre the places of the person's joints and the size of its box; at each cell the offset of a joint from it. A joint of
a person is where the heat map of the joint, weighted by the distance from the regressed place, is greatest.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mvpose.networks.card import Card
from mvpose.networks.crops import Pixels, Placement, crop_images
from mvpose.networks.detector import PeopleInPicture, PictureSession, as_picture_session, suppressed
from mvpose.networks.session import Provider

Values = NDArray[np.float32]

SIZES = (320, 640)
"""Longer sides of the inputs in which people are found, pixels: people who are large in one are small in the other.

The network finds people who are about 80 to 250 pixels tall. On rendered scenes of five people at close range, of four
around a shelf and of a crowd of ten, both sizes give ``full`` a PCP of 96.2, 99.7 and 94.6, and 512 alone 95.8, 97.2
and 92.4. Reading the joints again in crops of the people, by MoveNet Thunder, made it worse (``fast`` 92.5 for 95.0 at
close range): in a crowd, a crop shows several people.
"""

_CELL = 4  # pixels of the input for each cell
_STEP = 32  # the network halves its input five times
_MOST = 50  # people in an input
_BLACK = (0, 0, 0)
_REACH = 2  # cells around a centre in which no other is
_SPREAD = 0.300048828125  # of the shorter side of the grid: squared width of the weights; 0.3 in half precision
_LEAST = 0.126953125  # score of a joint that counts towards the score of its person


@dataclass(frozen=True)
class Heads:
    """Outputs of MultiPose for one picture, (h, w, ...) cells."""

    centers: Values
    """Probability of the centre of a person, (h, w)."""
    heatmaps: Values
    """Probability of each joint, (h, w, J)."""
    regression: Values
    """Places of the joints of the person centred at a cell, rows and columns from it, (h, w, J, 2), cells."""
    offsets: Values
    """Place of a joint that is at a cell, from it, (h, w, J, 2)."""
    box_size: Values
    """Height and width of the person centred at a cell, (h, w, 2), cells."""
    box_offset: Values
    """Centre of its box from the cell, (h, w, 2)."""


class MoveNet:
    """Detector of people and their joints by MoveNet MultiPose, as ``mvpose networks get movenet`` stores it.

    Args:
        model: ONNX file, or its session.
        least: least score of a person.
        overlap: intersection over union above which the weaker of two boxes is left out.
        sizes: longer sides of the inputs.
        provider: as of :class:`mvpose.networks.Session`.
        threads: as of :class:`mvpose.networks.Session`.

    Attributes:
        card: card of its file.
        kind: "movenet".
        one_stage: True: it gives keypoints, those of COCO-17.
        least: least score of a person.

    Raises:
        ValueError: as for :class:`mvpose.networks.Session`.
    """

    card = Card(name="movenet", size=(max(SIZES),) * 2, mean=(0.0,) * 3, std=(1 / 255,) * 3)
    kind = "movenet"
    one_stage = True

    def __init__(
        self,
        model: str | Path | PictureSession,
        *,
        least: float = 0.1,
        overlap: float = 0.5,
        sizes: tuple[int, ...] = SIZES,
        provider: Provider = "cpu",
        threads: int = 1,
    ) -> None:
        self._session = as_picture_session(model, provider=provider, threads=threads)
        self.least, self._overlap, self._sizes = least, overlap, sizes

    def find(self, picture: Pixels) -> PeopleInPicture:
        """Return the people in a picture, (h, w, 3) uint8, red green blue, the most confident first."""
        found = PeopleInPicture.joined([self._find(picture, longest) for longest in self._sizes])
        rows = np.argsort(-found.scores, kind="stable")
        found = found.select(rows[found.scores[rows] >= self.least])
        return found.select(suppressed(found.boxes, overlap=self._overlap))

    def _find(self, picture: Pixels, longest: int) -> PeopleInPicture:
        """Return the people in a picture that is reduced, or enlarged, to a size."""
        height, width = picture.shape[:2]
        stride = max(width, height) / longest
        size = _STEP * math.ceil(width / stride / _STEP), _STEP * math.ceil(height / stride / _STEP)
        placement = Placement(np.full((1, 2), 0.5 * stride - 0.5), np.full((1, 2), stride))
        crop = crop_images([picture], np.zeros(1, np.int64), placement, size, fill=_BLACK)
        center, heat, regression, offsets, *boxes = (each[0] for each in self._session.outputs_of(crop))
        pairs = (*heat.shape, 2)
        heads = Heads(center[..., 0], heat, regression.reshape(pairs), offsets.reshape(pairs), *boxes)
        found = decode(heads, most=_MOST, least=self.least)
        cell, first = _CELL * stride, 0.5 * stride - 0.5
        placed = np.concatenate([cell * found.boxes[:, :2] + first, cell * found.boxes[:, 2:]], axis=1)
        return PeopleInPicture(placed, found.scores, cell * found.keypoints + first, found.keypoint_scores)


def peaks(values: Values, *, most: int, least: float) -> NDArray[np.int64]:
    """Return rows and columns, (n, 2), of the greatest values among their 5 x 5 neighbours, the greatest first."""
    from scipy.ndimage import maximum_filter

    rows, columns = np.nonzero((values == maximum_filter(values, 2 * _REACH + 1, mode="nearest")) & (values >= least))
    order = np.argsort(-values[rows, columns], kind="stable")[:most]
    return np.stack([rows[order], columns[order]], axis=1)


def decode(heads: Heads, *, most: int, least: float) -> PeopleInPicture:
    """Return the people in an input, as MultiPose's own graph does for six.

    One difference: where two people share the cell of a joint, each has its own score of it, not the higher of both.

    Args:
        heads: outputs of the network.
        most: greatest number of people.
        least: least probability of a centre.

    Returns:
        The people; boxes and keypoints in cells, from the middle of the first.
    """
    centres = peaks(heads.centers, most=most, least=least)
    height, width, joints = heads.heatmaps.shape
    row, column = centres.T
    middle = centres + heads.box_offset[row, column]
    half = np.maximum(heads.box_size[row, column], 0.0) / 2
    low, high = (np.clip(each, 0.0, (height, width)) for each in (middle - half, middle + half))
    expected = centres[:, None] + heads.regression[row, column]
    keypoints, scores = np.zeros((len(centres), joints, 2)), np.zeros((len(centres), joints))
    spread = _SPREAD * min(height, width)
    every = np.arange(joints)
    for person in range(len(centres)):
        (top, left), (bottom, right) = np.ceil(low[person]).astype(int), np.ceil(high[person]).astype(int)
        if bottom <= top or right <= left:
            continue
        down = np.exp(-((np.arange(top, bottom)[:, None] - expected[person, :, 0]) ** 2) / spread)
        across = np.exp(-((np.arange(left, right)[:, None] - expected[person, :, 1]) ** 2) / spread)
        weighted = heads.heatmaps[top:bottom, left:right] * (down[:, None] * across[None])
        flat = weighted.reshape(-1, joints)
        best = flat.argmax(axis=0)
        rows, columns = np.divmod(best, right - left)
        cells = np.stack([rows + top, columns + left], axis=1)
        keypoints[person] = (cells + heads.offsets[cells[:, 0], cells[:, 1], every])[:, ::-1]
        scores[person] = flat[best, every]
    counts = scores > _LEAST
    total = heads.centers[row, column] * np.where(counts, scores, 0.0).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)
    boxes = np.concatenate([low[:, ::-1], (high - low)[:, ::-1]], axis=1)
    return PeopleInPicture(boxes, np.minimum(total, 1.0), keypoints, np.clip(scores, 0.0, 1.0))
