"""Pictures through lenses that bend, against the projection that the method itself uses."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_shapes import ball, box, chequered, crowd, disc
from scipy.ndimage import binary_dilation
from test_renderers import VIEWS, axis_rays, camera_at, pixel_grid, plane_depth

from simharness.capture.rendering.lens import lens_of, through_lens
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.lighting import Lighting

BARREL = (-0.37, 0.15, 0.0, 0.0, 0.0)
WEBCAM = (0.115, -0.219, 0.0012, 0.0086, 0.113)
LENSES = [BARREL, WEBCAM, (0.2, 0.0, -0.004, 0.003, 0.0), (-0.28, 0.07, 0.003, -0.002, 0.01)]


def bent_camera(distortion, *, size=(320, 240), fov=75.0, center=(3.0, -1.0, 2.0), **more):
    camera = camera_at(center, (0.0, 0.3, 0.9), size=size, fov=fov, **more)
    return replace(camera, distortion=np.array(distortion))


@pytest.mark.slow
@pytest.mark.parametrize("distortion", LENSES)
def test_a_dot_is_drawn_at_its_projection(renderer, distortion):
    camera = bent_camera(distortion, size=(640, 480), shift=(4.3, -2.6))
    columns, rows = np.meshgrid(np.linspace(16, 623, 14), np.linspace(16, 463, 11))
    targets = np.stack([columns, rows], axis=-1).reshape(-1, 2) + np.random.default_rng(3).uniform(-3, 3, (154, 2))
    rays = camera.rays(targets)
    places = camera.center + 3.0 * rays
    image = renderer.render(camera, [disc(place, -ray, 0.03) for place, ray in zip(places, rays, strict=True)])
    np.testing.assert_allclose(camera.project(places), targets, atol=1e-6)
    centroids = np.array([np.argwhere(image.ids == k)[:, ::-1].mean(axis=0) for k in range(len(places))])
    error = centroids - targets
    assert np.abs(error.mean(axis=0)).max() < 0.05
    assert np.linalg.norm(error, axis=1).max() < 0.75  # the centroid of a disc of few pixels is inexact
    column, row = np.floor(targets + 0.5).astype(int).T
    np.testing.assert_array_equal(image.ids[row, column], np.arange(len(places)))


@pytest.mark.parametrize("distortion", LENSES)
def test_edges_lie_within_a_pixel(renderer, distortion):
    """The outline of a sphere passes within one pixel of every change of ids."""
    camera = bent_camera(distortion)
    center, radius = np.array([0.2, 0.3, 1.0]), 0.7
    image = renderer.render(camera, [ball(center, radius, rings=120)])
    rays, offset = camera.rays(pixel_grid(camera)), camera.center - center
    inside = (rays @ offset) ** 2 - (offset @ offset - radius**2) > 0
    near = np.zeros_like(inside)  # pixels next to one of the other kind
    padded = np.pad(inside, 1, mode="edge")
    for y in range(3):
        for x in range(3):
            near |= padded[y : y + inside.shape[0], x : x + inside.shape[1]] != inside
    assert 0.05 < inside.mean() < 0.6
    np.testing.assert_array_equal((image.ids == 0)[~near], inside[~near])


@pytest.mark.slow
@pytest.mark.parametrize("distortion", LENSES)
def test_depth_is_that_along_the_own_ray_of_every_pixel(renderer, distortion):
    """Closed form of planes: exact on a floor, and of one of two surfaces where a box stands on it."""
    camera = bent_camera(distortion)
    floor, wall = box((0, 0, -0.05), (30, 30, 0.1)), box((-2.0, 0.0, 1.0), (0.2, 3.0, 2.0))
    expected = plane_depth(camera, (0, 0, 0), (0, 0, 1))
    seen = expected < 8
    assert seen.mean() > 0.3
    np.testing.assert_allclose(renderer.render(camera, [floor]).depth[seen], expected[seen], atol=1e-3)
    depth = renderer.render(camera, [floor, wall]).depth
    faces = [((-1.9, 0, 0), (1, 0, 0)), ((0, 0, 2), (0, 0, 1)), ((0, 1.5, 0), (0, 1, 0)), ((0, -1.5, 0), (0, 1, 0))]
    near, planes = depth < 8, [expected, *(plane_depth(camera, *face) for face in faces)]
    error = np.min([np.abs(depth[near] - each[near]) for each in planes], axis=0)
    assert np.quantile(error, 0.99) < 2e-4
    assert (error < 0.05 * depth[near]).all()  # at an edge the nearest pixel of the pinhole may show the other face
    face_on = replace(camera, R=np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), t=np.array([0, 0, 2.5]))
    np.testing.assert_allclose(renderer.render(face_on, [floor]).depth, 2.5, atol=5e-4)


@pytest.mark.parametrize("distortion", LENSES)
def test_colours_match_the_position_on_the_board(renderer, distortion):
    """A pattern on a board; its distorted picture is computed pixel by pixel."""
    camera = replace(camera_at((-1.6, 0.0, 0.5), (0, 0, 0.5), size=(320, 240)), distortion=np.array(distortion))
    board = chequered((3.0, 2.0), repeat=(2, 2))
    image = renderer.render(camera, [board], lighting=Lighting(key=0, sky=1 / 0.65, fill=0))
    place = camera.center + plane_depth(camera, (0, 0, 0), (1, 0, 0))[..., None] * axis_rays(camera)
    height, width = board.texture.shape[:2]
    column, row = ((1.5 - place[..., 1]) / 1.5 % 1) * width, ((2.0 - place[..., 2]) / 1.0 % 1) * height
    inner = (image.ids == 0) & (np.abs(column % 8 - 4) < 2.5) & (np.abs(row % 8 - 4) < 2.5)
    inner &= (np.abs(place[..., 1]) < 1.45) & (np.abs(place[..., 2] - 1) < 0.95)
    assert inner.sum() > 5000
    wanted = board.texture[row[inner].astype(int), column[inner].astype(int)].astype(int)
    assert np.abs(image.rgb[inner] - wanted).max() <= 2


@settings(max_examples=25)
@given(
    k1=st.floats(-0.4, 0.4),
    k2=st.floats(-0.2, 0.2),
    p1=st.floats(-0.01, 0.01),
    p2=st.floats(-0.01, 0.01),
    fov=st.floats(30, 85),
    shift=st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
)
def test_the_pinhole_picture_covers_the_view_at_full_resolution(k1, k2, p1, p2, fov, shift):
    camera = bent_camera((k1, k2, p1, p2, 0.0), size=(96, 72), fov=fov, shift=shift)
    lens = lens_of(camera)
    pixels = pixel_grid(camera)
    rays = camera.rays(pixels)
    by_method, drawn = (
        np.isfinite(rays).all(axis=-1),
        np.full(rays.shape[:2], True) if lens.dark is None else ~lens.dark,
    )
    # Where the lens folds over, rounding decides whether a pixel is imaged: the two may differ there and only there.
    assert not ((by_method != drawn) & ~binary_dilation(~(by_method | drawn), np.ones((3, 3)))).any()
    imaged = by_method & drawn
    pinhole = lens.pinhole(camera)
    places = pinhole.project(camera.center + rays[imaged])
    np.testing.assert_allclose(np.stack([lens.columns, lens.rows], -1)[imaged], places, atol=2e-3)
    assert (places > 0.5).all()
    assert (places < np.array(lens.size) - 1.5).all()
    columns, rows = lens.nearest[imaged] % lens.size[0], lens.nearest[imaged] // lens.size[0]
    back = camera.project(pinhole.center + pinhole.rays(np.stack([columns, rows], -1).astype(float)))
    assert np.linalg.norm(back - pixels[imaged], axis=-1).max() < 0.75


def test_pixels_beyond_the_fold_are_dark(renderer):
    """A polynomial that folds over: nothing is imaged in the corners."""
    camera = bent_camera((-0.5, 0.0, 0.0, 0.0, 0.0), fov=60.0)
    dark = np.isnan(camera.rays(pixel_grid(camera))).any(axis=-1)
    assert 0.02 < dark.mean() < 0.5
    image = renderer.render(camera, crowd(6), parts=True)
    assert not image.rgb[dark].any()
    assert (image.ids[dark] == -1).all()
    assert (image.parts[dark] == -1).all()
    assert np.isposinf(image.depth[dark]).all()
    assert (image.ids[~dark] >= 0).all()


def test_without_distortion_the_picture_is_that_of_the_pinhole():
    seen = []
    through_lens(VIEWS[0], lambda camera: seen.append(camera) or RasterRenderer().render(camera, []))
    assert seen[0] is VIEWS[0]


def test_a_weak_lens_changes_little(renderer):
    straight = VIEWS[0]
    one = renderer.render(straight, crowd(12))
    other = renderer.render(replace(straight, distortion=np.array([1e-7, 0, 0, 0, 0])), crowd(12))
    assert (one.ids == other.ids).mean() > 0.999
    assert np.abs(one.rgb.astype(int) - other.rgb)[one.ids == other.ids].mean() < 0.5


def test_a_lens_is_shared_by_cameras_in_any_pose():
    one = bent_camera(BARREL)
    assert lens_of(one) is lens_of(replace(bent_camera(BARREL, center=(-1.0, 2.0, 1.0)), name="other"))
    assert lens_of(one) is not lens_of(bent_camera(WEBCAM))


def test_too_much_distortion_is_refused(renderer):
    camera = replace(bent_camera((-0.5, 0.115, 0.0, 0.0, 0.0), fov=100.0), name="fisheye")
    with pytest.raises(ValueError, match=r"'fisheye'.*distorts so much.*cameras\.distortion"):
        renderer.render(camera, [])


def test_the_renderers_agree_through_a_lens(raster, gl):
    camera = bent_camera(WEBCAM, size=(640, 480))
    one, other = (each.render(camera, crowd(24)) for each in (raster, gl))
    assert (one.ids != other.ids).mean() < 1e-4
    assert np.median(np.abs(one.depth - other.depth)) < 1e-4
    assert (np.abs(one.rgb.astype(int) - other.rgb).max(axis=-1) <= 2).mean() > 0.997


def test_making_a_lens_takes_little_more_memory_than_the_lens():
    """1920 x 1080 pixels: 25 MB are kept and 70 at most are used, where undistorting at once would use 176."""
    camera = bent_camera(LENSES[3], size=(1280, 720))
    lens_of(bent_camera(LENSES[3], size=(64, 36)))  # compiles
    tracemalloc.start()
    lens = lens_of(camera)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 3.5 * (lens.columns.nbytes + lens.rows.nbytes + lens.nearest.nbytes)
