"""A rolling shutter against the closed form of a point that moves in a straight line."""

import numpy as np
import pytest

from mvpose.camera import Camera
from simharness.rendering.shutter import BANDS, moments, rolled, stitched
from simharness.rigs.layouts import intrinsics, look_at


@pytest.fixture
def camera() -> Camera:
    return look_at((4.0, 0, 1), (0, 0, 1), K=intrinsics(60, (320, 240)), size=(320, 240))


def test_bands_are_spread_evenly_over_the_readout():
    times = moments(2.0, 0.03)
    assert len(times) == BANDS
    assert times.mean() == pytest.approx(2.0)
    np.testing.assert_allclose(np.diff(times), 0.03 / BANDS)
    assert times[0] > 2.0 - 0.015
    assert moments(2.0, 0.0).tolist() == [2.0]


@pytest.mark.parametrize("speed", [(0.0, 1.5, 0.0), (0.0, 0.0, -2.0), (0.5, -1.0, 1.0)])
def test_a_joint_is_where_it_was_when_its_row_was_read(camera, speed):
    readout, start = 0.04, np.array([[[0.0, 0.2, 1.4], [0.3, -0.4, 0.5], [0.1, 0.0, 1.0]]])
    times = moments(0.0, readout)
    joints = start + times[:, None, None, None] * np.array(speed)
    found = rolled(joints, camera)
    pixel = camera.project(found)
    when = readout * ((pixel[..., 1] + 0.5) / camera.size[1] - 0.5)
    np.testing.assert_allclose(found, start + when[..., None] * np.array(speed), atol=1e-5)


def test_without_a_readout_nothing_is_moved(camera):
    joints = np.array([[[0.0, 0.2, 1.4]]])
    np.testing.assert_array_equal(rolled(joints[None], camera), joints)


def test_a_joint_behind_the_camera_stays_in_the_middle(camera):
    joints = np.array([6.0, 0.0, 1.0]) + np.arange(5)[:, None, None, None] * np.array([0.0, 0.1, 0.0])
    np.testing.assert_allclose(rolled(joints, camera)[0, 0], [6.0, 0.2, 1.0])


def test_every_row_comes_from_its_band():
    bands = [np.full((8, 4, 3), k, np.uint8) for k in range(4)]
    assert stitched(bands)[:, 0, 0].tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert stitched(bands[:1]) is bands[0]
