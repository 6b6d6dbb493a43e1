import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walkers import ring

from simharness.world.motion.motion import Trajectory
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import box_mesh, box_model
from simharness.world.scene.placement.sight_lines import PictureFill, SightLines, intersects, lines_of_sight

numbers = st.floats(-2, 2)


@given(x=numbers, y=numbers, yaw=st.floats(-3, 3), seed=st.integers(0, 99))
def test_boxes_cut_lines_as_the_slab_test(x, y, yaw, seed):
    box = Box((x, y, 0.5), (0.4, 0.2, 0.5), yaw)
    ends = np.random.default_rng(seed).uniform(-2, 2, (2, 200, 3))
    starts, ends = ends[0] + [0, 0, 0.5], ends[1] + [0, 0, 0.5]
    a, b = (starts - box.center) @ box.axes, (ends - box.center) @ box.axes
    one, two = (-np.array(box.half) - a) / (b - a), (np.array(box.half) - a) / (b - a)
    into, out = np.minimum(one, two).max(axis=1), np.maximum(one, two).min(axis=1)
    crosses = (into <= out) & (((into >= 0) & (into <= 1)) | ((out >= 0) & (out <= 1)))
    assert (
        intersects(box_mesh([box], np.full((1, 3), 0.5)), starts, ends) == crosses
    ).mean() > 0.995  # except at the edges


def test_no_lines_and_no_faces():
    mesh = box_mesh([Box((0.0, 0.0, 0.5), (0.5, 0.5, 0.5))], np.full((1, 3), 0.5))
    assert intersects(mesh, np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_a_moving_solid_cuts_lines_at_its_position_in_time():
    model = box_model([Box((0, 0, 0.5), (0.2, 0.1, 0.5))], [(0.5, 0.5, 0.5)])
    turned = np.sqrt(0.5)
    poses = np.array([[0.0, 0, 0, 1, 0, 0, 0], [2.0, 0, 0, turned, 0, 0, turned]])
    solid = model.along(Trajectory(np.array([0.0, 1.0]), poses), kind="clutter", name="it")
    starts = np.array([[0.15, -1, 0.5], [0.15, -1, 0.5], [2.15, -1, 0.5], [2.05, -1, 0.5], [2.0, -1, 1.2]])
    lines = SightLines(starts, starts + [0, 2, 0], np.array([0.0, 1.0, 1.0, 1.0, 1.0]))
    np.testing.assert_array_equal(lines.cut_by(solid), [True, False, False, True, False])


def test_lines_of_sight_end_at_joints_in_the_pictures():
    rig = ring(3)
    joints = np.array([[[[0.0, 0, 1.0]]], [[[0.0, 0, 40.0]]]])
    lines = lines_of_sight(rig, np.array([2.0, 3.0]), joints)
    np.testing.assert_allclose(lines.starts, rig.centers)
    np.testing.assert_allclose(lines.ends, np.tile([0, 0, 1.0], (3, 1)))
    np.testing.assert_array_equal(lines.time, 2.0)


def test_a_wall_in_front_of_a_camera_fills_its_picture():
    rig = ring(4)
    plate = box_model([Box((2.9, 0, 2.0), (0.01, 0.7, 2.0))], [(0.5, 0.5, 0.5)])
    wall = plate.at((0, 0), 0.0, kind="clutter", name="w")
    pictures = PictureFill(rig)
    assert not pictures.allows(wall, 0.6)
    pictures.add(wall)
    filled = pictures.filled.mean(axis=1)
    assert filled[0] > 0.9
    assert filled[1:].max() < 0.4
    assert pictures.allows(wall, 0.6)  # adding it again changes nothing


def test_the_share_of_a_picture_is_that_of_its_area():
    """A square board in front of a pinhole camera: its share follows from its side and distance."""
    rig = ring(2, height=0.9)
    plate = box_model([Box((2.5, 0, 0.9), (0.0005, 0.4, 0.3))], [(0.5, 0.5, 0.5)])
    board = plate.at((0, 0), 0.0, kind="clutter", name="b")
    pictures = PictureFill(rig)
    pictures.add(board)
    expected = (0.8 * 520) * (0.6 * 520) / (800 * 600)
    assert pictures.filled[0].mean() == pytest.approx(expected, abs=0.05)
