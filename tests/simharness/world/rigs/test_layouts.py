from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.world.rigs.layouts import build_rig, intrinsics, look_at

POINT = st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(0, 3))


def test_ring_cameras_stand_at_the_given_positions():
    rig = build_rig(CamerasSection(count=4, radius=3.0, height=2.0, start=30.0))
    bearings = np.radians([30, 120, 210, 300])
    np.testing.assert_allclose(
        rig.centers[:, :2], 3 * np.column_stack([np.cos(bearings), np.sin(bearings)]), atol=1e-12
    )
    np.testing.assert_allclose(rig.centers[:, 2], 2.0)
    assert [camera.name for camera in rig] == ["cam0", "cam1", "cam2", "cam3"]


@given(aim=POINT, height=st.floats(0.1, 6), start=st.floats(-360, 360))
def test_cameras_look_at_the_aim_and_are_upright(aim, height, start):
    rig = build_rig(CamerasSection(radius=8.0, height=height, aim=aim, start=start, size=(640, 480)))
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
    with pytest.raises(ValueError, match=f"cameras.count = {count}: expected at least 2"):
        build_rig(CamerasSection(count=count))


def test_an_aim_at_a_camera_is_refused():
    with pytest.raises(ValueError, match=r"'cam0' .* is at the point that it looks at: move cameras.aim"):
        build_rig(CamerasSection(radius=3.5, height=2.2, aim=(3.5, 0.0, 2.2)))


@pytest.mark.parametrize("height", [0.1, 4.0])
def test_image_x_is_world_x_for_vertical_views(height):
    camera = look_at((1, 2, height), (1, 2, 1), K=intrinsics(75, (641, 481)), size=(641, 481))
    np.testing.assert_allclose(camera.project((1, 2, 1)), (320, 240), atol=1e-9)
    u, v = camera.project((1.1, 2, 1))
    assert u > 321
    assert v == pytest.approx(240)
    assert np.linalg.det(camera.R) == pytest.approx(1)


LAYOUTS = ("ring", "arc", "line", "corners", "dome", "pairs")


@given(
    layout=st.sampled_from(LAYOUTS),
    count=st.integers(1, 32).map(lambda half: 2 * half),
    aim=POINT,
    start=st.floats(-360, 360),
    heights=st.lists(st.floats(0.5, 2.0), max_size=3),
)
def test_cameras_of_every_layout_are_apart_and_look_at_the_aim(layout, count, aim, start, heights):
    cameras = CamerasSection(
        layout=layout, count=count, aim=aim, start=start, heights=tuple(heights), radius=9.0, height=4.5
    )
    rig = build_rig(cameras)
    assert len(rig) == count
    for camera in rig:
        np.testing.assert_allclose(camera.project(aim), (399.5, 299.5), atol=1e-6)
        assert np.linalg.det(camera.R) == pytest.approx(1)
    if not heights:
        gaps = np.linalg.norm(rig.centers[:, None] - rig.centers, axis=-1)[np.triu_indices(count, 1)]
        assert gaps.min() > 0.05
    elif layout != "dome":
        assert rig.centers[:, 2] == pytest.approx(np.resize(heights, count))


def bearings(rig):
    return np.degrees(np.arctan2(rig.centers[:, 1], rig.centers[:, 0]))


def test_an_arc_spreads_from_its_first_to_its_last_camera():
    rig = build_rig(CamerasSection(layout="arc", count=4, start=-60, spread=120, radius=3))
    assert bearings(rig) == pytest.approx([-60, -20, 20, 60])
    assert np.hypot(*rig.centers[:, :2].T) == pytest.approx(3)
    with pytest.raises(ValueError, match=r"cameras\.spread = 360 puts the last camera of the arc on the first"):
        build_rig(CamerasSection(layout="arc", spread=360.0))


def test_a_line_is_straight_at_the_given_distance():
    rig = build_rig(CamerasSection(layout="line", count=5, spacing=0.7, radius=3, start=-90))
    np.testing.assert_allclose(rig.centers[:, 0], [-1.4, -0.7, 0, 0.7, 1.4], atol=1e-12)
    np.testing.assert_allclose(rig.centers[:, 1], -3)


def test_corners_come_first_then_the_middles_of_the_walls():
    rig = build_rig(CamerasSection(layout="corners", count=8), room=(8, 6, 3))
    x, y = 3.75, 2.75
    expected = [(x, y), (-x, y), (-x, -y), (x, -y), (0, y), (-x, 0), (0, -y), (x, 0)]
    np.testing.assert_allclose(rig.centers[:, :2], expected, atol=1e-12)
    open_floor = build_rig(CamerasSection(layout="corners", count=2, radius=5))
    np.testing.assert_allclose(open_floor.centers[:, :2], [(5, 5), (-5, 5)])
    with pytest.raises(ValueError, match=r"room\.size is too small"):
        build_rig(CamerasSection(layout="corners"), room=(0.4, 3, 3))


def test_a_dome_is_even_by_area_on_its_ellipsoid():
    rig = build_rig(CamerasSection(layout="dome", count=60, radius=4, height=3, aim=(0, 0, 1)))
    x, y, z = rig.centers.T
    np.testing.assert_allclose((x**2 + y**2) / 16 + z**2 / 9, 1, atol=1e-12)
    assert z[-1] == z.max() == pytest.approx(3)
    assert np.diff(z) == pytest.approx(2 / 59)  # uniform in height is uniform in area (Archimedes)
    quadrants = np.histogram(bearings(rig), bins=4, range=(-180, 180))[0]
    assert quadrants.min() >= 13
    with pytest.raises(ValueError, match=r"cameras\.heights reaches 4 m, above the top of the dome"):
        build_rig(CamerasSection(layout="dome", heights=(1.0, 4.0)))
    with pytest.raises(ValueError, match=r"cameras\.height = -1: a dome needs a height"):
        build_rig(CamerasSection(layout="dome", height=-1.0))


def test_pairs_stand_side_by_side():
    rig = build_rig(CamerasSection(layout="pairs", count=6, spacing=0.4, radius=3, start=10, aim=(0, 0, 1)))
    left, right = rig.centers[::2], rig.centers[1::2]
    assert np.linalg.norm(left - right, axis=1) == pytest.approx(0.4)
    middle = (left + right) / 2
    assert np.degrees(np.arctan2(middle[:, 1], middle[:, 0])) == pytest.approx([10, 130, -110])
    assert np.hypot(*middle[:, :2].T) == pytest.approx(3)
    assert ((left - right) * middle).sum(axis=1) == pytest.approx(0)
    with pytest.raises(ValueError, match=r"cameras\.count = 5: pairs need an even number"):
        build_rig(CamerasSection(layout="pairs", count=5))


def test_free_cameras_have_the_given_positions_and_aims():
    positions, aims = ((3.0, 0.0, 1.0), (0.0, 3.0, 2.0)), ((0.0, 0.0, 1.0), (1.0, 1.0, 0.5))
    rig = build_rig(CamerasSection(layout="free", positions=positions, aims=aims))
    np.testing.assert_allclose(rig.centers, positions, atol=1e-12)
    for camera, aim in zip(rig, aims, strict=True):
        np.testing.assert_allclose(camera.project(aim), (399.5, 299.5))
    with pytest.raises(ValueError, match=r"cameras\.aims has 1 points and cameras\.positions 2"):
        build_rig(CamerasSection(layout="free", positions=positions, aims=aims[:1]))
    with pytest.raises(ValueError, match=r"needs cameras\.positions"):
        build_rig(CamerasSection(layout="free"))


def test_jitter_has_the_given_spread_and_keeps_its_draws():
    def off(jitter, count=64, seed=3):
        cameras = CamerasSection(count=count, radius=9.0, jitter=jitter)
        return build_rig(cameras, seed=seed).centers - build_rig(cameras.model_copy(update={"jitter": 0.0})).centers

    assert off(0.1).std() == pytest.approx(0.1, rel=0.2)  # 192 draws: 4 standard deviations
    np.testing.assert_allclose(off(0.2), 2 * off(0.1), atol=1e-12)
    np.testing.assert_allclose(off(0.1, count=8), off(0.1)[:8], atol=1e-12)
    assert np.abs(off(0.1) - off(0.1, seed=4)).min() > 0


def test_aim_jitter_rotates_cameras_without_moving_them():
    still, turned = build_rig(CamerasSection(count=8)), build_rig(CamerasSection(count=8, aim_jitter=0.1))
    np.testing.assert_allclose(still.centers, turned.centers, atol=1e-12)
    for one, two in zip(still, turned, strict=True):
        angle = np.degrees(np.arccos(one.R[2] @ two.R[2]))
        assert 0.05 < angle < 10
        assert two.R[0, 2] == pytest.approx(0)
    both = build_rig(CamerasSection(count=8, jitter=0.1, aim_jitter=0.1))
    for one, two in zip(still, both, strict=True):  # errors of aim are independent of errors of position
        assert np.degrees(np.arccos(one.R[2] @ two.R[2])) > 0.05


def test_lenses_are_as_given():
    barrel = (-0.37, 0.15, 0.0, 0.0, 0.0)
    for camera in build_rig(CamerasSection(distortion=barrel)):
        assert camera.distortion.tolist() == list(barrel)


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ({"preset": "shelf"}, r"cameras\.preset is given without a layout: add cameras\.layout = 'preset'"),
        ({"positions": ((1.0, 0.0, 1.0),)}, r"add cameras\.layout = 'free'"),
        ({"file": "x.json"}, r"add cameras\.layout = 'file'"),
        ({"layout": "preset"}, r"needs cameras\.preset"),
        ({"layout": "file"}, r"needs cameras\.file"),
        (
            {"distortion": (-0.37, 0.0, 0.0, 0.0, 0.0)},
            r"cameras\.distortion: camera 'cam0': its lens, .* folds over 3\d\d pixels",
        ),
    ],
)
def test_invalid_values_are_named(cameras, message):
    with pytest.raises(ValueError, match=message):
        build_rig(CamerasSection(**cameras))
