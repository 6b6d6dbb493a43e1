"""Darkening of pixels in the shadows of moving bodies."""

from __future__ import annotations

import numpy as np
import pytest

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
    below = blocks_below(triangle, inverse_depth, view, origin, 8 * cell, (blocks, blocks))
    rgb = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    dim(drawn, below, view, ShadowLayers(origin, cell, fine, coarse, HEIGHTS, touched), dimming(), rgb)
    x = center[0] + (3.0 - height) * (np.arange(WIDTH) - 39.5) / 70.0
    dark, edge = dimming()[64, 200], 2 * cell
    assert (rgb[:, x < -edge] == 200).all()
    assert (rgb[2:, x > edge] == dark).all()
    assert (rgb[:2] == 200).all()
    assert dark < 200


def test_pixels_lie_over_the_block_of_their_point_below_the_highest_map():
    """Rays down from a camera 3 m up that meet surfaces of any height, some of them outside of the map."""
    rng = np.random.default_rng(4)
    rays, center = np.linalg.inv(P[:, :3]) * [[1], [-1], [-1]], np.array([0.2, -0.1, 3.0])
    height = rng.uniform(-0.2, 2.4, (HEIGHT, WIDTH))
    inverse_depth = (1.0 / (3.0 - height)).astype(np.float32)
    triangle = rng.integers(-1, 4, (HEIGHT, WIDTH)).astype(np.int32)
    inverse_depth[triangle < 0] = 0.0
    corner, side, shape = np.array([-0.83, -0.71]), 0.21, (5, 9)
    below = blocks_below(triangle, inverse_depth, PixelRays(center, rays), corner, side, shape)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    away = 3.0 - height
    column = (center[0] + away * (x - 39.5) / 70.0 - corner[0]) / side
    row = (center[1] - away * (y - 29.5) / 70.0 - corner[1]) / side
    inside = (triangle >= 0) & (height < HEIGHTS[-1]) & (row > 0) & (row < 5) & (column > 0) & (column < 9)
    plain = np.where(inside, 9 * np.floor(row) + np.floor(column), 45)
    sure = (np.abs(row - np.rint(row)) > 2e-3) & (np.abs(column - np.rint(column)) > 2e-3)  # not at a border
    assert sure.mean() > 0.98
    assert 0.1 < inside.mean() < 0.6
    np.testing.assert_array_equal(below[sure], plain[sure])


def test_walls_on_the_border_of_the_map_belong_to_it():
    """Points a hair outside of the four sides."""
    rays, center = np.linalg.inv(P[:, :3]) * [[1], [-1], [-1]], np.array([0.0, 0.0, 3.0])
    triangle, inverse_depth = np.zeros((HEIGHT, WIDTH), np.int32), np.full((HEIGHT, WIDTH), 1 / 3, np.float32)
    ends = np.array([[-39.5, 39.5], [-29.5, 29.5]]) * 3.0 / 70.0 * (1 - 1e-6)  # of what the picture shows
    size = (ends[:, 1] - ends[:, 0]) / (8, 6)
    for side in size:
        count = (int(np.rint((ends[1, 1] - ends[1, 0]) / side)), int(np.rint((ends[0, 1] - ends[0, 0]) / side)))
        below = blocks_below(triangle, inverse_depth, PixelRays(center, rays), ends[:, 0], side, count)
        if side == size[0]:
            assert (below[HEIGHT // 2, [0, -1]] % count[1]).tolist() == [0, count[1] - 1]
        else:
            assert (below[[0, -1], WIDTH // 2] // count[1]).tolist() == [count[0] - 1, 0]
