"""Panorama: what pictures show in directions in which there is no surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mvpose.checks import as_array


@dataclass(frozen=True, eq=False)
class Panorama:
    """Surroundings that are infinitely far away: the sky, and land on the horizon.

    It lights nothing (that is the sky of :class:`~simharness.types.light_sources.LightSources`), and pixels that show
    it have neither depth nor id.

    Attributes:
        draw: function that returns the picture, sRGB, (h, w, 3) uint8: the azimuth grows with the column, from that of
            -x counter-clockwise as seen from above once around, the elevation falls with the row from the zenith to
            ``lowest``. It is called when a picture first shows the panorama.
        emission: radiance that white in this picture stands for, linear RGB.
        lowest: elevation of the lower edge, radians; below it, directions show the lowest row.

    Raises:
        ValueError: a lower edge that is not below the zenith, or a picture of another shape or type.
    """

    draw: Callable[[], NDArray[np.uint8]]
    emission: tuple[float, float, float] = (1.0, 1.0, 1.0)
    lowest: float = -np.pi / 2

    def __post_init__(self) -> None:
        if not -np.pi / 2 <= self.lowest < np.pi / 2:
            raise ValueError(
                f"the lower edge of a panorama must be from -pi / 2 to below pi / 2, got lowest = {self.lowest:g}"
            )

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """The picture, (h, w, 3) uint8."""
        return as_array(self.draw(), ("h", "w", 3), "panorama picture", np.uint8)

    def places(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return column and row of directions (..., 3) in the picture, (..., 2); integers are centres of pixels."""
        height, width = self.picture.shape[:2]
        x, y, z = np.moveaxis(np.asarray(directions, float), -1, 0)
        column = (np.arctan2(y, x) / (2 * np.pi) + 0.5) * width - 0.5
        row = (np.pi / 2 - np.arctan2(z, np.hypot(x, y))) / (np.pi / 2 - self.lowest) * height - 0.5
        return np.stack([column, row], axis=-1)


def directions(shape: tuple[int, int], lowest: float) -> NDArray[np.float64]:
    """Return the unit vectors to the centres of the pixels of a panorama of a shape (h, w), (h, w, 3)."""
    rows, columns = shape
    azimuth = ((np.arange(columns) + 0.5) / columns - 0.5) * 2 * np.pi
    elevation = np.pi / 2 - (np.arange(rows) + 0.5) / rows * (np.pi / 2 - lowest)
    across = np.cos(elevation)[:, None]
    up = np.broadcast_to(np.sin(elevation)[:, None], shape)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), up], axis=-1)
