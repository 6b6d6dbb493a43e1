import mujoco
import numpy as np
import pytest

from mvpose import COCO17, PANOPTIC19, SHELF14, Skeleton
from mvpose.skeleton import coco17_to_shelf14
from simharness.types.sequence import LANDMARKS, of_skeleton
from simharness.world.humans.body import make_body
from simharness.world.humans.mujoco_model import bone_transforms, person_spec
from simharness.world.humans.shape import Shape


@pytest.fixture(scope="module", params=[0.0, 1.0])
def body(request):
    return make_body(Shape(gender=request.param, weight=0.7))


def rest(body):
    return np.tile(np.eye(3, 4), (len(body.bones), 1, 1))


def test_coco_joints_come_first_and_all_skeletons_are_covered():
    assert LANDMARKS[:17] == COCO17.joints
    np.testing.assert_array_equal(of_skeleton(COCO17), np.arange(17))
    for skeleton in (SHELF14, PANOPTIC19):
        assert [LANDMARKS[i] for i in of_skeleton(skeleton)] == list(skeleton.joints)


def test_a_skeleton_with_an_unknown_joint_is_refused():
    tail = Skeleton("cat", ("nose", "tail"), (-1, 0), (0, 1), (0.1, 0.1))
    with pytest.raises(ValueError, match=r"'cat' has joints .* no landmark: tail; expected joints among nose,"):
        of_skeleton(tail)


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14, PANOPTIC19])
def test_joints_of_a_skeleton_are_its_landmarks(body, skeleton):
    transforms = np.stack([rest(body), rest(body) + 0.1])
    joints, landmarks = body.joints(transforms, skeleton), body.landmarks(transforms)
    assert joints.shape == (2, len(skeleton), 3)
    for place, name in enumerate(skeleton.joints):
        np.testing.assert_array_equal(joints[:, place], landmarks[:, LANDMARKS.index(name)])


def test_landmarks_are_at_anatomical_positions(body):
    """Heights of the landmarks: crown on top, neck at C7, chin, ears and hips in order."""
    place = dict(zip(LANDMARKS, body.landmarks(rest(body)), strict=True))
    assert place["head_top"][2] == pytest.approx(body.stature, abs=0.006)
    # ANSUR II: cervicale 0.86 of stature; the axis of the spine lies under the process of C7 that is measured.
    assert place["neck"][2] / body.stature == pytest.approx(0.86, abs=0.02)
    assert place["neck"][2] < place["head_bottom"][2] < place["nose"][2] - 0.05
    assert place["head_bottom"][2] < place["left_ear"][2] < place["head_top"][2]
    assert place["mid_hip"][2] / body.stature == pytest.approx(0.52, abs=0.02)  # trochanterion 0.513
    for name in ("head_bottom", "head_top", "neck", "mid_hip"):
        assert abs(place[name][1]) < 0.003, name
        assert body.vertices[:, 0].min() < place[name][0] < place["nose"][0]


def test_head_landmarks_lie_near_those_of_the_published_mappings(body):
    """Published evaluations compute head joints from COCO joints; the anatomical landmarks lie near these."""
    joints = body.joints(rest(body))
    for rule in ("2019", "voxelpose"):
        guess = coco17_to_shelf14(joints, head=rule)
        assert np.linalg.norm(guess[12] - body.joints(rest(body), SHELF14)[12]) < 0.08
        assert np.linalg.norm(guess[13] - body.joints(rest(body), SHELF14)[13]) < 0.1


def test_head_landmarks_follow_a_nod_and_hip_landmarks_do_not(body):
    model = person_spec(body, "person").compile()
    data = mujoco.MjData(model)
    rows = [model.body(bone).id for bone in body.bones]

    def landmarks(**angles):
        data.qpos[7:] = 0
        for name, angle in angles.items():
            data.qpos[model.joint(name).qposadr[0]] = angle
        mujoco.mj_kinematics(model, data)
        return body.landmarks(bone_transforms(body, data.xpos[rows], data.xmat[rows].reshape(-1, 3, 3)))

    still, nodding = landmarks(), landmarks(neck_flexion=0.6)
    moved = dict(zip(LANDMARKS, np.linalg.norm(nodding - still, axis=1), strict=True))
    assert moved["head_top"] > 0.1 > moved["head_bottom"] > 0.005
    assert moved["neck"] < 0.005
    assert moved["mid_hip"] < 1e-6
    hips = [LANDMARKS.index(f"{side}_hip") for side in ("left", "right")]
    striding = landmarks(left_hip_flexion=0.6, right_hip_flexion=-0.3)
    np.testing.assert_allclose(striding[LANDMARKS.index("mid_hip")], striding[hips].mean(0), atol=1e-12)


def test_depths_cover_all_landmarks(body):
    assert body.depths.shape == (len(LANDMARKS),)
    np.testing.assert_array_equal(body.joint_radii, body.depths[:17])
    assert body.depths[LANDMARKS.index("head_top")] == pytest.approx(0.015)  # on the skin
    assert 0.04 < body.depths[LANDMARKS.index("neck")] < 0.2
