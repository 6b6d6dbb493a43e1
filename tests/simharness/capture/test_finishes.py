"""Gloss of skin and hair, folds of cloth: closed forms, and what they may not change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mesh_shapes import ball, sheet
from test_renderers import camera_at

from simharness.capture.rendering.finish_kernels import FINISHING, GLOSS, FinishArrays, finish
from simharness.capture.rendering.finishes import Finishes, grain_of
from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.rendering.surface_kernels import NORMAL_X, NORMAL_Y, NORMAL_Z, PIXELS, memory
from simharness.types.lighting import AreaLight, Lighting, LightSources
from simharness.types.mesh import Finish, Material, Mesh

LAMP = AreaLight((0.0, 0.0, 2.9), (0.0, 0.2, 0.0), (0.2, 0.0, 0.0), (20.0, 20.0, 20.0))
LIGHT = Lighting(sources=LightSources((LAMP,), sky=(0.3, 0.3, 0.3)))


def finish_of(mesh, material, *, looseness=0.0):
    """The grain runs from every vertex of a mesh to the next one."""
    count = len(mesh.vertices)
    toward = (np.arange(count) + 1) % count
    rest = np.linalg.norm(mesh.vertices[toward] - mesh.vertices, axis=1)
    materials = np.full(len(mesh.faces), material)
    return Finish(materials, toward, rest, mesh.vertices[:, 2], np.full(count, looseness))


def scene(material):
    ground = sheet([(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], (0.6, 0.6, 0.6))
    body = ball((0, 0, 1.2), 0.5, (0.4, 0.3, 0.25))
    given = None if material is None else finish_of(body, material)
    return [replace(body, finish=given), replace(ground, still=True)]


def test_a_finish_changes_colours_alone():
    camera = camera_at((2.5, 0.3, 1.6), (0, 0, 1.2))
    plain, glossy = (RasterRenderer().render(camera, scene(m), lighting=LIGHT) for m in (None, Material.PLASTIC))
    np.testing.assert_array_equal(plain.depth, glossy.depth)
    np.testing.assert_array_equal(plain.ids, glossy.ids)
    np.testing.assert_array_equal(plain.rgb[plain.ids != 0], glossy.rgb[plain.ids != 0])
    assert (plain.rgb[plain.ids == 0] != glossy.rgb[plain.ids == 0]).any()


def test_a_matte_finish_is_none():
    camera = camera_at((2.5, 0.3, 1.6), (0, 0, 1.2))
    plain, matte = (RasterRenderer().render(camera, scene(m), lighting=LIGHT).rgb for m in (None, Material.MATTE))
    np.testing.assert_array_equal(plain, matte)


def test_a_highlight_lies_where_the_normal_is_between_lamp_and_camera():
    camera = camera_at((2.5, 0.0, 1.9), (0, 0, 1.2))
    plain, glossy = (RasterRenderer().render(camera, scene(m), lighting=LIGHT) for m in (None, Material.PLASTIC))
    gain = glossy.rgb.astype(int).sum(axis=2) - plain.rgb.astype(int).sum(axis=2)
    v, u = np.unravel_index(np.where(plain.ids == 0, gain, 0).argmax(), gain.shape)
    ray = camera.R.T @ np.linalg.inv(camera.K) @ [u, v, 1.0]
    normal = (camera.center + plain.depth[v, u] * ray - (0, 0, 1.2)) / 0.5
    view = camera.center - (0, 0, 1.2)
    half = view / np.linalg.norm(view) + (0, 0, 1)
    assert normal @ half / np.linalg.norm(half) > np.cos(np.radians(12))


def finished(normal, *, light, material=Material.SKIN, slope=0.0, view=(0.0, 0.0, 1.0)):
    """Factor of the received light (3,) and gloss of one pixel in the middle of a large picture."""
    pixel, narrow = np.zeros(1, np.int32), memory()[0]
    narrow[[NORMAL_X, NORMAL_Y, NORMAL_Z]] = normal
    x, y, z = view
    rays = np.array([[1e-9, 0, -x], [0, 1e-9, -y], [0, 0, -z]])
    received, grain = np.ones(3 * PIXELS, np.float32), np.tile(np.array([1, 0, 0, slope], np.float32), (3, 1))
    work = np.zeros(FINISHING, np.float32)
    finishes = FinishArrays(
        np.array([material], np.int8),
        np.zeros(1, np.int16),
        np.array([light], np.float32),
        np.zeros(1, np.float32),
        grain,
        np.zeros(3, np.float32),
        0.6,
    )
    faces = np.array([[0, 1, 2]], np.uint32)
    finish((pixel, pixel, pixel), (0, 0), faces, rays, narrow, finishes, work, received)
    return received[::PIXELS], work[GLOSS]


def test_gloss_is_that_of_a_ggx_lobe():
    """Light, normal and camera in one line: pi D F V = F0 / (4 (r + 1/2) alpha^2) and all light comes from there."""
    _, gloss = finished((0, 0, 1), light=(0, 0, 1, 1, 0, 0, 0))
    assert gloss == pytest.approx(0.028 / (4 * 0.95 * 0.45**4), rel=1e-3)


def test_even_light_is_reflected_by_the_reflectance():
    _, gloss = finished((0, 0, 1), light=(0, 0, 1, 0, 1, 0, 0))
    assert gloss == pytest.approx(0.028, rel=1e-3)


def test_red_light_reaches_farther_through_skin():
    red, green, blue = finished((1, 0, 0), light=(0, 0, 1, 1, 1, 0, 0))[0]
    assert red > green > blue > 1
    np.testing.assert_allclose(finished((0, 0, 1), light=(0, 0, 1, 1, 1, 0, 0))[0], 1.0, rtol=1e-5)


def test_cloth_that_does_not_fold_keeps_its_light():
    np.testing.assert_array_equal(finished((0, 0, 1), light=(0.6, 0, 0.8, 1, 0.5, 0, 0), material=Material.CLOTH)[0], 1)


def test_a_fold_has_the_light_of_its_tilted_normal():
    """A normal tilted towards the light is brighter, by the law of cosines; mirrored light gives the mirrored tilt."""
    one, other = (
        finished((0, 0, 1), light=(x, 0, 0.8, 1, 0, 0, 0), material=Material.CLOTH, slope=0.3)[0][0] * 0.8
        for x in (0.6, -0.6)
    )
    tilt = np.arctan2(one - other, one + other)  # cos(a - t) and cos(a + t): their ratio is that of sums to differences
    assert 0 < abs(np.tan(tilt)) / (0.6 / 0.8) <= 0.3
    assert one**2 + other**2 > 0
    slope = (one - other) / (one + other) * 0.8 / 0.6
    assert one == pytest.approx((0.8 + 0.6 * slope) / np.hypot(1, slope), rel=1e-3)


def test_cloth_folds_where_it_is_shorter_than_at_rest():
    vertices = np.array([(0, 0, 0), (0.05, 0, 0), (0.09, 0, 0)], np.float32)
    toward, rest = np.array([1, 2, 2], np.int32), np.array([0.05, 0.05, 0.0], np.float32)
    grain = grain_of(vertices, toward, rest, np.ones(3, np.float32))
    np.testing.assert_allclose(grain[:2, :3], [[1, 0, 0]] * 2, atol=1e-6)
    assert grain[1, 3] > 3 * grain[0, 3] > 0 == grain[2, 3]
    stretched = grain_of(2 * vertices, toward, rest, np.ones(3, np.float32))
    assert stretched[1, 3] == grain[0, 3]


def test_finishes_of_meshes_are_joined():
    one, other = ball((0, 0, 1), 0.3, (0.5,) * 3), ball((1, 0, 1), 0.3, (0.5,) * 3)
    joined = Finishes.from_meshes((one, replace(other, finish=finish_of(other, Material.HAIR))))
    first = len(one.vertices)
    np.testing.assert_array_equal(joined.toward[:first], np.arange(first))
    np.testing.assert_array_equal(joined.toward[first:] - first, finish_of(other, Material.HAIR).toward)
    np.testing.assert_array_equal(np.bincount(joined.figure), [len(one.faces), len(other.faces)])
    assert Finishes.from_meshes((one, other)) is None


def test_a_finish_of_another_body_is_refused():
    one = ball((0, 0, 1), 0.3, (0.5,) * 3)
    with pytest.raises(ValueError, match="must have as many, got 1 and 3"):
        Mesh(one.vertices, one.faces, one.colors, finish=Finish([1], [0, 1, 2], [0] * 3, [0] * 3, [0] * 3))
    with pytest.raises(ValueError, match="must point to the 3 vertices, got 0 to 3"):
        Finish([1], [0, 1, 3], [0] * 3, [0] * 3, [0] * 3)
