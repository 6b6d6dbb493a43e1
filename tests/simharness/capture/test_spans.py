"""Spans of pixels around moving meshes, and darkening by runs of pixels: against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.capture.rendering.shaded_pixels import BlockGrid, ShadowLayers, dim, runs_below
from simharness.capture.rendering.surface_kernels import PixelRays
from simharness.capture.rendering.tone import dimming
from simharness.capture.rendering.vertex_kernels import (
    copied_pixels,
    covering_spans,
    project_vertices,
    restore_pixels,
)

HEIGHT, WIDTH = 60, 80
P = np.array([[70.0, 0.0, 39.5, 0.0], [0.0, 70.0, 29.5, 0.0], [0.0, 0.0, 1.0, 0.0]])


def spans_around(vertices, starts):
    """Return the spans around meshes in front of a camera at the origin, and the pixels of their vertices."""
    q, _, codes = project_vertices(vertices.astype(np.float32), P, 0.05, np.zeros((0, 3)), WIDTH, HEIGHT)
    return covering_spans(codes, np.array(starts), HEIGHT, WIDTH), q[:, :2] / q[:, 2:]


def mask_of(spans):
    mask = np.zeros((HEIGHT, WIDTH), int)
    for y, first, end in spans:
        mask[y, first:end] += 1
    return mask


@pytest.mark.parametrize("seed", range(5))
def test_spans_cover_the_boxes_around_meshes_once(seed):
    rng = np.random.default_rng(seed)
    middles = np.column_stack([rng.uniform(-1.5, 1.5, (6, 2)), rng.uniform(2, 4, 6)])
    vertices = (middles[:, None] + rng.uniform(-0.3, 0.3, (6, 10, 3))).reshape(-1, 3)
    spans, pixels = spans_around(vertices, range(0, 61, 10))
    expected = np.zeros((HEIGHT, WIDTH), int)
    for place in pixels.reshape(6, 10, 2):
        low, end = np.ceil(place.min(axis=0)).clip(0).astype(int), np.floor(place.max(axis=0) + 1).clip(0).astype(int)
        expected[low[1] : end[1], low[0] : end[0]] = 1
    np.testing.assert_array_equal(mask_of(spans), expected)
    assert sorted(map(tuple, spans)) == list(map(tuple, spans))


def test_a_mesh_behind_the_camera_has_no_pixels_and_one_across_the_near_plane_may_have_all():
    behind = np.array([[0.0, 0.0, -1.0], [0.1, 0.0, -2.0]])
    assert not len(spans_around(behind, [0, 2])[0])
    across = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, -1.0]])
    assert (mask_of(spans_around(across, [0, 2])[0]) == 1).all()


def test_copied_pixels_are_restored():
    rng = np.random.default_rng(3)
    depth, face = rng.random((HEIGHT, WIDTH)).astype(np.float32), rng.integers(0, 99, (HEIGHT, WIDTH), np.int32)
    spans = np.array([[3, 5, 70], [4, 0, 80], [4, 79, 80], [59, 10, 11]], np.int32)
    kept = copied_pixels(spans, depth, face)
    before = depth.copy(), face.copy()
    for y, first, end in spans:
        depth[y, first:end], face[y, first:end] = -1, -1
    restore_pixels(spans, *kept, depth, face)
    np.testing.assert_array_equal(depth, before[0])
    np.testing.assert_array_equal(face, before[1])


@pytest.mark.parametrize("height", [0.0, 0.7], ids=["floor", "table"])
def test_pixels_are_darkened_by_what_the_map_leaves_where_they_lie(height):
    """A camera looks straight down on a plane under a map that is dark in one half."""
    rays, center = np.linalg.inv(P[:, :3]) * [[1], [-1], [-1]], np.array([0.2, -0.1, 3.0])
    inverse_depth = np.full((HEIGHT, WIDTH), 1 / (3.0 - height), np.float32)
    cell, origin, blocks = 0.1, np.array([-2.4, -2.4]), 6
    fine = np.ones((48, 48), np.float32)
    fine[:, 24:] = 0.5
    coarse = np.broadcast_to(fine[::2, ::2], (4, 24, 24)).copy()
    touched = np.append(np.repeat([False, True], 3)[None].repeat(blocks, 0).ravel(), False)
    view, grid = PixelRays(center, rays), BlockGrid(origin, 8 * cell, blocks, blocks)
    runs = runs_below(np.zeros((HEIGHT, WIDTH), np.int32), inverse_depth, view, grid, 1.9)
    rgb = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    heights = np.array([0.0, 0.5, 1.1, 1.9], np.float32)
    dim(inverse_depth, runs, view, ShadowLayers(origin, cell, fine, coarse, heights, touched), dimming(), rgb)
    x = center[0] + (3.0 - height) * (np.arange(WIDTH) - 39.5) / 70.0
    dark, edge = dimming()[64, 200], 2 * cell
    assert (rgb[:, x < -edge] == 200).all()
    assert (rgb[:, x > edge] == dark).all()
    assert dark < 200
