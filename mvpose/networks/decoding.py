"""From what a pose head says of crops to places in the images.

Heads are trained with one of three ideas of the input pixel that a cell of their output stands for; see
:attr:`mvpose.networks.card.Card.cells`. Taken for each other they are wrong by up to 2 pixels of the input.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.heatmaps import Heatmaps
from mvpose.networks.crops import Placement

Values = NDArray[np.float32]

_SPACING = 2.0  # pixels of the input between cells of an outer product: SimCC's Gaussians are twice as wide or more


@dataclass(frozen=True)
class Cells:
    """Which pixel of a crop each cell of an output stands for, along one axis: cell k is ``first + step * k``."""

    first: float
    step: float
    count: int

    @classmethod
    def of(cls, convention: str, count: int, extent: int) -> Cells:
        """The cells of an axis that has ``extent`` pixels, by one of the conventions of :class:`Card`."""
        if convention == "span":
            return cls(0.0, (extent - 1) / max(count - 1, 1), count)
        step = extent / count
        return cls(0.5 * (step - 1.0) if convention == "area" else 0.0, step, count)

    @property
    def middle(self) -> float:
        """The pixel halfway between the first cell and the last: the mirror of a flip test."""
        return self.first + 0.5 * self.step * (self.count - 1)


def in_image(values: Values, placement: Placement, columns: Cells, rows: Cells) -> Heatmaps:
    """Heat maps of crops, (m, J, h, w) with 1 at a sure peak, where the crops lie; what is negative becomes 0."""
    first, step = np.array([columns.first, rows.first]), np.array([columns.step, rows.step])
    return Heatmaps(np.maximum(values, 0.0), placement.origin + placement.stride * first, placement.stride * step)


def simcc_modes(x: Values, y: Values, placement: Placement, columns: Cells, rows: Cells) -> tuple[Floats, Floats]:
    """Keypoints, (m, J, 2), and their heights, (m, J), of SimCC vectors (m, J, Wx) and (m, J, Wy).

    The peak of each vector is found between its bins as that of a heat map one cell wide; the lower of the two is the
    height, as RTMPose's code has it.
    """
    across, height_x = in_image(x[:, :, None, :], placement, columns, Cells(0.0, 1.0, 1)).modes(1)
    down, height_y = in_image(y[:, :, :, None], placement, Cells(0.0, 1.0, 1), rows).modes(1)
    keypoints = np.stack([across[:, :, 0, 0], down[:, :, 0, 1]], axis=2)
    return keypoints, np.minimum(height_x, height_y)[:, :, 0]


def outer_product(x: Values, y: Values, placement: Placement, columns: Cells, rows: Cells) -> Heatmaps:
    """SimCC vectors as heat maps, at every second pixel of the input or so.

    Their products have the height of the lower of the two peaks at the place of both. A pair of vectors cannot say
    which of two peaks in x belongs to which in y: of two candidates the product shows four.
    """
    x, y = np.maximum(x, 0.0), np.maximum(y, 0.0)
    every_x, every_y = (max(1, round(_SPACING / cells.step)) for cells in (columns, rows))
    higher = np.maximum(x.max(axis=2), y.max(axis=2))[:, :, None, None]
    x, y = x[:, :, ::every_x], y[:, :, ::every_y]
    product: Values = np.einsum("mjy,mjx->mjyx", y, x)
    product /= np.where(higher > 0, higher, 1.0)
    thinned = (
        Cells(columns.first, columns.step * every_x, x.shape[2]),
        Cells(rows.first, rows.step * every_y, y.shape[2]),
    )
    return in_image(product, placement, *thinned)
