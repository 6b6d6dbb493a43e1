"""A rolling shutter against the closed form of a point that moves in a straight line."""

from dataclasses import replace

import numpy as np
import pytest

from mvpose.camera import Camera
from simharness.capture.sensor import BANDS, band_cameras, band_times, joints_at_exposure
from simharness.world.rigs.layouts import intrinsics, look_at


@pytest.fixture
def camera() -> Camera:
    return look_at((4.0, 0, 1), (0, 0, 1), K=intrinsics(60, (320, 240)), size=(320, 240))


def test_bands_are_spread_evenly_over_the_readout():
    times = band_times(2.0, 0.03)
    assert len(times) == BANDS
    assert times.mean() == pytest.approx(2.0)
    np.testing.assert_allclose(np.diff(times), 0.03 / BANDS)
    assert times[0] > 2.0 - 0.015
    assert band_times(2.0, 0.0).tolist() == [2.0]


@pytest.mark.parametrize("speed", [(0.0, 1.5, 0.0), (0.0, 0.0, -2.0), (0.5, -1.0, 1.0)])
def test_a_joint_is_observed_at_the_time_of_its_row(camera, speed):
    readout, start = 0.04, np.array([[[0.0, 0.2, 1.4], [0.3, -0.4, 0.5], [0.1, 0.0, 1.0]]])
    times = band_times(0.0, readout)
    joints = start + times[:, None, None, None] * np.array(speed)
    found = joints_at_exposure(joints, camera)
    pixel = camera.project(found)
    when = readout * ((pixel[..., 1] + 0.5) / camera.size[1] - 0.5)
    np.testing.assert_allclose(found, start + when[..., None] * np.array(speed), atol=1e-5)


def test_without_a_readout_nothing_is_moved(camera):
    joints = np.array([[[0.0, 0.2, 1.4]]])
    np.testing.assert_array_equal(joints_at_exposure(joints[None], camera), joints)


def test_a_joint_behind_the_camera_stays_in_the_middle(camera):
    joints = np.array([6.0, 0.0, 1.0]) + np.arange(5)[:, None, None, None] * np.array([0.0, 0.1, 0.0])
    np.testing.assert_allclose(joints_at_exposure(joints, camera)[0, 0], [6.0, 0.2, 1.0])


@pytest.mark.parametrize(("height", "count"), [(240, 8), (241, 8), (100, 7), (16, 8), (240, 1)])
def test_band_cameras_cover_the_rows_of_the_camera(camera, height, count):
    whole = replace(camera, size=(320, height))
    cut = band_cameras(whole, count)
    assert [strip.size[0] for strip in cut] == [320] * count
    assert sum(strip.size[1] for strip in cut) == height
    points = np.array([[0.0, y, z] for y in (-0.3, 0.2) for z in np.linspace(0.6, 1.4, 9)])
    expected, top = whole.project(points), 0
    for k, strip in enumerate(cut):
        np.testing.assert_allclose(strip.project(points) + [0, top], expected, atol=1e-9)
        rows = np.arange(top, top + strip.size[1])
        assert (np.floor((rows + 0.5) / height * count) == k).all()
        top += strip.size[1]
