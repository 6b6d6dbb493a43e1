"""Decoding of pose head outputs to positions in the images.

Heads are trained with one of three conventions for the input pixel of an output cell; see
``cells`` of :class:`mvpose.networks.card.Card`. The wrong convention causes errors of up to 2 pixels of the input.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Floats
from mvpose.heatmaps import Heatmaps
from mvpose.networks.crops import Placement

Values = NDArray[np.float32]

_SPACING = 2.0  # input pixels between cells of an outer product; Gaussians of SimCC are at least twice as wide


@dataclass(frozen=True)
class Cells:
    """Crop pixels of the cells of an output along one axis: cell k is at pixel ``first + step * k``."""

    first: float
    step: float
    count: int

    @classmethod
    def from_convention(cls, convention: str, count: int, extent: int) -> Cells:
        """Create the cells of an axis of ``extent`` pixels by a convention of ``Card.cells``."""
        if convention == "span":
            return cls(0.0, (extent - 1) / max(count - 1, 1), count)
        step = extent / count
        return cls(0.5 * (step - 1.0) if convention == "area" else 0.0, step, count)

    @property
    def middle(self) -> float:
        """Pixel halfway between the first and the last cell, the mirror axis of the flip test."""
        return self.first + 0.5 * self.step * (self.count - 1)


def placed_heatmaps(values: Values, placement: Placement, columns: Cells, rows: Cells) -> Heatmaps:
    """Place heat maps of crops, (m, J, h, w) with confident peaks of 1, in the images; negative values become 0."""
    first, step = np.array([columns.first, rows.first]), np.array([columns.step, rows.step])
    return Heatmaps(np.maximum(values, 0.0), placement.origin + placement.stride * first, placement.stride * step)


def simcc_modes(x: Values, y: Values, placement: Placement, columns: Cells, rows: Cells) -> tuple[Floats, Floats]:
    """Return keypoints, (m, J, 2), and heights, (m, J), from SimCC vectors (m, J, Wx) and (m, J, Wy).

    The peak of each vector is found at sub-bin accuracy, as that of a heat map one cell wide. The height is the lower
    of the two peaks, as in the code of RTMPose.
    """
    across, height_x = placed_heatmaps(x[:, :, None, :], placement, columns, Cells(0.0, 1.0, 1)).modes(1)
    down, height_y = placed_heatmaps(y[:, :, :, None], placement, Cells(0.0, 1.0, 1), rows).modes(1)
    keypoints = np.stack([across[:, :, 0, 0], down[:, :, 0, 1]], axis=2)
    return keypoints, np.minimum(height_x, height_y)[:, :, 0]


def outer_product(x: Values, y: Values, placement: Placement, columns: Cells, rows: Cells) -> Heatmaps:
    """Convert SimCC vectors to heat maps with cells about two input pixels apart.

    The product of two vectors has the height of the lower of the two peaks at their position. A pair of vectors does
    not determine which of two peaks in x belongs to which in y, so two candidates give four peaks in the product.
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
    return placed_heatmaps(product, placement, *thinned)
