"""What a camera sees of the meshes that stay where they are: drawn once for a camera that stays too."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering.room_light import RoomLight
from simharness.capture.rendering.shadow_maps import LightView
from simharness.types.lighting import Lighting

MOST_BYTES = 384 * 2**20
"""Bytes of the backgrounds that are kept; the one that was not used for the longest time is dropped first."""


_BYTES_PER_PIXEL = 4 + 4 + 4 + 2 + 3 + 2 + 4


@dataclass(frozen=True)
class LitBackground:
    """Picture of the still meshes in one light.

    Attributes:
        lighting: the light.
        light: what the shadow maps cover, or the light of the sources.
        rgb: picture without the shadows of anything that moves, (h, w, 3) uint8.
        shadow_place: place of each pixel in the shadow maps, (h, w) uint16: see
            :func:`~simharness.capture.rendering.shadow_maps.shadow_places`; empty with sources.
        shadow_depth: inverse depth of each pixel from the light, (h, w) float32; empty with sources.
        runs: runs of pixels over the blocks of :class:`~simharness.capture.rendering.lit_scene.Grid`, (n, 5): see
            :func:`~simharness.capture.rendering.moving_shadows.runs_below`; empty without sources.
    """

    lighting: Lighting
    light: LightView | RoomLight
    rgb: NDArray[np.uint8]
    shadow_place: NDArray[np.uint16]
    shadow_depth: NDArray[np.float32]
    runs: NDArray[np.int32]


@dataclass
class Background:
    """Picture of the still meshes.

    Attributes:
        to_rays: matrix, (3, 3), such that ``center + depth * to_rays @ (x, y, 1)`` is the point at a pixel.
        inverse_depth: inverse depth, 1/m, (h, w) float32; 0 without a surface.
        triangle: visible face, (h, w) int32; -1 without a surface.
        corners: homogeneous pixel coordinates of the vertices, (n, 3).
        depth: depth, metres, (h, w) float32; +inf without a surface.
        labels: what the faces are labelled with, (k + 1,): see
            :attr:`~simharness.capture.rendering.scene_topology.SceneTopology.mesh`.
        ids: label of each pixel, (h, w).
        lit: the same in the light of the latest request.
    """

    to_rays: NDArray[np.float64]
    inverse_depth: NDArray[np.float32]
    triangle: NDArray[np.int32]
    corners: NDArray[np.float64]
    depth: NDArray[np.float32]
    labels: NDArray[np.int16]
    ids: NDArray[np.int16]
    lit: LitBackground | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of memory, with those of colours, whether they were requested or not."""
        return self.corners.nbytes + _BYTES_PER_PIXEL * self.triangle.size


class Backgrounds:
    """Backgrounds of one scene, by the projection and the size of the camera; within a limit of memory."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[bytes, tuple[int, int]], Background] = OrderedDict()

    def find(self, projection: NDArray[np.float64], size: tuple[int, int]) -> Background | None:
        """Return the background of a camera, or None if it is not kept."""
        key = projection.tobytes(), size
        if key in self._kept:
            self._kept.move_to_end(key)
        return self._kept.get(key)

    def keep(self, projection: NDArray[np.float64], size: tuple[int, int], background: Background) -> None:
        """Keep a background, and drop others where they need too much memory together."""
        self._kept[projection.tobytes(), size] = background
        while len(self._kept) > 1 and sum(each.nbytes for each in self._kept.values()) > MOST_BYTES:
            self._kept.popitem(last=False)
