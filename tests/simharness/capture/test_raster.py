"""The rasteriser alone: exactness, against brute force; watertightness; shading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_shapes import _mesh, ball, box, crowd, sheet
from test_renderers import VIEWS, axis_rays, camera_at

from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.rendering.renderer import NEAR


def brute_force(camera, corners):
    """Return depth and index of the nearest triangle (k, 3, 3) along the ray of every pixel, by Möller and Trumbore."""
    rays = axis_rays(camera)[..., None, :]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    h = np.cross(rays, v)
    s = camera.center - a
    q = np.cross(s, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = 1 / (h * u).sum(-1)
        alpha, beta, depth = f * (h * s).sum(-1), f * (rays * q).sum(-1), f * (q * v).sum(-1)
    hit = (alpha >= 0) & (beta >= 0) & (alpha + beta <= 1) & (depth >= NEAR)
    depth = np.where(hit, depth, np.inf)
    return depth.min(axis=-1), np.where(hit.any(axis=-1), depth.argmin(axis=-1), -1)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.05, 0.5, 5.0]))
def test_random_triangles_match_brute_force(seed, size):
    """Of all sizes, in front, behind, around and across the camera's plane."""
    rng = np.random.default_rng(seed)
    camera = camera_at((1.0, 0.5, 0.8), (0.0, 0.0, 1.0), size=(48, 36), fov=80.0)
    corners = (rng.uniform(-1.5, 1.5, (30, 1, 3)) + size * rng.normal(size=(30, 3, 3))).astype(np.float32)
    meshes = [_mesh(triangle, [(0, 1, 2)], (0.5, 0.5, 0.5)) for triangle in corners]
    image = RasterRenderer().render(camera, meshes, color=False)
    depth, index = brute_force(camera, corners.astype(float))
    np.testing.assert_array_equal(image.ids, index)
    np.testing.assert_allclose(image.depth, depth, rtol=2e-7)


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("away", [1.01, 1.5, 1.99, 2.01, 2.5])
def test_small_triangles_before_a_wall_are_seen_and_those_behind_it_are_not(away, turned):
    """From both sides; what stays where it is is drawn first."""
    camera, wall = camera_at((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), size=(48, 36), fov=60.0), 2.0
    far = replace(sheet([(wall, y, z) for y, z in ((3, 3), (-3, 3), (-3, -3), (3, -3))]), still=True)
    y, z = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 200, 1))
    corners = np.stack([y + [0, 0.1, 0], z + [0, 0, 0.1], np.full((200, 3), away)], -1)[..., [2, 0, 1]]
    near = _mesh(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3)[:, ::turned], (0.5, 0.5, 0.5))
    image = RasterRenderer().render(camera, [far, near], color=False)
    depth, index = brute_force(camera, np.concatenate([far.vertices[far.faces], np.float32(corners)]).astype(float))
    np.testing.assert_array_equal(image.ids, index >= 2)
    np.testing.assert_allclose(image.depth, depth, rtol=3e-7)
    assert (image.ids == 1).any() == (away < wall)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_pixel_falls_between_triangles(seed):
    """A crumpled sheet of many triangles that fills the image leaves no hole, for random vertices."""
    rng = np.random.default_rng(seed)
    camera = camera_at((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), size=(64, 48), fov=60.0)
    n = 24
    y, z = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n), indexing="ij")
    y[1:-1, 1:-1] += rng.uniform(-0.05, 0.05, (n - 2, n - 2))
    z[1:-1, 1:-1] += rng.uniform(-0.05, 0.05, (n - 2, n - 2))
    i, j = np.meshgrid(np.arange(n - 1), np.arange(n - 1), indexing="ij")
    k = (i * n + j).ravel()
    faces = np.concatenate([np.stack([k, k + n, k + n + 1], -1), np.stack([k, k + n + 1, k + 1], -1)])
    cloth = _mesh(np.stack([2 + 0 * y, y, z], -1).reshape(-1, 3), faces, (0.5, 0.5, 0.5))
    assert (RasterRenderer().render(camera, [cloth], color=False).ids == 0).all()


def test_edges_through_pixel_centres_leave_no_hole():
    """The worst case for a fill rule: every vertex of the sheet projects onto the centre of a pixel."""
    camera = camera_at((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), size=(65, 49), fov=60.0)
    columns, rows = np.meshgrid(np.arange(-4, 73, 4.0), np.arange(-4, 57, 4.0), indexing="ij")
    rays = camera.rays(np.stack([columns, rows], -1))
    points = 2 * rays / rays[..., :1]
    n, m = columns.shape
    i, j = np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij")
    k = (i * m + j).ravel()
    faces = np.concatenate([np.stack([k, k + m, k + m + 1], -1), np.stack([k, k + m + 1, k + 1], -1)])
    image = RasterRenderer().render(camera, [_mesh(points.reshape(-1, 3), faces, (0.5, 0.5, 0.5))], color=False)
    assert (image.ids == 0).all()
    np.testing.assert_allclose(image.depth, 2.0, rtol=1e-6)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), detail=st.sampled_from([2, 5, 9]), inside=st.booleans(), turned=st.booleans())
def test_crumpled_closed_bodies_match_brute_force(seed, detail, inside, turned):
    """Half of their triangles are seen from behind: hidden unless the camera is inside or a body is inside out."""
    rng = np.random.default_rng(seed)
    smooth = ball((0.0, 0.0, 0.0), 1.0, rings=detail)
    shape = smooth.vertices * (1 + 0.6 * rng.uniform(-1, 1, (len(smooth.vertices), 1)))
    bodies = [np.float32(shape * rng.uniform(0.1, 0.6) + rng.uniform(-0.5, 0.5, 3)) for _ in range(2)]
    eye = bodies[0].mean(axis=0) if inside else (2.0, 0.3, 0.4)
    camera = camera_at(eye, bodies[1].mean(axis=0), size=(40, 30), fov=70.0)
    faces = smooth.faces[:, ::-1] if turned else smooth.faces
    corners = np.concatenate([body[faces] for body in bodies]).astype(float)
    meshes = [_mesh(body, faces, (0.5, 0.5, 0.5)) for body in bodies]
    image = RasterRenderer().render(camera, meshes, color=False)
    depth, index = brute_force(camera, corners)
    np.testing.assert_allclose(image.depth, depth, rtol=3e-7)
    np.testing.assert_array_equal(image.ids, np.where(index < 0, -1, index // len(faces)))


def test_a_picture_that_is_too_wide_is_refused():
    camera = camera_at((1.0, 0.5, 0.8), (0.0, 0.0, 1.0), size=(32767, 1), fov=80.0)
    with pytest.raises(ValueError, match="at most 32766 pixels a side, got 32767 x 1"):
        RasterRenderer().render(camera, [box((0, 0, 1), 1)])


def test_degenerate_triangles_draw_nothing():
    points = [(0, 0, 1), (0, 0, 1), (0, 1, 1), (0, 2, 1)]
    image = RasterRenderer().render(VIEWS[0], [_mesh(points, [(0, 1, 2), (0, 2, 3), (1, 1, 1)], (1, 1, 1))])
    assert (image.ids == -1).all()


def test_objects_cast_shadows_on_the_floor():
    floor = sheet([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], (0.8, 0.8, 0.8))
    camera = camera_at((0.1, 0.0, 9.0), (0.0, 0.0, 0.0), size=(200, 200), fov=40.0)
    empty = RasterRenderer().render(camera, [floor]).rgb.astype(int)
    image = RasterRenderer().render(camera, [floor, box((0, 0, 1.2), (0.6, 0.6, 0.1))])
    darker = (empty - image.rgb).max(axis=-1) > 20
    on_floor = image.ids == 0
    # The shadow of a flat box is as large as the box; part of it lies under the box, out of sight from above.
    pixel = 9.0 / camera.K[0, 0]
    assert 0.05 < (darker & on_floor).sum() * pixel**2 < 0.6**2 * 1.1
    assert np.abs(empty - image.rgb)[~darker & on_floor].max() <= 20


def test_smooth_meshes_have_no_edges_of_faces():
    camera = camera_at((2.0, 0.0, 1.0), (0.0, 0.0, 1.0), size=(200, 200), fov=40.0)
    smooth = ball((0, 0, 1), 0.5, (0.7, 0.7, 0.7), rings=10)
    flat = _mesh(smooth.vertices, smooth.faces, (0.7, 0.7, 0.7))
    middle = np.s_[80:120, 80:120, 0]
    steps = [
        np.abs(np.diff(RasterRenderer().render(camera, [mesh]).rgb[middle].astype(int), axis=1)).max()
        for mesh in (smooth, flat)
    ]
    assert steps[0] <= 3 < steps[1]


def test_rendering_repeats_to_the_byte():
    scene = crowd(16)
    one, other = RasterRenderer().render(VIEWS[1], scene), RasterRenderer().render(VIEWS[1], scene)
    for key in ("rgb", "depth", "ids"):
        assert getattr(one, key).tobytes() == getattr(other, key).tobytes()
