"""Pixels without a surface show the panorama in their direction, with neither depth nor id."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mesh_shapes import ball, sheet
from test_renderers import axis_rays, camera_at

from simharness.capture.picture import with_mirrors
from simharness.capture.rendering import tone
from simharness.capture.rendering.raster import RasterRenderer
from simharness.types.lighting import Lighting, LightSources, Panorama
from simharness.types.mirror import Mirror
from simharness.types.srgb import from_linear, to_linear
from tools.objects.landscape import directions

LOWEST = -0.5
CAMERAS = [
    camera_at((0.2, 0.1, 1.0), (-3.0, 0.4, 1.3)),  # across the edge of the picture
    camera_at((0.2, 0.1, 1.0), (1.5, 2.0, 1.9), shift=(7.0, -4.0)),
    camera_at((0.2, 0.1, 1.0), (0.2, 0.11, 3.0)),  # to the zenith
]


def colored():
    """Return a picture of which the colour is a smooth function of the direction."""
    return np.round(127.5 + 110 * directions((300, 1200), LOWEST)).astype(np.uint8)


PANORAMA = Panorama(colored, (1.5, 1.2, 1.0), LOWEST)
LIGHTING = Lighting(panorama=PANORAMA)


def expected(camera, exposure=1.0, mirror=None):
    """Return what an empty picture shows, and which of its pixels look above the lower edge of the panorama."""
    rays = axis_rays(camera)
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    if mirror is not None:
        rays = mirror.reflect(rays) - mirror.reflect(np.zeros(3))
    light = to_linear(127.5 + 110 * rays) * PANORAMA.emission * exposure
    return from_linear(tone.tone(light)), rays[..., 2] > np.sin(LOWEST) + 0.01


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("distortion", [(), (-0.1, 0.01, 0.0, 0.0, 0.0)])
def test_an_empty_pixel_shows_its_direction(camera, distortion):
    camera = replace(camera, distortion=np.array(distortion)) if distortion else camera
    image = RasterRenderer().render(camera, [ball((50.0, 50.0, -80.0), 0.1)], lighting=LIGHTING)
    shown, above = expected(camera)
    assert above.mean() > 0.6
    assert np.abs(image.rgb - shown)[above].max() < 4
    assert np.isinf(image.depth).all()
    assert (image.ids == -1).all()


def test_surfaces_hide_the_panorama_and_nothing_else_of_them_changes():
    meshes = [
        ball((-1.0, 0.2, 1.2), 0.4),
        replace(sheet([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], (0.5,) * 3), still=True),
    ]
    for sources in (None, LightSources(sky=(1.0, 0.9, 0.8))):
        plain = RasterRenderer().render(CAMERAS[0], meshes, lighting=Lighting(sources=sources))
        image = RasterRenderer().render(CAMERAS[0], meshes, lighting=replace(LIGHTING, sources=sources))
        solid = plain.ids >= 0
        assert 0.2 < solid.mean() < 0.8
        np.testing.assert_array_equal(image.ids, plain.ids)
        np.testing.assert_array_equal(image.depth, plain.depth)
        np.testing.assert_array_equal(image.rgb[solid], plain.rgb[solid])
        assert (np.abs(image.rgb.astype(int) - plain.rgb)[~solid].sum(axis=-1) > 0).mean() > 0.9


def test_exposure_brightens_the_panorama_as_it_does_surfaces():
    """Under a sky alone the exposure is brightness over mean light; the panorama is multiplied by it."""
    still = replace(sheet([(-999, -999, -1), (999, -999, -1), (999, 999, -1), (-999, 999, -1)], (0.0,) * 3), still=True)
    sky = 0.5  # from above; black ground reflects nothing: surfaces that face sideways get half of it, and none below
    mean = sky * (1 + 4 * 0.5 + 0) / 6
    for brightness in (0.4, 0.8):
        sources = LightSources(sky=(sky,) * 3, brightness=brightness, balance=0.0)
        image = RasterRenderer().render(CAMERAS[1], [still], lighting=replace(LIGHTING, sources=sources))
        shown, above = expected(CAMERAS[1], brightness / mean)
        empty = (image.ids < 0) & above
        assert empty.any()
        assert np.abs(image.rgb - shown)[empty].mean() < 3


def test_a_mirror_shows_the_panorama_behind_the_camera():
    mirror = Mirror((-1.5, 0.2, 1.2), (1.0, 0.0, 0.0), (0.5, 0.4))
    y, z = 0.2 + np.array([-1, 1, 1, -1]) * 0.5, 1.2 + np.array([-1, -1, 1, 1]) * 0.4
    glass = sheet(list(zip([-1.5] * 4, y, z, strict=True)), (0.5,) * 3)
    renderer = RasterRenderer()
    image = renderer.render(CAMERAS[0], [glass], lighting=LIGHTING)
    rgb = with_mirrors(renderer, CAMERAS[0], [glass], {0: mirror}, image, lighting=LIGHTING)
    shown, above = expected(CAMERAS[0], mirror=mirror)
    seen = (image.ids == 0) & above
    assert seen.sum() > 200
    assert np.abs(rgb - shown * (0.87, 0.90, 0.89))[seen].max() < 4


def test_both_renderers_show_the_same(gl):
    meshes = [ball((-1.0, 0.2, 1.2), 0.4)]
    for camera in CAMERAS:
        one, other = (renderer.render(camera, meshes, lighting=LIGHTING) for renderer in (RasterRenderer(), gl))
        empty = (one.ids < 0) & (other.ids < 0)
        np.testing.assert_array_equal(one.rgb[empty], other.rgb[empty])


def test_places_and_directions_are_inverse():
    ways = directions((40, 90), LOWEST)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=-1), 1.0, atol=1e-12)
    panorama = Panorama(lambda: np.zeros((40, 90, 3), np.uint8), lowest=LOWEST)
    column, row = np.meshgrid(np.arange(90), np.arange(40))
    np.testing.assert_allclose(panorama.places(ways), np.stack([column, row], axis=-1), atol=1e-9)


def test_bad_panoramas_are_refused():
    with pytest.raises(ValueError, match="lower edge of a panorama"):
        Panorama(colored, lowest=2.0)
    with pytest.raises(ValueError, match="panorama picture"):
        _ = Panorama(lambda: np.zeros((4, 8), np.uint8)).picture
