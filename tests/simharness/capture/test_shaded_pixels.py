"""Darkening of pixels in the shadows of moving bodies."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.capture.rendering.backgrounds import Background
from simharness.capture.rendering.shaded_pixels import HEIGHTS, ShadowLayers, blocks_below, dim
from simharness.capture.rendering.surface_kernels import DrawnPixels, PixelRays
from simharness.capture.rendering.tone import dimming

HEIGHT, WIDTH = 60, 80
P = np.array([[70.0, 0.0, 39.5, 0.0], [0.0, 70.0, 29.5, 0.0], [0.0, 0.0, 1.0, 0.0]])


@pytest.mark.parametrize("height", [0.0, 0.7], ids=["floor", "table"])
def test_pixels_are_darkened_by_what_the_map_leaves_where_they_lie(height):
    """A camera looks straight down on a plane under a map that is dark in one half."""
    rays, center = np.linalg.inv(P[:, :3]) * [[1], [-1], [-1]], np.array([0.2, -0.1, 3.0])
    inverse_depth = np.full((HEIGHT, WIDTH), 1 / (3.0 - height), np.float32)
    cell, origin, blocks = 0.1, np.array([-2.4, -2.4]), 6
    fine = np.ones((48, 48), np.float32)
    fine[:, 24:] = 0.5
    coarse = np.broadcast_to(fine[::2, ::2], (4, 24, 24)).copy()
    touched = np.repeat([False, True], 3)[None].repeat(blocks, 0)
    triangle = np.zeros((HEIGHT, WIDTH), np.int32)
    triangle[:2] = -1  # nothing is seen
    drawn, view = DrawnPixels(triangle, inverse_depth, np.zeros((0, 3))), PixelRays(center, rays)
    below = blocks_below(
        Background(rays, inverse_depth, triangle, drawn.corners), view, origin, 8 * cell, (blocks, blocks)
    )
    rgb = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    dim(drawn, below, view, ShadowLayers(origin, cell, fine, coarse, HEIGHTS, touched), dimming(), rgb)
    x = center[0] + (3.0 - height) * (np.arange(WIDTH) - 39.5) / 70.0
    dark, edge = dimming()[64, 200], 2 * cell
    assert (rgb[:, x < -edge] == 200).all()
    assert (rgb[2:, x > edge] == dark).all()
    assert (rgb[:2] == 200).all()
    assert dark < 200
