"""Windows let daylight in and show the panorama; lines of courts have their sizes and stay on the floor."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.capture.rendering.raster import RasterRenderer
from simharness.scenario.sections.room_section import RoomSection
from simharness.world.rigs.layouts import intrinsics, look_at
from simharness.world.scene.rooms.fittings import make_court
from simharness.world.scene.rooms.kinds import room_kinds, settled
from simharness.world.scene.rooms.lamps import area_lights
from simharness.world.scene.rooms.openings import draw_openings
from simharness.world.scene.rooms.room_lighting import room_lighting
from simharness.world.scene.rooms.shell import make_room


def camera_at(center, aim, fov):
    return look_at(center, aim, K=intrinsics(fov, (160, 120)), size=(160, 120))


@pytest.mark.parametrize("kind", [name for name, kind in room_kinds().items() if kind.windows[0]])
def test_windows_shine_into_the_room(kind):
    room = settled(RoomSection(kind=kind), 1)
    areas = [area for area in area_lights(room, 1, draw_openings(room, 1)) if area.kind == "window"]
    assert areas
    for area in areas:
        towards = np.array([0.0, 0.0, 1.5]) - area.center
        assert area.normal @ towards > 0.9 * min(room.size[:2]) / 2
        assert abs(area.normal[2]) < 1e-9


def test_daylight_is_brightest_below_the_windows():
    """With its lamps off, the floor of a room is brighter near the windows than at the opposite wall."""
    room = settled(RoomSection(kind="office", size=(8.0, 8.0, 3.0), light="side"), 1)
    openings = [opening for opening in draw_openings(room, 1) if opening.kind == "window"][:1]
    lighting = room_lighting(room, 1, area_lights(room, 1, openings))
    meshes = [solid.mesh for solid in make_room(room, 1, openings)]
    wall = openings[0].wall
    image = RasterRenderer().render(camera_at((0.0, 0.01, 2.9), (0.0, 0.0, 0.0), fov=100.0), meshes, lighting=lighting)
    places = np.array([wall.at((wall.length / 2, depth, 0.0)) for depth in (1.4, 6.6)])
    columns, rows = np.round(camera_at((0.0, 0.01, 2.9), (0.0, 0.0, 0.0), fov=100.0).project(places)).astype(int).T
    near, far = (
        image.rgb[row - 4 : row + 5, column - 4 : column + 5].mean() for column, row in zip(columns, rows, strict=True)
    )
    assert near > 1.3 * far


@pytest.mark.slow
def test_a_window_without_a_pane_shows_the_panorama():
    room = settled(RoomSection(kind="office"), 2)
    openings = draw_openings(room, 2)
    lighting = room_lighting(room, 2, area_lights(room, 2, openings))
    assert lighting.panorama is not None
    assert max(lighting.panorama.emission) > 0
    window = next(opening for opening in openings if opening.kind == "window")
    middle = window.wall.at((sum(window.span) / 2, 0.0, sum(window.heights) / 2))
    camera = camera_at(window.wall.at((sum(window.span) / 2, 2.0, 1.5)), middle, fov=20.0)
    image = RasterRenderer().render(camera, [solid.mesh for solid in make_room(room, 2, openings)], lighting=lighting)
    assert (image.ids == -1).mean() > 0.9
    assert image.rgb[image.ids == -1].std() > 3


@pytest.mark.parametrize("size", [(8.0, 7.0, 3.0), (7.0, 12.0, 4.0), (30.0, 18.0, 6.0)])
def test_lines_of_courts_stay_on_the_floor(size):
    (court,) = make_court(settled(RoomSection(kind="gym", size=size), 3), 3)
    vertices = court.mesh.vertices.astype(float)
    assert court.geoms == ()
    assert (np.abs(vertices[:, :2]) <= np.array(size[:2]) / 2 - 0.3).all()
    assert vertices[:, 2].min() > 0
    assert vertices[:, 2].max() < 0.005
    a, b, c = np.moveaxis(vertices[court.mesh.faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_a_large_gym_has_a_whole_court_of_badminton():
    (court,) = make_court(settled(RoomSection(kind="gym", size=(30.0, 18.0, 6.0)), 3), 3)
    lower = court.mesh.vertices[court.mesh.vertices[:, 2] < 0.002]
    np.testing.assert_allclose(np.abs(lower[:, :2]).max(axis=0), [13.40 / 2, 6.10 / 2], atol=0.03)
    upper = court.mesh.vertices[court.mesh.vertices[:, 2] > 0.002]
    assert np.abs(upper[:, 1]).max() == pytest.approx(15.0 / 2, abs=0.03)


def test_other_rooms_have_no_court():
    assert make_court(settled(RoomSection(kind="office"), 3), 3) == ()
    assert make_court(settled(RoomSection(kind="gym", floor="concrete"), 3), 3) == ()
