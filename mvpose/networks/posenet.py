"""Heat maps of PoseNet (PersonLab: Papandreou et al., ECCV 2018): cells that vote for the places of joints.

A cell of the network, one for 16 pixels, has for each joint the probability that it is near, and the offset of its
place. Every cell votes for the place that it names, with its probability; the votes on a grid four times as fine are
the heat maps, scaled so that the peak of each has the greatest probability of its joint.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mvpose.networks.crops import Images, Placement, crop_images
from mvpose.networks.pose import Cells, PoseHead
from mvpose.networks.session import Session

Values = NDArray[np.float32]

_FINER = 4  # cells of a heat map for one of the network
_BLUR = 1.0  # standard deviation, cells of a heat map: of the scatter of votes
_BLACK = (0, 0, 0)


class PoseNet(PoseHead):
    """Pose head of PoseNet in an ONNX file, as ``mvpose networks get posenet`` stores it.

    Args:
        model: ONNX file, or its session.
        likelihoods: whether detections carry the heat maps.

    Raises:
        ValueError: as for :class:`mvpose.networks.PoseHead`.
    """

    name = "posenet"
    """Name on the card of its file."""

    def __init__(self, model: str | Path | Session, *, likelihoods: bool = True) -> None:
        super().__init__(model, likelihoods=likelihoods)

    def _read_outputs(self) -> None:
        self.simcc = False
        joints, (width, height) = len(self.skeleton), self.session.size
        heat, offsets = self.session.shapes if len(self.session.shapes) == 2 else ((), ())
        if len(heat) != 3 or heat[2] != joints or offsets != (*heat[:2], 2 * joints):
            self._refuse(
                f"outputs must be heat maps (n, h, w, {joints}) and offsets (n, h, w, {2 * joints}), got "
                f"{self.session.shapes}"
            )
        rows, columns = (_FINER * (count - 1) + 1 for count in heat[:2])
        self._columns = Cells.from_convention(self.session.card.cells, columns, width)
        self._rows = Cells.from_convention(self.session.card.cells, rows, height)

    def _outputs(self, images: Images, view: NDArray[np.int64], placement: Placement) -> list[Values]:
        heat, offsets = self.session(crop_images(images, view, placement, self.session.size, fill=_BLACK))
        pairs = offsets.reshape(*heat.shape[:3], 2, heat.shape[3])  # rows, then columns
        return [votes(heat, np.moveaxis(pairs, 3, 4) / (self._rows.step, self._columns.step))]


def votes(heat: Values, offsets: Values) -> Values:
    """Return heat maps, (m, J, 4 h - 3, 4 w - 3), of the votes of cells.

    Args:
        heat: probability that a joint is near each cell, (m, h, w, J).
        offsets: its place from the cell, rows and columns, (m, h, w, J, 2), in cells of the result.
    """
    from scipy.ndimage import gaussian_filter

    m, h, w, joints = heat.shape
    shape = _FINER * (h - 1) + 1, _FINER * (w - 1) + 1
    cells = np.stack(np.meshgrid(np.arange(h), np.arange(w), indexing="ij"), axis=-1)[None, :, :, None]
    place = _FINER * cells + offsets
    whole = np.floor(place).astype(np.int64)
    share = place - whole
    counted = np.zeros((m, joints, *shape))
    where = np.broadcast_arrays(np.arange(m)[:, None, None, None], np.arange(joints), heat)[:2]
    for down in (0, 1):
        for across in (0, 1):
            row, column = whole[..., 0] + down, whole[..., 1] + across
            weight = heat * np.abs(1 - down - share[..., 0]) * np.abs(1 - across - share[..., 1])
            inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
            np.add.at(counted, (*(each[inside] for each in where), row[inside], column[inside]), weight[inside])
    counted = gaussian_filter(counted, (0, 0, _BLUR, _BLUR), mode="constant")
    highest = counted.max(axis=(2, 3), keepdims=True)
    most = heat.max(axis=(1, 2))[:, :, None, None]
    return (counted * (most / np.where(highest > 0, highest, 1.0))).astype(np.float32)
