"""Joints of feet and hands of the body model."""

import typing

import numpy as np
import pytest

from mvpose.wholebody import skeleton_by_name
from simharness.capture.outer_views import OuterJoints
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.world.humans.body import make_body
from simharness.world.humans.shape import Shape

SHAPES = {"man": Shape(gender=0.0, weight=0.7), "woman": Shape(gender=1.0, weight=1.1), "child": Shape(age=0.3)}
FINGERS = [range(1 + 4 * finger, 5 + 4 * finger) for finger in range(5)]  # thumb to little finger, palm to tip


@pytest.fixture(scope="module", params=SHAPES)
def person(request):
    body = make_body(SHAPES[request.param])
    rest = np.tile(np.eye(3, 4), (len(body.bones), 1, 1))
    joints = OuterJoints.of_body(body, skeleton_by_name("wholebody133"))
    return body, dict(zip(joints.names, joints.at(rest), strict=True)), body.joints(rest)


def test_toes_are_in_front_of_heels_and_all_of_them_are_at_the_floor(person):
    """The rest body stands on z = 0, faces +x and has its left side at +y."""
    body, place, coco = person
    for side, out in (("left", 1), ("right", -1)):
        big, small, heel = (place[f"{side}_{joint}"] for joint in ("big_toe", "small_toe", "heel"))
        ankle = coco[15 if side == "left" else 16]
        assert big[0] > small[0] > ankle[0] > heel[0]
        assert out * small[1] > out * big[1]  # the small toe is on the outer side
        assert 0 < max(big[2], small[2]) < heel[2] < 0.55 * ankle[2] < 0.06
        # ANSUR II: foot length 0.154 of stature, with flesh and skin before the toe and behind the heel
        assert np.linalg.norm(big - heel) / body.stature == pytest.approx(0.14, abs=0.015)


def test_hands_have_the_proportions_of_people(person):
    body, place, coco = person
    for side, wrist in (("left", coco[9]), ("right", coco[10])):
        hand = np.array([place[f"{side}_hand_{joint}"] for joint in range(21)])
        assert np.linalg.norm(hand[0] - wrist) < 0.02
        reach = np.linalg.norm(hand - hand[0], axis=1)
        for finger in FINGERS:
            assert (np.diff(reach[finger]) > 0).all()  # outward from joint to joint
        tips = reach[[4, 8, 12, 16, 20]]
        assert tips.argmax() == 2  # the middle finger
        assert tips.argmin() in (0, 4)
        bones = [np.linalg.norm(np.diff(hand[finger], axis=0), axis=1).sum() for finger in FINGERS]
        straight = reach[9] + bones[2]  # fingers are half open
        assert straight / body.stature == pytest.approx(0.11, abs=0.015)  # hand length, ANSUR II


def test_left_and_right_are_mirror_images(person):
    _, place, _ = person
    for name, where in place.items():
        if name.startswith("left_"):
            mirrored = place[name.replace("left", "right", 1)] * [1, -1, 1]
            np.testing.assert_allclose(where, mirrored, atol=0.003, err_msg=name)


def test_joints_move_with_their_bones(person):
    body, _, _ = person
    joints = OuterJoints.of_body(body, skeleton_by_name("wholebody133"))
    transforms = np.tile(np.eye(3, 4), (len(body.bones), 1, 1))
    rest = joints.at(transforms)
    for bone in ("LeftHand", "LThumb", "LeftFingerBase", "LeftHandFinger1"):
        transforms[body.index(bone), :, 3] = [0.1, 0.2, 0.3]
    moved = np.linalg.norm(joints.at(transforms) - rest, axis=-1)
    fingers = [name.startswith("left_hand") and name.split("_")[2] not in ("0", "1") for name in joints.names]
    np.testing.assert_allclose(moved[fingers], np.linalg.norm([0.1, 0.2, 0.3]), rtol=0.05)
    others = [not name.startswith("left_hand") and not name.startswith("face") for name in joints.names]
    assert moved[others].max() < 1e-6  # metres: weights of the skin are stored in 16 bits


@pytest.mark.parametrize("name", typing.get_args(DetectorSection.model_fields["skeleton"].annotation)[1:])
def test_every_joint_but_those_of_the_face_is_known(name):
    body = make_body(Shape())
    joints = OuterJoints.of_body(body, skeleton_by_name(name))
    faces = np.array([joint.startswith("face_") for joint in joints.names])
    np.testing.assert_array_equal(joints.known, ~faces)
    assert (joints.depths[~faces] >= 0.015).all()
    assert np.isnan(joints.at(np.tile(np.eye(3, 4), (len(body.bones), 1, 1)))[faces]).all()


def test_neck_and_hips_are_the_middles_of_both_sides():
    body = make_body(Shape())
    rest = np.tile(np.eye(3, 4), (len(body.bones), 1, 1))
    coco = body.joints(rest)
    joints = OuterJoints.of_body(body, skeleton_by_name("halpe26"))
    place = dict(zip(joints.names, joints.at(rest), strict=True))
    np.testing.assert_allclose(place["neck"], coco[5:7].mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(place["hip"], coco[11:13].mean(axis=0), atol=1e-12)
    assert place["head"][2] == pytest.approx(body.stature, abs=0.006)
