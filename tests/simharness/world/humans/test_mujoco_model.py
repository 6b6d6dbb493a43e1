import mujoco
import numpy as np
import pytest

from mvpose.skeleton import COCO17
from simharness.world.humans.anatomy import DOFS, RANGES
from simharness.world.humans.body import make_body
from simharness.world.humans.mujoco_model import bone_transforms, neutral_transforms, person_spec
from simharness.world.humans.shape import Shape

X, Y, Z = np.eye(3)


class Person:
    """Body with its compiled MuJoCo model, posed by angles in degrees."""

    def __init__(self, shape):
        self.body = make_body(shape)
        self.model = person_spec(self.body, "person").compile()

    def transforms(self, **degrees):
        data = mujoco.MjData(self.model)
        for name, angle in degrees.items():
            data.qpos[self.model.joint(name).qposadr[0]] = np.radians(angle)
        mujoco.mj_kinematics(self.model, data)
        rows = [self.model.body(bone).id for bone in self.body.bones]
        return bone_transforms(self.body, data.xpos[rows], data.xmat[rows].reshape(-1, 3, 3))

    def heads(self, **degrees):
        transforms = self.transforms(**degrees)
        points = np.column_stack([self.body.heads, np.ones(len(self.body.bones))])
        return dict(zip(self.body.bones, np.einsum("brc,bc->br", transforms, points), strict=True))

    def joints(self, **degrees):
        return dict(zip(COCO17.joints, self.body.joints(self.transforms(**degrees)), strict=True))


@pytest.fixture(scope="module", params=[Shape(gender=0.0, height=0.4), Shape(gender=1.0, weight=0.8, height=0.3)])
def person(request):
    return Person(request.param)


def test_neutral_pose_stands_on_the_floor_with_flat_soles_and_feet_forward(person):
    skin = person.body.skin(person.transforms())
    assert skin[:, 2].min() == pytest.approx(0, abs=1e-5)
    heads = person.heads()
    for side in ("Left", "Right"):
        foot = heads[f"{side}ToeBase"] - heads[f"{side}Foot"]
        assert foot[0] > 0.1
        assert abs(foot[1]) < 1e-9
        sole = skin[(np.abs(skin[:, 1] - heads[f"{side}Foot"][1]) < 0.06) & (skin[:, 2] < 0.015)]
        assert np.ptp(sole[:, 0]) > 0.15  # heel and ball are both down


def test_legs_of_the_neutral_pose_are_straight_and_vertical(person):
    heads = person.heads()
    for side in ("Left", "Right"):
        for bone in ("Leg", "Foot"):
            np.testing.assert_allclose(heads[f"{side}{bone}"][:2], heads[f"{side}UpLeg"][:2], atol=1e-9)


def test_arms_of_the_neutral_pose_hang_straight_with_palms_to_the_thighs(person):
    heads = person.heads()
    for side in ("Left", "Right"):
        for bone in ("ForeArm", "Hand"):
            np.testing.assert_allclose(heads[f"{side}{bone}"][:2], heads[f"{side}Arm"][:2], atol=1e-9)
        # The thumb is in front of the fingers; if the palm faced forward, it would be beside them.
        thumb = heads[f"{side[0]}Thumb"] - heads[f"{side}FingerBase"]
        assert thumb[0] > 0.005
        assert thumb[0] > np.abs(thumb[1])


def test_neutral_transforms_are_the_models_initial_configuration(person):
    np.testing.assert_allclose(neutral_transforms(person.body), person.transforms(), atol=1e-9)


@pytest.mark.parametrize(
    ("dof", "joint", "direction"),
    [
        ("hip_flexion", "knee", X),
        ("hip_abduction", "knee", Y),
        ("knee_flexion", "ankle", -X),
        ("clavicle_elevation", "shoulder", Z),
        ("shoulder_flexion", "elbow", X),
        ("shoulder_abduction", "elbow", Y),
        ("elbow_flexion", "wrist", X),
    ],
)
def test_positive_angles_of_limbs_move_joints_in_the_named_direction(person, dof, joint, direction):
    """Directions are those of the left side; y is mirrored for the right side."""
    before = person.joints()
    for side, mirror in (("left", [1, 1, 1]), ("right", [1, -1, 1])):
        moved = person.joints(**{f"{side}_{dof}": 20})[f"{side}_{joint}"] - before[f"{side}_{joint}"]
        assert moved @ (direction * mirror) > 0.03
        assert moved @ (direction * mirror) > 0.9 * np.linalg.norm(moved)


@pytest.mark.parametrize(
    ("dof", "bone", "direction"), [("ankle_dorsiflexion", "ToeBase", Z), ("wrist_flexion", "HandFinger1", -Y)]
)
def test_positive_angles_of_hands_and_feet_move_them_in_the_named_direction(person, dof, bone, direction):
    for side, mirror in (("left", [1, 1, 1]), ("right", [1, -1, 1])):
        name = side.capitalize() + bone
        moved = person.heads(**{f"{side}_{dof}": 20})[name] - person.heads()[name]
        assert moved @ (direction * mirror) > 0.015


def test_medial_rotation_of_the_hip_carries_the_ankle_of_a_bent_knee_outwards(person):
    for side, out in (("left", 1), ("right", -1)):
        bent = {f"{side}_knee_flexion": 90}
        moved = (
            person.joints(**bent, **{f"{side}_hip_rotation": 30})[f"{side}_ankle"]
            - person.joints(**bent)[f"{side}_ankle"]
        )
        assert moved[1] * out > 0.1


def test_medial_rotation_of_the_shoulder_carries_the_wrist_of_a_bent_elbow_inwards(person):
    for side, out in (("left", 1), ("right", -1)):
        bent = {f"{side}_elbow_flexion": 90}
        moved = (
            person.joints(**bent, **{f"{side}_shoulder_rotation": 30})[f"{side}_wrist"]
            - person.joints(**bent)[f"{side}_wrist"]
        )
        assert moved[1] * out < -0.08


def test_pronation_turns_the_thumb_inwards(person):
    for s, (side, out) in enumerate((("left", 1), ("right", -1))):
        hand = person.body.index(f"{side.capitalize()}Hand")
        thumb = [
            person.transforms(**{f"{side}_forearm_pronation": angle})[hand, :, :3] @ person.body.thumbs[s]
            for angle in (0, 60)
        ]
        np.testing.assert_allclose(thumb[1] - thumb[0], [np.cos(np.pi / 3) - 1, -out * np.sin(np.pi / 3), 0], atol=0.1)


def test_inversion_turns_the_soles_towards_each_other(person):
    for side, out in (("left", 1), ("right", -1)):
        foot = person.body.index(f"{side.capitalize()}Foot")
        sole = person.transforms(**{f"{side}_ankle_inversion": 20})[foot, :, :3] @ -Z
        np.testing.assert_allclose(sole, [0, -out * np.sin(np.radians(20)), -np.cos(np.radians(20))], atol=1e-9)


@pytest.mark.parametrize("region", ["lumbar", "thorax", "neck"])
def test_positive_angles_of_the_spine_move_the_nose_in_the_named_direction(person, region):
    before, nose = person.joints(), "nose"
    assert person.joints(**{f"{region}_flexion": 15})[nose][2] < before[nose][2] - 0.005
    assert person.joints(**{f"{region}_bending": 15})[nose][1] > 0.01
    turned = person.joints(**{f"{region}_rotation": 15})[nose]
    assert turned[1] > 0.02
    assert turned[2] == pytest.approx(before[nose][2], abs=1e-9)


@pytest.mark.parametrize("dof", [name.removeprefix("left_") for name in DOFS if name.startswith("left_")])
def test_mirrored_joints_give_the_mirrored_pose(person, dof):
    angle = np.degrees(RANGES[f"left_{dof}"][1]) / 2
    left, right = person.heads(**{f"left_{dof}": angle}), person.heads(**{f"right_{dof}": angle})
    for bone, place in left.items():
        other = bone.replace("Left", "Right") if bone.startswith("Left") else bone.replace("Right", "Left")
        other = {"LThumb": "RThumb", "RThumb": "LThumb", "LHipJoint": "RHipJoint", "RHipJoint": "LHipJoint"}.get(
            bone, other
        )
        np.testing.assert_allclose(place * [1, -1, 1], right[other], atol=0.001, err_msg=bone)


def test_hinges_act_in_the_order_flexion_abduction_rotation(person):
    """The rotation is the product of flexion about -y, abduction about x and rotation about -z, in this order."""

    def about(axis, degrees):
        quaternion, matrix = np.empty(4), np.empty(9)
        mujoco.mju_axisAngle2Quat(quaternion, axis, np.radians(degrees))
        mujoco.mju_quat2Mat(matrix, quaternion)
        return matrix.reshape(3, 3)

    for joint, bone in (("hip", "LeftUpLeg"), ("shoulder", "LeftArmTwist")):
        index = person.body.index(bone)
        angles = {f"left_{joint}_flexion": 40, f"left_{joint}_abduction": 30, f"left_{joint}_rotation": 20}
        turn = person.transforms(**angles)[index, :, :3] @ person.transforms()[index, :, :3].T
        np.testing.assert_allclose(turn, about(-Y, 40) @ about(X, 30) @ about(-Z, 20), atol=1e-9)


def test_the_root_joint_moves_the_whole_body(person):
    data = mujoco.MjData(person.model)
    address = person.model.joint("root").qposadr[0]
    data.qpos[address : address + 7] = [1, 2, 3, np.cos(0.4), 0, 0, np.sin(0.4)]
    mujoco.mj_kinematics(person.model, data)
    rows = [person.model.body(bone).id for bone in person.body.bones]
    joints = person.body.joints(bone_transforms(person.body, data.xpos[rows], data.xmat[rows].reshape(-1, 3, 3)))
    still = np.array(list(person.joints().values()))
    pelvis = person.heads()["Hips"]
    turn = np.array([[np.cos(0.8), -np.sin(0.8), 0], [np.sin(0.8), np.cos(0.8), 0], [0, 0, 1]])
    np.testing.assert_allclose(joints, (still - pelvis) @ turn.T + [1, 2, 3], atol=1e-9)


def test_bone_transforms_are_rigid(person):
    transforms = person.transforms(left_hip_flexion=50, right_shoulder_abduction=100, neck_rotation=30)
    turns = transforms[..., :3]
    np.testing.assert_allclose(turns @ turns.swapaxes(-1, -2), np.tile(np.eye(3), (len(turns), 1, 1)), atol=1e-9)


def test_model_has_the_named_hinges_with_their_ranges(person):
    hinges = [i for i in range(person.model.njnt) if person.model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    assert {person.model.joint(i).name for i in hinges} == set(DOFS)
    for i in hinges:
        assert person.model.jnt_limited[i]
        np.testing.assert_allclose(person.model.jnt_range[i], RANGES[person.model.joint(i).name])
    assert person.model.nbody == len(person.body.bones) + 1


def test_segment_masses_sum_to_the_mass_of_the_body(person):
    assert person.model.body_mass.sum() == pytest.approx(person.body.mass)
    thigh = person.model.body("LeftUpLeg").mass[0] / person.body.mass
    assert thigh == pytest.approx(0.1416 if person.body.shape.gender == 0 else 0.1478, abs=1e-4)
    arm = sum(person.model.body(bone).mass[0] for bone in ("RightArm", "RightArmTwist")) / person.body.mass
    assert arm == pytest.approx(0.0271 if person.body.shape.gender == 0 else 0.0255, abs=1e-4)


@pytest.mark.parametrize(
    ("bones", "end", "male", "female"),
    [
        (("LeftArm", "LeftArmTwist"), "LeftForeArm", (57.72, 28.5, 26.9, 15.8), (57.54, 27.8, 26.0, 14.8)),
        (("RightForeArm", "RightForeArmTwist"), "RightHand", (45.74, 27.6, 26.5, 12.1), (45.59, 26.1, 25.7, 9.4)),
        (("LeftUpLeg",), "LeftLeg", (40.95, 32.9, 32.9, 14.9), (36.12, 36.9, 36.4, 16.2)),
        (("RightLeg",), "RightFoot", (44.59, 25.5, 24.9, 10.3), (44.16, 27.1, 26.7, 9.3)),
    ],
)
def test_limbs_have_the_inertia_that_de_leva_published(person, bones, end, male, female):
    """Values are centre of mass and radii of gyration (sagittal, transverse, longitudinal), percent of the length."""
    body, model = person.body, person.model
    head = body.heads[body.index(bones[0])]
    axis = body.heads[body.index(end)] - head
    length = np.linalg.norm(axis)
    parts = []
    for bone in bones:
        i = model.body(bone).id
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, model.body_iquat[i])
        axes = matrix.reshape(3, 3)
        center = model.body_ipos[i] + body.heads[body.index(bone)] - head
        parts.append((model.body_mass[i], center, axes * model.body_inertia[i] @ axes.T))
    mass = sum(m for m, _, _ in parts)
    center = sum(m * c for m, c, _ in parts) / mass
    tensor = sum(
        t + m * ((c - center) @ (c - center) * np.eye(3) - np.outer(c - center, c - center)) for m, c, t in parts
    )
    percent, sagittal, transverse, longitudinal = male if body.shape.gender == 0 else female
    np.testing.assert_allclose(center, percent / 100 * axis, atol=1e-6)
    gyration = 100 * np.sqrt(np.sort(np.linalg.eigvalsh(tensor)) / mass) / length
    assert gyration[0] == pytest.approx(longitudinal, abs=0.01)
    np.testing.assert_allclose(gyration[1:], np.sqrt((sagittal**2 + transverse**2) / 2), atol=0.01)
    assert 100 * np.sqrt(axis @ tensor @ axis / mass) / length**2 == pytest.approx(longitudinal, abs=0.01)


def test_capsules_are_named_after_their_bones(person):
    names = [person.model.geom(i).name for i in range(person.model.ngeom)]
    assert len(set(names)) == len(names)
    for i, name in enumerate(names):
        assert name.split()[0] == person.model.body(person.model.geom_bodyid[i]).name


def test_capsules_touch_the_floor_but_not_each_other(person):
    spec = person_spec(person.body, "walker")
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] -= 0.15
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    assert all(0 in model.geom_bodyid[data.contact[i].geom] for i in range(data.ncon))


def test_two_people_collide(person):
    spec = mujoco.MjSpec()
    for i in range(2):
        spec.attach(person_spec(person.body, f"p{i}"), prefix=f"p{i}/", frame=spec.worldbody.add_frame())
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[model.joint("p1/root").qposadr[0]] += 0.1
    mujoco.mj_forward(model, data)
    assert data.ncon > 0


def test_wrong_shapes_are_refused(person):
    with pytest.raises(ValueError, match=r"expected xpos \(\.\.\., 35, 3\)"):
        bone_transforms(person.body, np.zeros((4, 3)), np.zeros((4, 3, 3)))


def test_skin_does_not_tear_in_a_wide_pose(person):
    """No edge grows by more than armpits and hips need, and no face of the shoulder becomes a needle."""
    body = person.body
    skin = body.skin(
        person.transforms(
            left_shoulder_abduction=120, right_shoulder_flexion=120, left_hip_flexion=80, right_knee_flexion=90
        )
    )
    edges = body.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    rest, posed = (np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (body.vertices, skin))
    assert (posed - rest).max() < 0.05
    assert np.percentile(posed / np.maximum(rest, 1e-4), 99.5) < 2.5
