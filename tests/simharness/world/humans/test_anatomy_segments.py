import numpy as np
import pytest

from simharness.world.humans.anatomy import Segment, segments_of_bones, segments_of_faces
from simharness.world.humans.body import FacePart, make_body
from simharness.world.humans.clothing import dress
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import draw_looks


@pytest.fixture(scope="module")
def body():
    return make_body(Shape())


def test_every_segment_shows_and_lies_between_its_joints(body):
    """The faces of a limb segment reach from joint to joint, give or take the blending of skinning weights."""
    middle = body.vertices[body.faces].mean(1)
    chains = {"UPPER_ARM": ("Arm", "ForeArm"), "FOREARM": ("ForeArm", "Hand"), "THIGH": ("UpLeg", "Leg")}
    chains["SHANK"] = ("Leg", "Foot")
    for name, bones in chains.items():
        for side in ("Left", "Right"):
            centers = middle[body.segments == Segment[f"{side.upper()}_{name}"]]
            first, last = (body.heads[body.index(side + bone)] for bone in bones)
            axis = last - first
            along = (centers - first) @ axis / (axis @ axis)
            assert -0.3 < along.min() < 0.2, name
            assert 0.8 < along.max() < 1.25, name
            assert (np.sign(centers[:, 1]) == (1 if side == "Left" else -1)).mean() > 0.99


def test_left_and_right_segments_have_similar_numbers_of_faces(body):
    count = np.bincount(body.segments, minlength=len(Segment))
    assert (count > 100).all()
    for segment in Segment:
        if segment.name.startswith("LEFT"):
            other = Segment[segment.name.replace("LEFT", "RIGHT")]
            assert count[segment] == pytest.approx(count[other], rel=0.12)


def test_face_hands_and_soles_belong_to_head_hands_and_feet(body):
    for parts, segments in (
        ([FacePart.SCALP, FacePart.LIPS, FacePart.IRIS, FacePart.BROW], {Segment.HEAD}),
        ([FacePart.SOLE], {Segment.LEFT_FOOT, Segment.RIGHT_FOOT}),
    ):
        assert set(body.segments[np.isin(body.part, parts)].tolist()) == segments
    hand = body.part == FacePart.HAND
    left = body.vertices[body.faces[hand]].mean(1)[:, 1] > 0
    for side, segment in ((left, Segment.LEFT_HAND), (~left, Segment.RIGHT_HAND)):
        assert (body.segments[hand][side] == segment).mean() > 0.97


def test_faces_of_clothes_and_hair_have_segments(body):
    for look in draw_looks(0, 6):
        dressed = dress(body, look)
        assert dressed.segments.shape == (len(dressed.faces),)
        assert dressed.segments.dtype == np.int8
        same = dressed.segments[: len(body.faces)] == body.segments
        assert same.all()
        assert np.isin(dressed.segments[dressed.part == FacePart.SCALP], [Segment.HEAD]).all()


def test_a_face_belongs_to_the_segment_with_the_larger_weight():
    faces, bones = [[0, 1, 2], [1, 2, 3]], ("Hips", "LeftArm", "LeftArmTwist", "Nothing")
    weight_bones = np.array([[1, 0], [1, 0], [0, 2], [0, 3]])
    weights = np.array([[0.9, 0.1], [0.6, 0.4], [0.7, 0.3], [1.0, 0.0]])
    assert segments_of_bones(bones).tolist() == [
        Segment.TORSO,
        Segment.LEFT_UPPER_ARM,
        Segment.LEFT_UPPER_ARM,
        Segment.TORSO,
    ]
    # First face: arm 0.9 + 0.6 + 0.3 against torso 1.2; second face: arm 0.6 + 0.3 against torso 2.1.
    segments = segments_of_faces(faces, weight_bones, weights, bones=bones)
    assert segments.tolist() == [Segment.LEFT_UPPER_ARM, Segment.TORSO]
