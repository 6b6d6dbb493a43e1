"""What a camera sees behind the meshes that move: the meshes that stay where they are, and pixels without a surface.

It is drawn once for a camera that stays too. So NumPy is fast enough for the pixels without a surface, which show the
background colour of the lighting or its panorama, and nothing is compiled for them.
"""

from collections import OrderedDict
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from simharness.capture.rendering import tone
from simharness.capture.rendering.room_light import RoomLight
from simharness.capture.rendering.shadow_maps import LightView
from simharness.types.lighting import Lighting
from simharness.types.srgb import from_linear, to_linear

MOST_BYTES = 384 * 2**20
"""Bytes of the backgrounds that are kept."""


@dataclass(frozen=True)
class LitBackground:
    """Picture of the still meshes in one light."""

    lighting: Lighting
    """The light."""
    light: LightView | RoomLight
    """What the shadow maps cover, or the light of the sources."""
    rgb: NDArray[np.uint8]
    """Picture without the shadows of anything that moves, (h, w, 3) uint8."""
    shadow_place: NDArray[np.uint16]
    """Place of each pixel in the shadow maps, (h, w) uint16: see
    :func:`~simharness.capture.rendering.shadow_maps.shadow_places`; with sources, the block of the map of the floor:
    see :func:`~simharness.capture.rendering.shaded_pixels.blocks_below`."""
    shadow_depth: NDArray[np.float32]
    """Inverse depth of each pixel from the light, (h, w) float32; empty with sources."""


@dataclass
class Background:
    """Picture of the still meshes."""

    to_rays: NDArray[np.float64]
    """Matrix, (3, 3), such that ``center + depth * to_rays @ (x, y, 1)`` is the point at a pixel."""
    inverse_depth: NDArray[np.float32]
    """Inverse depth, 1/m, (h, w) float32; 0 without a surface."""
    triangle: NDArray[np.int32]
    """Visible face, (h, w) int32; -1 without a surface."""
    corners: NDArray[np.float64]
    """Homogeneous pixel coordinates of the vertices, (n, 3)."""
    lit: LitBackground | None = None
    """The same in the light of the latest request."""
    used: int = 0
    """Number of the latest request, of all requests to the scene."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory, with those of colours, whether they were requested or not."""
        count = self.inverse_depth.nbytes + self.triangle.nbytes + self.corners.nbytes
        if self.lit is not None:
            count += self.lit.shadow_place.nbytes + self.lit.shadow_depth.nbytes
        return count + 3 * self.triangle.size


class Backgrounds:
    """Backgrounds of one scene, by the projection and the size of the camera; within a limit of memory.

    Cameras take turns. Where not all of them fit, the newest gives way to the next: if the oldest did, each would be
    dropped just before its turn. One that two rounds did not need, of a camera that has moved on, goes first.
    """

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[bytes, tuple[int, int]], Background] = OrderedDict()
        self._requests = 0

    def find(self, projection: NDArray[np.float64], size: tuple[int, int]) -> Background | None:
        """Return the background of a camera, or None if it is not kept."""
        key = projection.tobytes(), size
        self._requests += 1
        found = self._kept.get(key)
        if found is not None:
            self._kept.move_to_end(key)
            found.used = self._requests
        return found

    def keep(self, projection: NDArray[np.float64], size: tuple[int, int], background: Background) -> None:
        """Keep a background, and drop others where they need too much memory together."""
        background.used = self._requests
        while self._kept and background.nbytes + sum(each.nbytes for each in self._kept.values()) > MOST_BYTES:
            oldest = next(iter(self._kept.values()))
            self._kept.popitem(last=self._requests - oldest.used <= 2 * (len(self._kept) + 1))
        self._kept[projection.tobytes(), size] = background


_COLUMNS = 1024  # pixels that are looked up in one row: OpenCV takes no rows of whole pictures


def fill_empty(
    rgb: NDArray[np.uint8],
    empty: NDArray[np.bool_],
    lighting: Lighting,
    rays: NDArray[np.float64],
    exposure: ArrayLike = (1.0, 1.0, 1.0),
) -> None:
    """Colour the pixels of a picture that show no surface, in place.

    Args:
        rgb: picture to change, (h, w, 3) uint8.
        empty: pixels without a surface, (h, w).
        lighting: lighting of the scene.
        rays: matrix (3, 3) that turns pixels (x, y, 1) into directions.
        exposure: factor of the radiance of the panorama.
    """
    panorama = lighting.panorama
    if panorama is None:
        rgb[empty] = np.round(255 * np.array(lighting.background)).astype(np.uint8)
        return
    row, column = np.nonzero(empty)
    if not len(row):
        return
    ways = column[:, None] * rays[:, 0] + row[:, None] * rays[:, 1] + rays[:, 2]
    if lighting.mirror is not None:
        normal = np.array(lighting.mirror.normal)
        ways -= 2 * (ways @ normal)[:, None] * normal
    light = to_linear(np.arange(256))[:, None] * np.asarray(exposure, float) * panorama.emission
    shown = np.round(from_linear(tone.tone(light))).astype(np.uint8)
    rgb[empty] = cv2.LUT(_found(panorama.picture, panorama.places(ways))[None], shown[None])[0]


def _found(picture: NDArray[np.uint8], places: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of a panorama at columns and rows (n, 2), bilinear."""
    spare = -len(places) % _COLUMNS
    column, row = np.pad(places, ((0, spare), (0, 0))).astype(np.float32).T.reshape(2, -1, _COLUMNS)
    row = np.clip(row, 0, len(picture) - 1)
    colors = np.empty((*row.shape, 3), np.uint8)
    for k in range(len(row)):
        around = cv2.remap(picture, column[k : k + 1], row[k : k + 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        colors[k] = around[0]
    return colors.reshape(-1, 3)[: len(places)]
