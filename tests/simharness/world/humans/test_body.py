import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mvpose.skeleton import COCO17
from simharness.world.humans.body import PHENOTYPES, BodyModel, FacePart, body_model, make_body, volume
from simharness.world.humans.shape import Shape


@pytest.fixture(scope="module")
def body():
    return make_body(Shape(gender=0.2, weight=0.6, height=0.4))


@pytest.fixture(scope="module")
def transforms(body):
    """Independent random rigid transforms of the bones."""
    rng = np.random.default_rng(0)
    count = len(body.bones)
    turns = Rotation.random(count, random_state=1).as_matrix()
    return np.concatenate([turns, rng.normal(size=(count, 3, 1))], axis=2)


def identity(body):
    return np.tile(np.eye(3, 4), (len(body.bones), 1, 1))


def test_rest_body_stands_on_the_floor_with_its_pelvis_over_the_origin(body):
    assert body.vertices[:, 2].min() == pytest.approx(0, abs=1e-6)
    assert body.bones[0] == "Hips"
    np.testing.assert_allclose(body.heads[0, :2], 0, atol=1e-12)


def test_rest_body_faces_x_with_its_left_to_y(body):
    joint = dict(zip(COCO17.joints, body.joints(identity(body)), strict=True))
    assert joint["nose"][0] > joint["left_ear"][0] + 0.05
    assert joint["left_shoulder"][1] > 0.1
    assert joint["right_ankle"][1] < -0.05
    assert body.heads[body.index("LeftToeBase"), 0] > body.heads[body.index("LeftFoot"), 0] + 0.08


def test_identity_transforms_give_the_rest_vertices(body):
    np.testing.assert_allclose(body.skin(identity(body)), body.vertices, atol=1e-6)


def test_skinning_is_the_weighted_sum_of_bone_transforms(body, transforms):
    points = np.column_stack([body.vertices, np.ones(len(body.vertices))]).astype(float)
    moved = np.einsum("brc,nc->bnr", transforms, points)
    rows = np.arange(len(points))
    expected = sum(body.weights[:, k, None] * moved[body.weight_bones[:, k], rows] for k in range(4))
    np.testing.assert_allclose(body.skin(transforms), expected, atol=2e-5)


def test_joints_are_the_regressed_vertices_of_the_skinned_bare_body(body, transforms):
    model = body_model()
    vertices, heads = model.rest({name: getattr(body.shape, name) for name in PHENOTYPES})
    vertices = vertices + (body.heads[0] - heads[0])
    points = np.column_stack([vertices, np.ones(len(vertices))])
    blended = np.einsum("nk,nkrc->nrc", model.weights, transforms[model.weight_bones])
    skinned = np.einsum("nrc,nc->nr", blended, points)
    joint, vertex, weight = model.regressor
    expected = np.zeros((17, 3))
    np.add.at(expected, joint, weight[:, None] * skinned[vertex])
    np.testing.assert_allclose(body.joints(transforms), expected, atol=1e-6)


def test_joints_accept_any_number_of_poses(body, transforms):
    many = np.stack([identity(body), transforms, transforms]).reshape(3, 1, -1, 3, 4)
    joints = body.joints(many)
    assert joints.shape == (3, 1, 17, 3)
    np.testing.assert_allclose(joints[1, 0], body.joints(transforms), atol=1e-12)


@pytest.mark.parametrize(
    ("joint", "bone", "distance"),
    [
        ("shoulder", "Arm", 0.04),
        ("elbow", "ForeArm", 0.03),
        ("wrist", "Hand", 0.03),
        ("hip", "UpLeg", 0.05),
        ("knee", "Leg", 0.03),
        ("ankle", "Foot", 0.03),
    ],
)
@pytest.mark.parametrize("gender", [0.0, 1.0])
def test_keypoints_lie_at_the_bone_heads(joint, bone, distance, gender):
    body = make_body(Shape(gender=gender))
    joints = body.joints(identity(body))
    for side in ("left", "right"):
        gap = joints[COCO17.index(f"{side}_{joint}")] - body.heads[body.index(side.capitalize() + bone)]
        assert np.linalg.norm(gap) < distance


def test_body_is_mirror_symmetric(body):
    joints = body.joints(identity(body))
    np.testing.assert_allclose(joints[list(COCO17.mirror)] * [1, -1, 1], joints, atol=0.004)


def test_weights_sum_to_one_and_keypoints_are_affine(body):
    np.testing.assert_allclose(body.weights.sum(1), 1, atol=1e-6)
    np.testing.assert_allclose(body.keypoints[..., 3].sum(1), 1, atol=1e-6)


def test_faces_point_outwards(body):
    """The volume inside the clothed surface is positive and near that of the body; inside out it would be negative."""
    cloth = np.isin(body.part, [FacePart.TORSO, FacePart.ARM, FacePart.LEG, FacePart.SHOE, FacePart.SOLE])
    inside = 1000 * volume(body.vertices - body.vertices.mean(0), body.faces[cloth])
    assert 0.8 * body.mass < inside < 1.05 * body.mass  # litres; head and hands are left out


def test_mass_index_is_in_the_human_range(body):
    assert 17 < body.mass / body.stature**2 < 32


def test_volume_of_a_tetrahedron():
    corners = np.vstack([np.zeros(3), np.eye(3)]) + 5.0
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    assert volume(corners, faces) == pytest.approx(1 / 6)


def test_every_part_is_shown_on_both_sides(body):
    middle = body.vertices[body.faces].mean(1)
    for part in set(FacePart) - {FacePart.SKIRT} - {part for part in FacePart if part >= FacePart.GLASSES}:
        centers = middle[body.part == part]
        assert (centers[:, 1] > 0).sum() == pytest.approx((centers[:, 1] < 0).sum(), rel=0.1), part
        assert len(centers) > 10, part


def test_parts_are_where_they_belong(body):
    top, middle = body.stature, body.vertices[body.faces].mean(1)
    height = {part: middle[body.part == part, 2] for part in FacePart}
    assert height[FacePart.SOLE].max() < 0.03
    assert height[FacePart.SHOE].max() < 0.15
    assert height[FacePart.SCALP].mean() > 0.93 * top
    assert 0.4 * top < height[FacePart.TORSO].min() < 0.55 * top
    face = middle[np.isin(body.part, [FacePart.LIPS, FacePart.BROW, FacePart.IRIS])]
    assert face[:, 0].min() > body.heads[body.index("Head"), 0] + 0.03
    assert height[FacePart.LIPS].max() < height[FacePart.IRIS].min() < height[FacePart.BROW].max()


def test_joint_depths_are_plausible_limb_radii(body):
    radius = dict(zip(COCO17.joints, body.joint_radii, strict=True))
    assert 0.01 <= radius["nose"] < 0.03
    assert 0.02 < radius["left_wrist"] < radius["left_elbow"] < radius["left_knee"] < radius["left_hip"] < 0.25


def test_the_error_for_a_missing_model_names_the_command_to_make_it(tmp_path):
    with pytest.raises(ValueError, match=r"nothing\.npz: .*tools\.body\.bake"):
        BodyModel.load(tmp_path / "nothing.npz")


def test_wrong_transforms_and_bones_are_refused(body):
    with pytest.raises(ValueError, match=r"\(\.\.\., 35, 3, 4\), got \(3, 3, 4\)"):
        body.joints(np.zeros((3, 3, 4)))
    with pytest.raises(ValueError, match="one pose"):
        body.skin(np.zeros((2, 35, 3, 4)))
    with pytest.raises(ValueError, match="no bone 'Tail'"):
        body.index("Tail")
