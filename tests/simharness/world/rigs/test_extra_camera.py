"""One more camera: where it stands, where it looks, and that it has the lens of the others."""

import numpy as np
import pytest

from mvpose import Rig
from simharness.world.rigs.extra_camera import cameras_on_walls, with_camera_in_gap
from simharness.world.rigs.layouts import look_at

K = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])
SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


def ring(*bearings, radius=3.0, height=2.0):
    places = [(radius * np.cos(each), radius * np.sin(each), height) for each in np.radians(bearings)]
    return Rig([look_at(place, (0, 0, 1), K=K, size=(640, 480), name=f"cam{k}") for k, place in enumerate(places)])


def test_the_widest_gap_is_halved():
    rig = with_camera_in_gap(ring(0, 60, 120), lambda place: True)
    assert rig[3].name == "cam3"
    np.testing.assert_allclose(
        rig[3].center, [3 * np.cos(np.radians(240)), 3 * np.sin(np.radians(240)), 2.0], atol=1e-2
    )
    np.testing.assert_allclose(rig[3].project(np.array([[0.0, 0, 1]])), [[320, 240]], atol=1.0)
    np.testing.assert_array_equal(rig[3].K, K)


def test_the_next_gap_is_taken_where_something_stands_in_the_widest_and_the_widest_where_all_are_taken():
    rig = ring(0, 60, 200)
    free = with_camera_in_gap(rig, lambda place: True)[3].center
    other = with_camera_in_gap(rig, lambda place: bool(np.linalg.norm(place - free) > 0.5))[3].center
    assert np.degrees(np.arctan2(other[1], other[0])) == pytest.approx(130, abs=0.5)
    np.testing.assert_array_equal(with_camera_in_gap(rig, lambda place: False)[3].center, free)


def test_it_stays_within_reach():
    rig = with_camera_in_gap(ring(0, 60, 120), lambda place: True, reach=(1.0, 2.0, 1.5))
    np.testing.assert_allclose(rig[3].center, [-1.0, -2.0, 1.5])


def test_cameras_on_walls_look_at_the_middle_of_the_area_below_the_ceiling():
    walls = 4.0 * SQUARE
    found = cameras_on_walls(ring(0, 120, 240), SQUARE, walls=walls, ceiling=2.4, around=8)
    assert len(found) == 16
    for camera in found:
        assert abs(np.abs(camera.center[:2]).max() - 4.0) < 0.16
        assert camera.center[2] <= 2.2
        np.testing.assert_allclose(camera.project(np.array([[0.0, 0, 1]])), [[320, 240]], atol=1e-6)


def test_no_camera_hangs_where_there_is_one():
    place = cameras_on_walls(ring(0, 120, 240), SQUARE, around=8)[0].center
    rig = Rig([*ring(0, 120, 240), look_at(place, (0, 0, 1), K=K, size=(640, 480), name="there")])
    walls = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 3.5
    for camera in cameras_on_walls(rig, SQUARE, walls=walls, around=8):
        assert np.linalg.norm(rig.centers - camera.center, axis=1).min() >= 0.4
