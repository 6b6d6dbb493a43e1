from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.rigs.layouts import build_rig, intrinsics, look_at
from simharness.scenario.models import Cameras

POINT = st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(0, 3))


def test_ring_cameras_stand_where_the_scenario_says():
    rig = build_rig(Cameras(count=4, radius=3.0, height=2.0, start=30.0))
    bearings = np.radians([30, 120, 210, 300])
    np.testing.assert_allclose(
        rig.centers[:, :2], 3 * np.column_stack([np.cos(bearings), np.sin(bearings)]), atol=1e-12
    )
    np.testing.assert_allclose(rig.centers[:, 2], 2.0)
    assert [camera.name for camera in rig] == ["cam0", "cam1", "cam2", "cam3"]


@given(aim=POINT, height=st.floats(0.1, 6), start=st.floats(-360, 360))
def test_cameras_look_at_the_aim_and_hang_upright(aim, height, start):
    rig = build_rig(Cameras(radius=8.0, height=height, aim=aim, start=start, size=(640, 480)))
    for camera in rig:
        u, v = camera.project(aim)
        assert (u, v) == (pytest.approx(319.5), pytest.approx(239.5))
        above = camera.project(np.add(aim, (0, 0, 0.2)))
        assert above[0] == pytest.approx(319.5)  # the vertical through the aim is vertical in the image
        assert above[1] < 239.5  # and up is up
        assert camera.R[0, 2] == pytest.approx(0)  # level horizon
        assert np.linalg.det(camera.R) == pytest.approx(1)


@pytest.mark.parametrize("fov", [30.0, 75.0, 120.0])
def test_the_field_of_view_spans_the_pixels_from_edge_to_edge(fov):
    size = (801, 600)
    camera = look_at((3, 0, 1), (0, 0, 1), K=intrinsics(fov, size), size=size)
    left, right = camera.rays([(-0.5, 299.5), (800.5, 299.5)])
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(fov)
    assert camera.K[0, 0] == camera.K[1, 1]


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_cameras_are_refused(count):
    with pytest.raises(ValueError, match=f"at least 2 cameras to triangulate, got {count}"):
        build_rig(Cameras(count=count))


@pytest.mark.parametrize("aim", [(3.5, 0.0, 0.5), (3.5, 0.0, 2.2), (3.5, 0.0, 4.0)], ids=["below", "in", "above"])
def test_an_aim_straight_above_or_below_a_camera_is_refused(aim):
    with pytest.raises(ValueError, match=r"'cam0' .* upright"):
        build_rig(Cameras(radius=3.5, height=2.2, aim=aim))
