"""Joint angles, marker sets and setups for OpenSim: by forward kinematics, and in OpenSim where it is installed."""

import csv
import xml.etree.ElementTree as Xml

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mvpose import COCO17
from mvpose.formats.people import write_people
from mvpose.formats.people.opensim import marker_places
from mvpose.formats.people.people_files import marker_label
from mvpose.skeleton_fit import FittedBody, joint_angles
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.kinematics import Pose
from mvpose.wholebody import skeleton_by_name
from tests.mvpose.skeleton_fit.articulated import moving, recorded

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # forward, left, up as forward, up, right
WORLD = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # y up
HIPS, SHOULDERS = np.array([-0.056276, -0.07849, 0.07726]), np.array([0.003155, 0.3715, 0.0])

PLACE = ("pelvis_tx", "pelvis_ty", "pelvis_tz")


def standing(**turns):
    """A person with hanging arms in one frame, with rotation vectors of segments in degrees after that."""
    body = ArticulatedBody.of_skeleton(skeleton_by_name("body25"))
    rotations = np.broadcast_to(np.eye(3), (1, len(body.segments), 3, 3)).copy()
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        rotations[0, body.index(f"{side}Arm")] = Rotation.from_euler("x", 90.0 * sign, degrees=True).as_matrix()
    for segment, vector in turns.items():
        turn = Rotation.from_rotvec(vector, degrees=True).as_matrix()
        rotations[0, body.index(segment)] = turn @ rotations[0, body.index(segment)]
    return FittedBody(0, 0, np.zeros(1), Pose(body, np.zeros((1, 3)), rotations))


def angles_of(fit):
    """Angles of the only frame, in a world whose x is forward for the person."""
    return {name: float(values[0]) for name, values in joint_angles(fit, AXES).items()}


def test_a_person_who_stands_with_hanging_arms_has_no_angles():
    np.testing.assert_allclose(list(angles_of(standing()).values()), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("segment", "vector", "coordinate", "degrees"),
    [  # flexion and inward are positive, outward is negative
        ("RightUpLeg", (0, -30, 0), "hip_flexion_r", 30), ("LeftUpLeg", (0, -30, 0), "hip_flexion_l", 30),
        ("RightUpLeg", (-20, 0, 0), "hip_adduction_r", -20), ("LeftUpLeg", (-20, 0, 0), "hip_adduction_l", 20),
        ("RightUpLeg", (0, 0, 20), "hip_rotation_r", 20), ("LeftUpLeg", (0, 0, 20), "hip_rotation_l", -20),
        ("RightLeg", (0, 40, 0), "knee_angle_r", 40), ("LeftFoot", (0, -15, 0), "ankle_angle_l", 15),
        ("RightArm", (0, -50, 0), "arm_flex_r", 50), ("LeftArm", (0, -50, 0), "arm_flex_l", 50),
        ("RightArm", (-60, 0, 0), "arm_add_r", -60), ("LeftArm", (60, 0, 0), "arm_add_l", -60),
        ("RightForeArm", (0, 0, 70), "elbow_flex_r", 70), ("LeftForeArm", (0, 0, -70), "elbow_flex_l", 70),
        ("Spine", (0, -10, 0), "lumbar_extension", 10), ("Spine", (10, 0, 0), "lumbar_bending", 10),
        ("Hips", (0, -10, 0), "pelvis_tilt", 10), ("Hips", (0, 0, 30), "pelvis_rotation", 30),
    ],
)  # fmt: skip
def test_a_turn_about_one_axis_is_the_angle_of_its_coordinate(segment, vector, coordinate, degrees):
    found = angles_of(standing(**{segment: np.array(vector, float)}))
    assert {name: value for name, value in found.items() if abs(value) > 1e-6} == pytest.approx({coordinate: degrees})


def test_forward_kinematics_of_the_coordinates_give_the_joints(tmp_path):
    times, pose = moving(40, seed=3)
    fit = FittedBody(4, 0, times, pose)
    angles = {name: np.radians(values) for name, values in joint_angles(fit, WORLD).items()}
    joints = dict(zip(pose.body.joints, np.moveaxis(pose.joints @ WORLD.T, 1, 0), strict=True))
    lengths = pose.body.lengths

    def turn(*names, side=1.0):
        z, x, y = (angles[name] for name in names)
        return Rotation.from_euler("ZXY", np.stack([z, side * x, side * y], axis=1)).as_matrix()

    pelvis = turn("pelvis_tilt", "pelvis_list", "pelvis_rotation")
    torso = pelvis @ turn("lumbar_extension", "lumbar_bending", "lumbar_rotation")
    for side, end, sign in (("left", "l", -1.0), ("right", "r", 1.0)):
        hip = pelvis @ turn(f"hip_flexion_{end}", f"hip_adduction_{end}", f"hip_rotation_{end}", side=sign)
        thigh = joints[f"{side}_knee"] - joints[f"{side}_hip"]
        np.testing.assert_allclose(thigh, -lengths["thigh"] * hip[:, :, 1], atol=1e-9)
        knee = hip @ Rotation.from_euler("z", -angles[f"knee_angle_{end}"][:, None]).as_matrix()
        shank = joints[f"{side}_ankle"] - joints[f"{side}_knee"]
        np.testing.assert_allclose(shank, -lengths["shank"] * knee[:, :, 1], atol=1e-9)
        arm = torso @ turn(f"arm_flex_{end}", f"arm_add_{end}", f"arm_rot_{end}", side=sign)
        upper = joints[f"{side}_elbow"] - joints[f"{side}_shoulder"]
        np.testing.assert_allclose(upper, -lengths["upper arm"] * arm[:, :, 1], atol=1e-9)
        elbow = arm @ Rotation.from_euler("z", angles[f"elbow_flex_{end}"][:, None]).as_matrix()
        fore = joints[f"{side}_wrist"] - joints[f"{side}_elbow"]
        np.testing.assert_allclose(fore, -lengths["forearm"] * elbow[:, :, 1], atol=1e-9)


def test_angles_do_not_jump_when_an_arm_is_lifted_past_the_horizontal():
    lifted = [standing(LeftArm=np.array([degrees, 0.0, 0.0])) for degrees in np.arange(0.0, 171.0, 10.0)]
    body, rotations = lifted[0].body, np.concatenate([each.pose.rotations for each in lifted])
    pose = Pose(body, np.zeros((len(lifted), 3)), rotations)
    found = joint_angles(FittedBody(0, 0, np.arange(float(len(lifted))), pose), WORLD)
    np.testing.assert_allclose(np.abs(np.diff(found["arm_add_l"])), 10.0, atol=1e-5)
    assert np.abs(np.diff(found["arm_flex_l"])).max() < 1e-4


def test_tables_have_a_row_for_each_frame_of_the_trc_file(tmp_path):
    times, pose = moving(30)
    people = recorded(times, pose)
    write_people(people, tmp_path, formats=["mot", "angles", "opensim"])
    lines = (tmp_path / "person_4.mot").read_text().splitlines()
    start = lines.index("endheader") + 1
    assert {"nRows=30", "inDegrees=yes", f"nColumns={len(lines[start].split())}"} <= set(lines[:start])
    table = np.array([[float(x) for x in line.split()] for line in lines[start + 1 :]])
    marks = [line.split("\t") for line in (tmp_path / "person_4.trc").read_text().splitlines()[5:]]
    np.testing.assert_allclose(table[:, 0], [float(cells[1]) for cells in marks], atol=1e-6)
    names = lines[start].split("\t")
    with (tmp_path / "person_4_angles.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 30
    for row, values in zip(rows, table, strict=True):
        shared = dict(zip(names, values, strict=True))
        assert {name: float(text) for name, text in row.items()} == {name: shared[name] for name in row}


@pytest.mark.parametrize("name", ["coco17", "body25", "halpe26", "wholebody133", "blazepose33"])
def test_markers_have_the_labels_of_the_trc_file_and_the_sides_mirror(name, tmp_path):
    skeleton = COCO17 if name == "coco17" else skeleton_by_name(name)
    times, pose = moving(5, skeleton=skeleton)
    write_people(recorded(times, pose, skeleton=skeleton), tmp_path, formats=["opensim"])
    labels = set((tmp_path / "person_4.trc").read_text().splitlines()[3].split("\t"))
    for file, tag in (("opensim_markers", "Marker"), ("person_4_ik", "IKMarkerTask")):
        named = [each.get("name") for each in Xml.parse(tmp_path / f"{file}.xml").iter(tag)]
        assert set(named) <= labels
        assert len(named) == len(set(named)) >= 12
    pairs = [each.text.split() for each in Xml.parse(tmp_path / "person_4_scale.xml").iter("markers")]
    assert {label for pair in pairs for label in pair} <= labels
    places = marker_places(skeleton)
    for joint, (body, place) in places.items():
        if joint.startswith("left_"):
            other, mirrored = places[joint.replace("left_", "right_")]
            assert other == (body[:-1] + "r" if body.endswith("_l") else body)
            np.testing.assert_allclose(mirrored, place * [1, 1, -1], atol=1e-9)


def _model(opensim):
    """A skeleton of rigid bodies with the coordinates and centres of joints of the model of Rajagopal et al."""
    model = opensim.Model()
    model.setName("skeleton")

    def attach(name, parent, at, coordinates, signs=(1, 1, 1), *, translated=False):
        body = opensim.Body(name, 1.0, opensim.Vec3(0), opensim.Inertia(1, 1, 1))
        model.addBody(body)
        motion = opensim.SpatialTransform()
        names = [*coordinates, *[""] * (3 - len(coordinates)), *(PLACE if translated else ("", "", ""))]
        axes = [*(np.eye(3)[[2, 0, 1]] * np.reshape(signs, (3, 1))), *np.eye(3)]
        for k, (coordinate, way) in enumerate(zip(names, axes, strict=True)):
            axis = motion.updTransformAxis(k)
            axis.set_axis(opensim.Vec3(*way))
            axis.set_function(opensim.LinearFunction(1.0, 0.0) if coordinate else opensim.Constant(0.0))
            if coordinate:
                axis.setCoordinateNames(opensim.ArrayStr(coordinate, 1))
        zero = opensim.Vec3(0)
        frames = (f"{name}_joint", parent, opensim.Vec3(*at), zero, body, zero, zero)
        joint = opensim.CustomJoint(*frames, motion) if coordinates else opensim.WeldJoint(*frames)
        model.addJoint(joint)
        return body

    rotations = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
    pelvis = attach("pelvis", model.getGround(), (0.0, 0.0, 0.0), rotations, translated=True)
    lumbar = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
    torso = attach("torso", pelvis, (-0.1007, 0.0815, 0.0), lumbar)
    for end, side in (("r", 1.0), ("l", -1.0)):
        mirror, signs = np.array([1.0, 1.0, side]), (1, side, side)
        names = (f"hip_flexion_{end}", f"hip_adduction_{end}", f"hip_rotation_{end}")
        femur = attach(f"femur_{end}", pelvis, HIPS * mirror, names, signs)
        tibia = attach(f"tibia_{end}", femur, (0.0, -0.41, 0.0), (f"knee_angle_{end}",), (-1, 1, 1))
        talus = attach(f"talus_{end}", tibia, (0.0, -0.4, 0.0), (f"ankle_angle_{end}",))
        attach(f"calcn_{end}", talus, np.array([-0.04877, -0.04195, 0.00792]) * mirror, ())
        names = (f"arm_flex_{end}", f"arm_add_{end}", f"arm_rot_{end}")
        humerus = attach(f"humerus_{end}", torso, SHOULDERS + [0.0, 0.0, 0.17 * side], names, signs)
        ulna = attach(f"ulna_{end}", humerus, (0.0, -0.29, 0.0), (f"elbow_flex_{end}",))
        attach(f"hand_{end}", ulna, (0.0, -0.25, 0.0), ())
    model.finalizeConnections()
    return model


def test_opensim_scales_a_model_and_solves_it_by_the_files(tmp_path, monkeypatch):
    opensim = pytest.importorskip("opensim", reason="OpenSim is not installed: pip install opensim")
    monkeypatch.chdir(tmp_path)
    skeleton = skeleton_by_name("body25")
    times, pose = moving(20, skeleton=skeleton)
    people = recorded(times, pose, skeleton=skeleton)
    write_people(people, tmp_path, formats=["opensim", "mot"])
    _model(opensim).printToXML("Rajagopal2016.osim")
    opensim.ScaleTool("person_4_scale.xml").run()  # returns False where markers are not moved, as is wanted here
    assert opensim.InverseKinematicsTool("person_4_ik.xml").run()
    model = opensim.Model("person_4_scaled.osim")
    state = model.initSystem()
    wanted = {
        marker_label(joint): places
        for joint, places in zip(pose.body.joints, np.moveaxis(pose.joints @ WORLD.T, 1, 0), strict=True)
    }
    legs = {f"{side}{part}" for side in "LR" for part in ("Hip", "Knee", "Ankle")}  # trunks differ in where they bend
    for file, shown, most in (("person_4_ik.mot", set(wanted), 0.05), ("person_4.mot", legs, 0.005)):
        table = opensim.TimeSeriesTable(file)
        assert table.getNumRows() == 20
        assert table.getTableMetaDataString("inDegrees") == "yes"
        away = []
        for row in range(20):
            values = dict(zip(table.getColumnLabels(), table.getRowAtIndex(row).to_numpy(), strict=True))
            for coordinate in model.getCoordinateSet():
                value = values[coordinate.getName()]
                metres = coordinate.getName() in PLACE
                coordinate.setValue(state, value if metres else np.radians(value), False)
            model.realizePosition(state)
            for marker in model.getMarkerSet():
                if (name := marker.getName()) in shown:
                    away.append(np.linalg.norm(marker.getLocationInGround(state).to_numpy() - wanted[name][row]))
        assert np.sqrt(np.mean(np.square(away))) < most, file
