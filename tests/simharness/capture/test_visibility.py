"""Visibility of joints in scenes where the answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import _mesh, ball, box, room, sheet
from test_renderers import camera_at

from simharness.capture.joint_visibility import classify, label_joints
from simharness.types.views import Visibility

VISIBLE, SELF, PERSON, CLUTTER, OUTSIDE = Visibility
CAMERA = camera_at((3.5, 0.0, 1.0), (0.0, 0.0, 1.0), size=(320, 240), fov=60.0)


def labels(raster, meshes, joints, radii, camera=CAMERA):
    """Label ``joints`` with ``radii`` of each person; the first meshes are the people."""
    joints = np.array(joints, float)
    return label_joints(
        raster.render(camera, meshes), camera, joints=joints, radii=np.broadcast_to(radii, joints.shape[:2])
    )


def test_a_joint_inside_its_own_limb_is_visible(raster):
    limb = ball((0, 0, 1), 0.1)
    assert labels(raster, [limb], [[(0, 0, 1)]], 0.15).tolist() == [[VISIBLE]]


@pytest.mark.parametrize(("depth", "expected"), [(0.05, VISIBLE), (0.14, VISIBLE), (0.20, SELF), (0.5, SELF)])
def test_a_joint_deep_in_its_body_is_self_occluded(raster, depth, expected):
    trunk = ball((0, 0, 1), 0.4)
    joint = (0.4 - depth, 0, 1)  # at this depth under the skin that faces the camera
    assert labels(raster, [trunk], [[joint]], 0.15).tolist() == [[expected]]


def test_the_allowance_is_along_the_ray_not_along_the_axis(raster):
    camera = camera_at((2.0, 0.0, 1.0), (0.0, 0.0, 1.0), size=(320, 240), fov=100.0)
    ray = camera.rays((300.0, 120.0))
    away = camera.center + 2.0 * ray
    wall = sheet([away + s * np.cross(ray, (0, 0, 1)) + (0, 0, t) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    cosine = ray @ camera.R[2]
    assert cosine < 0.7
    inside, beyond = away + 0.135 * ray, away + 0.145 * ray  # the limit is 0.1 + the margin of 4 cm
    assert labels(raster, [wall], [[inside, beyond]], 0.1, camera).tolist() == [[VISIBLE, SELF]]


def test_a_person_behind_a_wall_is_hidden_by_clutter(raster):
    person, wall = ball((0, 0, 1), 0.2), box((2, 0, 1), (0.1, 1, 1))
    assert labels(raster, [person, wall], [[(0, 0, 1)]], 0.3).tolist() == [[CLUTTER]]


def test_a_thin_board_occludes_only_what_is_behind_it(raster):
    person = ball((0, 0, 1), 0.3, stretch=2.0)
    board = box((1, 0, 1.4), (0.01, 1, 0.3))
    low, high = (0.0, 0, 0.8), (0.0, 0, 1.49)
    assert labels(raster, [person, board], [[low, high]], 0.35).tolist() == [[VISIBLE, CLUTTER]]


def test_the_nearer_of_two_people_occludes_the_other(raster):
    near, far = ball((1, 0, 1), 0.2), ball((-1, 0, 1), 0.2)
    joints = [[(1, 0, 1)], [(-1, 0, 1)]]
    assert labels(raster, [near, far], joints, 0.3).tolist() == [[VISIBLE], [PERSON]]
    assert labels(raster, [far, near], joints[::-1], 0.3).tolist() == [[PERSON], [VISIBLE]]


def test_touching_people_occlude_each_other_without_margin(raster):
    """The arm of another person 11 cm in front occludes a joint; skin of the same body would not."""
    arm, chest = ball((0.26, 0, 1), 0.05), ball((0, 0, 1), 0.25)
    joint = (0.2, 0, 1)
    assert labels(raster, [chest, arm], [[joint], [(0.26, 0, 1)]], 0.15).tolist() == [[PERSON], [VISIBLE]]


def test_a_joint_just_outside_the_outline_is_visible(raster):
    limb, other, walls = ball((0, 0, 1), 0.03), ball((-1, 0, 1), 0.5), room()
    off = (0, 0.034, 1)  # beside its own ball, which the camera sees edge on
    assert labels(raster, [limb, other, walls], [[off], [(-1, 0, 1)]], 0.05).tolist()[0] == [VISIBLE]
    assert labels(raster, [limb, walls], [[off]], 0.05).tolist() == [[VISIBLE]]
    assert labels(raster, [limb], [[off]], 0.05).tolist() == [[VISIBLE]]  # nothing at all behind it


def test_walls_occlude_people_behind_them(raster):
    assert labels(raster, [ball((0, 9, 1), 0.3), room()], [[(-8, 0, 1)]], 0.3).tolist() == [[CLUTTER]]


def test_the_border_of_the_image(raster):
    """The image ends half a pixel beyond the centres of its outermost pixels."""
    width, height = CAMERA.size
    pixels = np.array(
        [(-0.49, 50), (-0.51, 50), (width - 0.51, 50), (width - 0.49, 50), (50, -0.51), (50, height - 0.51)]
    )
    places = CAMERA.center + 2 * CAMERA.rays(pixels)
    found = labels(raster, [room()], [places], 0.1)[0]
    assert found.tolist() == [VISIBLE, OUTSIDE, VISIBLE, OUTSIDE, OUTSIDE, VISIBLE]


def test_behind_the_camera_is_outside(raster):
    behind = CAMERA.center - 2 * CAMERA.R[2]
    assert labels(raster, [ball(behind, 0.2)], [[behind, CAMERA.center]], 0.3).tolist() == [[OUTSIDE, OUTSIDE]]


@pytest.mark.parametrize(
    ("bearing", "seen", "hidden"),
    [
        (0, "nose left_eye right_eye", ""),
        (180, "", "nose left_eye right_eye"),
        (90, "left_ear left_eye", "right_ear right_eye right_shoulder right_hip"),
        (-90, "right_ear right_eye", "left_ear left_eye left_shoulder left_hip"),
    ],
    ids=["from the front", "from behind", "from the left", "from the right"],
)
def test_a_body_seen_from_all_sides(raster, bearing, seen, hidden):
    """With the arms slightly off the body, joints of the near side are visible, and limbs from front and back."""
    from mvpose.skeleton import COCO17
    from simharness.types.random_streams import stream
    from simharness.world.humans.body import make_body
    from simharness.world.humans.population import draw_shape

    body = make_body(draw_shape(stream(1, "test")))
    rest = np.broadcast_to(np.eye(3, 4), (len(body.bones), 3, 4))
    skin = _mesh(body.skin(rest), body.faces, (0.7, 0.6, 0.5), smooth=True)
    turn = np.radians(bearing)
    camera = camera_at((4 * np.cos(turn), 4 * np.sin(turn), 1.5), (0, 0, 0.9), size=(800, 600))
    found = labels(raster, [skin], body.joints(rest)[None], body.joint_radii, camera)[0]
    # In the rest pose the forearms point slightly forwards: from behind, they occlude the wrists.
    limbs = [name for name in COCO17.joints[5:] if bearing == 0 or (bearing == 180 and "wrist" not in name)]
    assert {
        name: found[COCO17.index(name)] for name in seen.split() + limbs if found[COCO17.index(name)] != VISIBLE
    } == {}
    assert {name: found[COCO17.index(name)] for name in hidden.split() if found[COCO17.index(name)] != SELF} == {}


def test_classification_of_surfaces():
    """Rows: two people with one joint each. Owner of the surface, distance in front, whether in the picture."""
    radii = np.array([[0.1], [0.02]])
    for owner, in_front, inside, expected in (
        ([0, 1], [0.139, 0.059], [True, True], [VISIBLE, VISIBLE]),  # own skin, up to the radius and 4 cm
        ([0, 1], [0.141, 0.061], [True, True], [SELF, SELF]),
        ([1, 0], [0.001, 0.001], [True, True], [PERSON, PERSON]),
        ([2, 9], [0.001, 3.0], [True, True], [CLUTTER, CLUTTER]),
        ([1, 2], [-0.001, -1.0], [True, True], [VISIBLE, VISIBLE]),  # behind the joint
        ([-1, -1], [-np.inf, -np.inf], [True, False], [VISIBLE, OUTSIDE]),
        ([0, 2], [1.0, 1.0], [False, False], [OUTSIDE, OUTSIDE]),
    ):
        column = [np.array(values)[:, None] for values in (owner, in_front, inside)]
        assert classify(*column, radii=radii)[:, 0].tolist() == expected
        views = [np.stack([each, each]) for each in column]  # of several views at once
        assert classify(*views, radii=radii)[1, :, 0].tolist() == expected


def test_without_people(raster):
    assert labels(raster, [room()], np.zeros((0, 17, 3)), 0.1).shape == (0, 17)


def test_shapes_are_checked(raster):
    image = raster.render(CAMERA, [])
    with pytest.raises(ValueError, match=r"joints must be \(P, J, 3\)"):
        label_joints(image, CAMERA, joints=np.zeros((17, 3)), radii=np.zeros(17))
    with pytest.raises(ValueError, match="320 x 240 pixels, got 160 x 120"):
        label_joints(
            raster.render(camera_at((1, 1, 1), (0, 0, 0)), []), CAMERA, joints=np.zeros((1, 1, 3)), radii=[[0.1]]
        )
