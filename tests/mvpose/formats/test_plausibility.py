"""What cannot belong to a rig is refused before anything is estimated."""

from dataclasses import replace

import numpy as np
import pytest
from people import look_at, ring

from mvpose import Rig
from mvpose.formats.detections.plausibility import (
    UNKNOWN_SIZE,
    check_extents,
    check_principal_points,
    check_up,
    turned_up,
    up_axis,
    with_sizes,
)

RIG = ring(4)  # 1280 x 960
INSIDE = np.array([[[20.0, 10.0], [1240.0, 940.0]]] * 4)


def unsized(rig):
    return Rig([replace(camera, size=UNKNOWN_SIZE) for camera in rig])


class TestSizes:
    def test_unknown_sizes_hold_all_keypoints_around_the_principal_point(self):
        rig, note = with_sizes(unsized(RIG), INSIDE)
        assert {camera.size for camera in rig} == {(1280, 960)}  # principal points in the middle of 1280 x 960
        assert "1280 x 960" in note
        wider = INSIDE.copy()
        wider[2, 1, 0] = 1500.5
        assert with_sizes(unsized(RIG), wider)[0][0].size == (1502, 960)

    def test_stated_sizes_stay_and_given_ones_fill_the_rest(self):
        mixed = Rig([RIG[0], *unsized(RIG).cameras[1:]])
        rig, note = with_sizes(mixed, INSIDE, size=(1300, 1000))
        assert [camera.size for camera in rig] == [(1280, 960), *[(1300, 1000)] * 3]
        assert note == ""
        assert with_sizes(RIG, INSIDE)[0] is RIG


class TestRefusals:
    def test_width_and_height_that_are_exchanged(self):
        rig = ring(3, size=(1280, 960))
        turned = Rig([replace(camera, size=(960, 1280)) for camera in rig])
        check_principal_points(rig)
        with pytest.raises(ValueError, match=r"camera 'cam0': .*width and height of the calibration are exchanged"):
            check_principal_points(turned)

    def test_a_principal_point_outside_its_picture(self):
        K = RIG[1].K.copy()
        K[0, 2] = 5000.0
        rig = Rig([RIG[0], replace(RIG[1], K=K), *RIG.cameras[2:]])
        with pytest.raises(ValueError, match=r"camera 'cam1': the principal point \(5000, 479.5\) lies outside"):
            check_principal_points(rig)
        check_principal_points(RIG)

    def test_normalised_keypoints(self):
        with pytest.raises(ValueError, match=r"camera 'cam0': the keypoints lie between .* they are normalised"):
            check_extents(RIG, INSIDE / [1280.0, 960.0])

    def test_pictures_of_another_size(self):
        with pytest.raises(ValueError, match="keypoints reach 1860, 1410, beyond its picture of 1280 x 960"):
            check_extents(RIG, 1.5 * INSIDE)
        with pytest.raises(ValueError, match="far outside"):
            check_extents(RIG, INSIDE - 600.0)

    def test_keypoints_slightly_beside_the_picture_and_cameras_without_any_are_fine(self):
        beside = INSIDE + [[[-40.0, -30.0], [60.0, 40.0]]]
        beside[3] = np.nan
        check_extents(RIG, beside)


class TestUp:
    @pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
    def test_a_world_is_recognised_and_turned_so_that_z_is_up(self, up):
        axis = np.roll([0.0, 0.0, 1.0 - 2.0 * up.startswith("-")], "xyz".index(up[-1]) + 1)
        turned = turned_up(RIG, up)  # what is z in RIG was the axis `up` of the file
        np.testing.assert_allclose([np.linalg.det(camera.R) for camera in turned], 1.0)
        for before, after in zip(RIG, turned, strict=True):  # a point on the file's axis is on our z axis
            np.testing.assert_allclose(before.R @ axis, after.R @ [0, 0, 1.0], atol=1e-12)
        of_file = Rig([replace(camera, R=camera.R @ turn_to(axis)) for camera in RIG])
        assert up_axis(of_file) == up
        assert up_axis(turned_up(of_file, up)) == "z"

    def test_other_axes_are_refused_with_the_option(self):
        with pytest.raises(ValueError, match=r"the -y axis .* --up=-y"):
            check_up(Rig([replace(camera, R=camera.R @ turn_to(np.array([0.0, -1.0, 0.0]))) for camera in RIG]))
        check_up(RIG)
        with pytest.raises(ValueError, match="--up must be one of x, y, z"):
            turned_up(RIG, "w")

    def test_cameras_that_look_down_say_nothing(self):
        down = [
            look_at([x, y, 5.0], [x + 0.01 * x, y + 0.01 * y, 0.0]) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        assert up_axis(Rig(down)) is None


def turn_to(axis):
    """A rotation whose transpose takes z to ``axis``: the world of a file in which this axis points up."""
    other = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.5 else np.array([0.0, 1.0, 0.0])
    return np.stack([other, np.cross(axis, other), axis])
