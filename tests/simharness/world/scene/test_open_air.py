"""Outdoors: sky models against their definitions, and surroundings that hide nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.world.rigs.layouts import build_rig
from simharness.world.scene.rooms.landscape import AROUND, WHITE, make_surroundings, read_panorama
from simharness.world.scene.rooms.room_lighting import LIGHTS, room_lighting
from simharness.world.scene.rooms.shell import make_room
from tools.objects.finishes import MEADOW
from tools.objects.weather import WEATHERS, clear_sky, overcast_sky

ROOM = RoomSection(kind="outdoors", floor="paving", size=(8.0, 6.0, 3.0))
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def hemisphere(count, seed=0):
    """Return directions above the horizon, equally dense in the hemisphere."""
    ways = np.random.default_rng(seed).normal(size=(count, 3))
    ways[:, 2] = np.abs(ways[:, 2])
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def towards(elevation, bearing=0.0):
    height = np.radians(elevation)
    return np.array([np.cos(height) * np.cos(bearing), np.cos(height) * np.sin(bearing), np.sin(height)])


@pytest.mark.parametrize("elevation", [10.0, 35.0, 60.0])
def test_the_clear_sky_is_that_of_preetham(elevation):
    """It is 1 at the zenith, brightest around the sun, bluest away from it, and symmetric about the sun's bearing."""
    sun = towards(elevation, 0.7)
    assert clear_sky((0.0, 0.0, 1.0), sun) @ LUMINANCE == pytest.approx(1.0, abs=0.01)
    left, right = (clear_sky(towards(25.0, 0.7 + turn), sun) for turn in (-1.1, 1.1))
    np.testing.assert_allclose(left, right, rtol=1e-9)
    ways = hemisphere(3000)
    light = clear_sky(ways, sun) @ LUMINANCE
    assert (ways[light.argmax()] @ sun) > np.cos(np.radians(15.0))
    opposite = clear_sky(towards(90.0 - elevation, 0.7 + np.pi), sun)
    assert opposite[2] > 1.5 * opposite[0]


def test_chromaticity_at_the_zenith_is_that_of_the_published_polynomials():
    """Turbidity 2 and a sun at the zenith: x and y of appendix A.2 of Preetham et al. with an angle of 0."""
    x = 0.00394 * 0 + 0.25886 + 2 * 0.00394
    y = 0.26688 + 2 * 0.00516
    r, g, b = clear_sky((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 2.0)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])  # IEC 61966-2-1
    xyz = to_xyz @ [r, g, b]
    haze = np.exp(-1 / 0.20)  # the share of the colour of haze at the zenith
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), [x, y], atol=2e-3 + haze)


def test_the_overcast_sky_is_three_times_as_bright_at_the_zenith():
    top, edge = overcast_sky((0.0, 0.0, 1.0)), overcast_sky((1.0, 0.0, 0.0))
    np.testing.assert_allclose(top / edge, 3.0)


@pytest.mark.parametrize("name", WEATHERS)
def test_sun_and_sky_give_the_ground_a_light_of_one(name):
    weather = replace(WEATHERS[name], bearing=1.3)
    assert weather.level @ LUMINANCE == pytest.approx(1.0, abs=1e-9)
    ways = hemisphere(40_000)
    sky = 2 * (weather.radiance(ways) * ways[:, 2:]).mean(axis=0)  # of a uniform density, pi times the mean over pi
    np.testing.assert_allclose(sky, weather.sky, rtol=0.03)


@pytest.mark.parametrize("name", WEATHERS)
def test_the_light_of_a_weather_is_that_of_its_models(name):
    light, model = room_lighting(ROOM.model_copy(update={"light": name}), 3), WEATHERS[name]
    x, y, _ = LIGHTS[name].direction
    turned = replace(model, bearing=float(np.arctan2(y, x)))
    np.testing.assert_allclose(light.direction, turned.towards, atol=1e-9)
    np.testing.assert_allclose(light.sources.sky, turned.sky, atol=2e-3)
    assert (light.sources.brightness, light.sources.balance) == (model.brightness, model.balance)
    assert (light.sources.sun is None) == (turned.sun is None)
    if turned.sun is not None:
        np.testing.assert_allclose(light.sources.sun.irradiance, turned.sun.irradiance, atol=1e-4)


def test_light_outdoors_is_that_of_the_sun_in_the_bearing_of_the_closed_form():
    light = room_lighting(ROOM, 3)
    assert light.sources is not None
    np.testing.assert_allclose(light.sources.sun.direction, light.direction)
    assert light.panorama is not None
    assert room_lighting(ROOM, 3) == light  # so that backgrounds of cameras are kept
    assert room_lighting(RoomSection(walls=False), 3).panorama is None
    assert room_lighting(ROOM.model_copy(update={"light": "dim"}), 3).sources.sun is None


@pytest.fixture(scope="module")
def far_rig():
    """Cameras outside the floor and outside the ground around it."""
    return build_rig(CamerasSection(count=4, radius=15.0, height=3.0))


@pytest.mark.slow
def test_surroundings_hide_nothing(far_rig):
    """No line between two points of the floor, the ground around it and the cameras meets anything above the ground."""
    for rig, reach in ((far_rig, 15.0), (build_rig(CamerasSection(count=3, radius=2.5)), np.hypot(8.0, 7.0))):
        meadow, plants = make_surroundings(ROOM, 1, rig)
        assert meadow.geoms == plants.geoms == ()
        assert np.abs(meadow.mesh.vertices[:, 2]).max() == 0.0
        corners = plants.mesh.vertices[plants.mesh.faces][..., :2].astype(float)
        assert np.linalg.norm(corners, axis=-1).min() > reach + 0.5


def test_ground_goes_on_without_a_gap_to_the_meadow(far_rig):
    floor, ground = make_room(ROOM, 0)
    meadow, _ = make_surroundings(ROOM, 0, far_rig)
    half = np.array(ROOM.size[:2]) / 2 + AROUND
    area = 0.0
    for mesh in (floor.mesh, ground.mesh, meadow.mesh):
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
        cross = np.cross(b - a, c - a)
        assert (cross[:, 2] > 0).all()  # it looks up
        area += cross[:, 2].sum() / 2
    outline = meadow.mesh.vertices[-88:, :2].astype(float)
    after = np.roll(outline, -1, axis=0)
    assert area == pytest.approx(float((outline[:, 0] * after[:, 1] - outline[:, 1] * after[:, 0]).sum()) / 2, rel=1e-5)
    assert np.linalg.norm(outline, axis=1).min() > 50.0
    np.testing.assert_allclose(np.abs(ground.mesh.vertices).max(axis=0)[:2], half, atol=1e-5)
    np.testing.assert_allclose(ground.mesh.texture, floor.mesh.texture)


@pytest.mark.slow
def test_the_panorama_repeats_by_its_seed_and_shows_ground_below_the_horizon_and_sky_above():
    weather = replace(WEATHERS["side"], bearing=0.4)
    one = read_panorama(4, "side", 0.4)
    np.testing.assert_array_equal(one, read_panorama(4, "side", 0.4))
    shown = one[-4:].reshape(-1, 3).mean(axis=0) / 255
    albedo = np.array(MEADOW) ** 2.2 * weather.level / WHITE
    np.testing.assert_allclose(shown, albedo ** (1 / 2.2), atol=0.03)
    top = one[:40].reshape(-1, 3).mean(axis=0)
    assert top[2] > top[0]
    brightest = np.unravel_index(one.astype(int).sum(axis=-1).argmax(), one.shape[:2])
    azimuth = (brightest[1] + 0.5) / one.shape[1] * 2 * np.pi - np.pi
    assert azimuth == pytest.approx(0.4, abs=0.05)
