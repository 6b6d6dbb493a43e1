"""Light of area lights, sun and sky against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mesh_shapes import ball, box, room, sheet
from test_renderers import camera_at

from simharness.capture.rendering import tone
from simharness.capture.rendering.box_tree_kernels import BoxTree, build_tree, trace
from simharness.capture.rendering.light_kernels import SourceArrays, direct_light
from simharness.capture.rendering.light_samples import LightSamples
from simharness.capture.rendering.moving_light import capsules
from simharness.capture.rendering.raster import RasterRenderer
from simharness.capture.rendering.room_light import _REFLECTED, _SPECK, _reflected, room_light
from simharness.capture.rendering.scene_geometry import StillGeometry
from simharness.types.lighting import AreaLight, Lighting, LightSources, Sun
from simharness.types.srgb import to_linear

PANEL = AreaLight((0.3, -0.2, 2.5), (0.0, 0.5, 0.0), (0.4, 0.0, 0.0), (2.0, 2.0, 2.0))
SKY = LightSources(sky=(1.0, 1.0, 1.0), balance=0.0)


def floor(half=4.0):
    return sheet([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], (0.8, 0.8, 0.8))


def computed(meshes, sources):
    geometry = StillGeometry(tuple(replace(mesh, still=True) for mesh in meshes))
    return room_light(sources, geometry.topology, geometry.vertices, geometry.normals)


def rectangle(place, normal, light):
    """Irradiance of a rectangle with radiance 1: Lambert's sum over its edges, which lies above the horizon."""
    corners = light.corners - place
    corners /= np.linalg.norm(corners, axis=1)[:, None]
    after = np.roll(corners, -1, axis=0)
    across = np.cross(corners, after)
    across /= np.linalg.norm(across, axis=1)[:, None]
    angles = np.arccos((corners * after).sum(axis=1))
    return abs(float((angles * (across @ normal)).sum())) / (2 * np.pi)


@pytest.mark.parametrize("place", [(0.3, -0.2, 0.0), (1.5, 1.0, 0.0), (-2.5, 2.0, 0.4), (0.5, 0.0, 1.3)])
@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_a_lamp_gives_the_light_of_its_form_factor(place, normal):
    tree = BoxTree(*build_tree(np.full((1, 3, 3), 50.0, np.float32) + np.eye(3, dtype=np.float32))[:3])
    area = np.array([[*PANEL.center, *PANEL.right, *PANEL.up, *PANEL.radiance, 0.0]])
    places, normals = (np.array([v], np.float32) for v in (place, normal))
    sources = SourceArrays(area, np.zeros(1, bool), np.zeros(6))
    found = direct_light(places, normals, np.zeros(1, np.float32), sources, tree)
    np.testing.assert_allclose(found[0], 2.0 * rectangle(np.array(place), np.array(normal), PANEL), rtol=0.03)


def test_nothing_hides_the_sky_from_a_plane():
    light = computed([floor()], SKY)
    np.testing.assert_allclose(light.light / light.exposure, 1.0, rtol=1e-5)


def test_light_in_a_closed_room_is_that_of_an_integrating_sphere():
    """Power in a room of one albedo a: what arrives, averaged over the walls, is the lamp's over 1 - a."""
    grey = room((4.0, 4.0, 3.0))
    meshes = [replace(grey, colors=np.full_like(grey.colors, 0.7))]
    light = computed(meshes, LightSources((PANEL,), balance=0.0))
    albedo = _REFLECTED * to_linear(np.array(255 * 0.7))
    geometry = StillGeometry(tuple(replace(mesh, still=True) for mesh in meshes))
    corners = geometry.vertices[geometry.topology.faces.astype(int)].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    samples = light.samples
    mean = np.zeros(len(area))
    for f, n in enumerate(samples.divisions):
        first = samples.corner_samples[f].min()
        mean[f] = (light.light[first : first + (n + 1) * (n + 2) // 2] / light.exposure).mean()
    # A panel of radiance 2 and 0.8 m2 sends out the power 2 * 0.8 in this unit.
    assert (mean * area).sum() == pytest.approx(2.0 * 0.8 / (1 - albedo), rel=0.08)


def test_penumbrae_widen_with_the_distance_of_what_casts_them():
    """A board over the floor below a lamp of 0.8 m: the penumbra is as wide as by similar triangles."""
    lamp = AreaLight((0.0, 0.0, 3.0), (0.0, 0.4, 0.0), (0.4, 0.0, 0.0), (1.0, 1.0, 1.0))
    x = np.linspace(-0.6, 0.6, 403)
    places = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)]).astype(np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (len(x), 1))
    area = np.array([[*lamp.center, *lamp.right, *lamp.up, *lamp.radiance, 0.0]])
    fixed = np.zeros(len(x), np.float32), SourceArrays(area, np.zeros(1, bool), np.zeros(6))
    far = BoxTree(*build_tree(np.full((1, 3, 3), 50.0, np.float32))[:3])
    bare = direct_light(places, normals, *fixed, far)[:, 0]
    widths = []
    for height in (0.3, 1.0, 1.5):
        board = sheet([(-9, -9, height), (0, -9, height), (0, 9, height), (-9, 9, height)], (1.0, 1.0, 1.0))
        tree = BoxTree(*build_tree(np.ascontiguousarray(board.vertices[board.faces]))[:3])
        share = direct_light(places, normals, *fixed, tree)[:, 0] / bare
        # Across the penumbra of a uniform lamp the light rises linearly: its slope is spread as a box of that width.
        rise, middle = np.diff(share), (x[1:] + x[:-1]) / 2
        spread = (rise * middle**2).sum() - (rise * middle).sum() ** 2
        widths.append(np.sqrt(12 * spread))
        assert rise.sum() == pytest.approx(1.0, abs=1e-6)
        assert widths[-1] == pytest.approx(0.8 * height / (3.0 - height), rel=0.12)
    assert widths[0] < widths[1] < widths[2]


def test_sunlight_comes_through_windows_alone():
    window = AreaLight((1.98, 0.0, 1.5), (0.0, -0.5, 0.0), (0.0, 0.0, 0.5), (0.01, 0.01, 0.01), kind="window")
    sources = LightSources((window,), Sun((1.0, 0.0, 1.0), (3.0, 3.0, 3.0)))
    light = computed([room((4.0, 4.0, 3.0))], sources)
    on_floor = light.samples.places[:, 2] < 0.01
    place, bright = light.samples.places[on_floor], light.light[on_floor, 1]
    inside = (np.abs(place[:, 1]) < 0.3) & (np.abs(place[:, 0] - 0.48) < 0.3)
    outside = (np.abs(place[:, 1]) > 0.8) | (np.abs(place[:, 0] - 0.48) > 0.8)
    assert bright[inside].min() > 5 * bright[outside].max()


def test_rays_meet_the_nearest_triangle():
    rng = np.random.default_rng(3)
    corners = (rng.uniform(-1, 1, (200, 1, 3)) + 0.3 * rng.normal(size=(200, 3, 3))).astype(np.float32)
    *built, order = build_tree(corners)
    tree = BoxTree(*built)
    stack = np.empty(64, np.int32)
    hits = 0
    for start, way in zip(rng.uniform(-2, 2, (150, 3)), rng.normal(size=(150, 3)), strict=True):
        edge = corners - corners[:, :1]
        system = np.stack([edge[:, 1], edge[:, 2], np.tile(-way, (200, 1))], axis=-1).astype(float)
        u, v, far = np.linalg.solve(system, (start - corners[:, 0])[..., None])[..., 0].T
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (far > 0)
        wanted = np.where(met, far, np.inf)
        t, distance, *_ = trace(tree, stack, tuple(start), tuple(way), 1e4, False)
        assert (t >= 0) == met.any()
        if t >= 0:
            hits += 1
            assert order[t] == wanted.argmin()
            assert distance == pytest.approx(wanted.min(), rel=1e-3)
        assert (trace(tree, stack, tuple(start), tuple(way), 1e4, True)[0] >= 0) == met.any()
    assert hits > 20


def test_a_capsule_encloses_the_cylinder_of_its_samples():
    rng = np.random.default_rng(0)
    angle, along = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(-0.3, 0.3, 4000)
    points = np.column_stack([0.07 * np.cos(angle), 0.07 * np.sin(angle), along]) + [1.0, 2.0, 0.5]
    (capsule,) = capsules(points.astype(np.float32), np.zeros(4000, np.int32), 1)
    assert capsule[6] == pytest.approx(0.07, rel=0.03)
    ends = np.sort([capsule[2], capsule[2] + capsule[5]])
    np.testing.assert_allclose(ends + [-capsule[6], capsule[6]], [0.2, 0.8], atol=0.02)


CAMERA = camera_at((2.6, -2.6, 2.2), (0.0, 0.0, 0.3), size=(200, 150))
LIGHTING = Lighting(sources=LightSources((replace(PANEL, center=(0.0, 0.0, 2.9)),)))


def test_bodies_darken_the_floor_below_them_and_nothing_far_away():
    """The light below a ball falls with its height above the floor, and depth and ids are those of other lighting."""
    ground, renderer = replace(room((8.0, 8.0, 3.0)), still=True), RasterRenderer()
    away = ball((40.0, 0.0, 0.3), 0.25, rings=12)
    bare = renderer.render(CAMERA, [ground, away], lighting=LIGHTING).rgb.astype(int)
    darkest = []
    for height in (0.3, 0.9, 1.5):
        thing = ball((0.0, 0.0, height), 0.25, rings=12)
        image = renderer.render(CAMERA, [ground, thing], lighting=LIGHTING)
        plain = renderer.render(CAMERA, [ground, thing])
        np.testing.assert_array_equal(image.ids, plain.ids)
        np.testing.assert_array_equal(image.depth, plain.depth)
        change = (bare - image.rgb).max(axis=-1)[image.ids == 0]
        darkest.append(change.max())
        assert (change > 2).mean() < 0.35
        assert change.min() >= 0
    assert darkest[0] > darkest[1] > darkest[2]
    assert darkest[0] > 40


def test_a_kept_background_changes_no_bit_of_a_lit_picture():
    still = [replace(room((6.0, 6.0, 3.0)), still=True), replace(box((-1.0, 1.0, 0.4), (0.5, 0.5, 0.8)), still=True)]
    renderer = RasterRenderer()
    for step in range(3):
        scene = [ball((0.3 * step, 0.0, 0.6), 0.3, rings=12), *still]
        for camera in (CAMERA, camera_at((-2.0, 2.5, 1.4), (0.5, 0.0, 1.0), size=(160, 120))):
            image = renderer.render(camera, scene, lighting=LIGHTING)
            fresh = RasterRenderer().render(camera, scene, lighting=LIGHTING)
            np.testing.assert_array_equal(image.rgb, fresh.rgb)


def test_what_glows_is_as_bright_as_its_radiance():
    corners = [(-1, -1, 2.8), (-1, 1, 2.8), (1, 1, 2.8), (1, -1, 2.8)]
    panel = replace(sheet(corners, (1.0, 1.0, 1.0)), emission=(9.0, 9.0, 9.0), still=True)
    camera = camera_at((0.0, -0.5, 1.0), (0.0, 0.0, 2.8), size=(80, 60))
    image = RasterRenderer().render(camera, [replace(room((6.0, 6.0, 3.0)), still=True), panel], lighting=LIGHTING)
    assert image.rgb[image.ids == 1].min() >= 250


def test_the_tone_curve_keeps_middle_grey_and_has_a_shoulder():
    assert float(tone.tone(0.18)) == pytest.approx(0.18, abs=1e-6)
    light = np.linspace(0, 8, 400)
    shown = tone.tone(light)
    assert (np.diff(shown) >= 0).all()
    assert tone.tone(1.0) < 0.9  # white in full light is not clipped
    assert (np.diff(tone.table().astype(int)) >= 0).all()
    values = tone.dimming()
    assert (np.diff(values.astype(int), axis=0) >= 0).all()
    np.testing.assert_array_equal(values[-1], np.arange(256))


def test_a_speck_far_brighter_than_all_else_brings_a_bounded_share():
    """Its radiance counts as some times the mean; all others are as they are."""
    count = 500
    places, albedo = np.zeros((count, 3), np.float32), np.full((count, 3), 0.5, np.float32)
    nothing = np.zeros((0, 3), np.int32)
    samples = LightSamples(places, places, albedo, places[:, 0], nothing, nothing[:, 0])
    light = np.ones((count, 3), np.float32)
    plain = _reflected(samples, light)
    np.testing.assert_allclose(plain, 0.5 * _REFLECTED, rtol=1e-6)
    light[7] = 1000.0
    bright = _reflected(samples, light)
    np.testing.assert_array_equal(np.delete(bright, 7, axis=0), np.delete(plain, 7, axis=0))
    mean = (plain.sum(axis=0) + 999.0 * plain[7]) / count
    np.testing.assert_allclose(bright[7], _SPECK * mean, rtol=1e-4)
