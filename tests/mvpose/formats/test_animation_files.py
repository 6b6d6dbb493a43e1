"""BVH and glTF files of fitted bodies: forward kinematics from the files alone gives the joints of the people."""

import io
import json
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mvpose import COCO17, preset
from mvpose.formats.calibration.voxelpose import read_calibration
from mvpose.formats.detections.recorded_frames import read_frames
from mvpose.formats.joint_names import canonical
from mvpose.formats.people import FORMATS, Export, Options
from mvpose.recording import People
from mvpose.skeleton_fit.body import ArticulatedBody
from mvpose.skeleton_fit.kinematics import Pose
from mvpose.skeleton_fit.rotations import to_matrices

TO_Y_UP = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
NAMES = {  # of the nodes at joints, as animation programs write them
    f"{side}_{joint}": f"{side.capitalize()}{node}"
    for side in ("left", "right")
    for joint, node in {
        "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand", "hip": "UpLeg", "knee": "Leg", "ankle": "Foot",
    }.items()
}  # fmt: skip


@pytest.fixture(scope="module")
def people():
    """Somebody who walks along x and swings arms and legs, with identity 7, in frames 5 to 34 of 40."""
    times = np.arange(40) / 20.0
    swing = 0.5 * np.sin(6.0 * times)
    body = ArticulatedBody.of_skeleton(COCO17)
    vectors = np.zeros((40, len(body.segments), 3))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        vectors[:, body.index(f"{side}UpLeg"), 1] = -sign * swing
        vectors[:, body.index(f"{side}Leg"), 1] = 0.4 + 0.4 * sign * swing
        vectors[:, body.index(f"{side}Arm"), 0] = -1.3 * sign
        vectors[:, body.index(f"{side}ForeArm"), 2] = -sign * (0.5 + 0.3 * swing)
    vectors[:, 0, 2] = 3.0 + 6.0 * times  # past several half turns
    root = np.stack([times, 0.3 * times, np.full(40, 0.9)], axis=-1)
    pose = Pose(body, root, to_matrices(vectors))
    joints = pose.joints[:, None] + 0.003 * np.random.default_rng(0).normal(size=(40, 1, 17, 3))
    joints[:5] = joints[35:] = np.nan
    joints[12:15] = np.nan
    return People(times, np.array([7]), joints, np.ones((40, 1, 17)))


@pytest.fixture(scope="module")
def export(people):
    return Export(people, Options())


def read_bvh(text):
    """Minimal reader of the layout of Biovision: names, parents, offsets, time of a frame, positions, rotations."""
    hierarchy, motion = text.split("MOTION\n")
    names, parents, offsets, channels, opened = [], [], [], [], []
    for line in hierarchy.split("\n")[1:]:
        words = line.split()
        if words[:1] in (["ROOT"], ["JOINT"], ["End"]):
            names.append("_".join(words[1:]))
            parents.append(opened[-1] if opened else -1)
            opened.append(len(names) - 1)
            offsets.append(None)
            channels.append([])
        elif words[:1] == ["OFFSET"]:
            offsets[opened[-1]] = [float(word) for word in words[1:]]
        elif words[:1] == ["CHANNELS"]:
            assert int(words[1]) == len(words[2:])
            channels[opened[-1]] = words[2:]
        elif words == ["}"]:
            opened.pop()
    assert not opened
    heading, values = motion.split("\n", 2)[:2], motion.split("\n", 2)[2]
    table = np.array([[float(word) for word in line.split()] for line in values.strip().split("\n")])
    assert len(table) == int(heading[0].split(":")[1])
    return names, parents, np.array(offsets), channels, float(heading[1].split(":")[1]), table


def bvh_places(text):
    """Place of every joint in every frame by forward kinematics, {name: (T, 3)}, in the unit of the file."""
    names, parents, offsets, channels, _, table = read_bvh(text)
    column, places, turns = 0, [], []
    for node, parent in enumerate(parents):
        place, turn = np.broadcast_to(offsets[node], (len(table), 3)), np.broadcast_to(np.eye(3), (len(table), 3, 3))
        for channel in channels[node]:
            axis = "XYZ".index(channel[0])
            if channel.endswith("position"):
                place = place + np.eye(3)[axis] * table[:, column, None]
            else:
                turn = turn @ Rotation.from_euler("xyz"[axis], table[:, [column]], degrees=True).as_matrix()
            column += 1
        if parent >= 0:
            place = places[parent] + np.einsum("tij,tj->ti", turns[parent], place)
            turn = turns[parent] @ turn
        places.append(place)
        turns.append(turn)
    assert column == table.shape[1]
    return dict(zip(names, places, strict=True))


def at_joints(places):
    """Places of the joints of COCO17, (T, 17, 3): nodes are found by name."""
    by_name = {canonical(name): value for name, value in places.items()}
    return np.stack([places[NAMES[joint]] if joint in NAMES else by_name[joint] for joint in COCO17.joints], axis=1)


class TestBvh:
    def test_forward_kinematics_gives_the_joints(self, people, export):
        ((name, content),) = FORMATS["bvh"].write(export)
        assert name == "person_7.bvh"
        got = at_joints(bvh_places(content.decode())) / 100 @ TO_Y_UP  # centimetres with y up
        distance = np.linalg.norm(got - people.joints[5:35, 0], axis=-1)
        assert np.nanmedian(distance) < 0.01
        assert np.nanmax(distance) < 0.03
        fitted = export.bodies[0].pose.joints
        np.testing.assert_allclose(got, fitted, atol=1e-5)  # the file itself is as exact as its digits

    def test_the_rate_is_that_of_the_recording_and_the_frames_are_those_of_the_person(self, people, export):
        ((_, content),) = FORMATS["bvh"].write(export)
        *_, seconds, table = read_bvh(content.decode())
        assert seconds == pytest.approx(0.05)
        assert len(people.times) == 40
        assert len(table) == 30

    def test_angles_do_not_jump(self, export):
        ((_, content),) = FORMATS["bvh"].write(export)
        *_, table = read_bvh(content.decode())
        assert np.abs(np.diff(table[:, 3:], axis=0)).max() < 60

    def test_z_up_where_asked_for(self, people):
        ((_, content),) = FORMATS["bvh"].write(Export(people, Options(up="z")))
        got = at_joints(bvh_places(content.decode())) / 100
        assert np.nanmedian(np.linalg.norm(got - people.joints[5:35, 0], axis=-1)) < 0.01

    def test_the_zero_pose_is_the_t_pose(self, export):
        ((_, content),) = FORMATS["bvh"].write(export)
        names, _, offsets, *_ = read_bvh(content.decode())
        offset = dict(zip(names, offsets, strict=True))
        assert offset["LeftForeArm"][0] > 20  # left is x, up is y, forward is z
        np.testing.assert_allclose(offset["LeftForeArm"][1:], 0)
        assert offset["RightLeg"][1] < -30
        assert offset["Nose"][2] > 5


def read_glb(content):
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    assert size % 4 == 0
    tree, buffer = json.loads(content[20 : 20 + size]), b""
    if 20 + size < len(content):
        assert content[24 + size : 28 + size] == b"BIN\0"
        buffer = content[28 + size :]
        assert len(buffer) == tree["buffers"][0]["byteLength"]
    return tree, buffer


def accessor(tree, buffer, index):
    entry = tree["accessors"][index]
    view = tree["bufferViews"][entry["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[entry["type"]]
    kind = {5126: "<f4", 5123: "<u2"}[entry["componentType"]]
    values = np.frombuffer(buffer, kind, entry["count"] * width, view["byteOffset"]).reshape(-1, width)
    assert values.nbytes == view["byteLength"]
    assert view["byteOffset"] % 4 == 0
    if "min" in entry:
        np.testing.assert_array_equal(values.min(axis=0), np.array(entry["min"], "f4"))
        np.testing.assert_array_equal(values.max(axis=0), np.array(entry["max"], "f4"))
    return values.astype(float)


def glb_places(content):
    """Time of each frame, and the place of every node in every frame, {name: (T, 3)}."""
    tree, buffer = read_glb(content)
    (animation,) = tree["animations"]
    moves = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times = accessor(tree, buffer, sampler["input"])[:, 0]
        moves[channel["target"]["node"], channel["target"]["path"]] = accessor(tree, buffer, sampler["output"])
    places = {}

    def visit(node, place, turn):
        entry = tree["nodes"][node]
        step = moves.get((node, "translation"), np.broadcast_to(entry.get("translation", [0, 0, 0]), (len(times), 3)))
        still = np.broadcast_to(entry.get("rotation", [0, 0, 0, 1]), (len(times), 4))
        quaternions = np.array(moves.get((node, "rotation"), still))
        place = place + np.einsum("tij,tj->ti", turn, step)
        places[entry["name"]] = place
        for child in entry.get("children", []):
            visit(child, place, turn @ Rotation.from_quat(quaternions).as_matrix())

    (root,) = tree["scenes"][tree["scene"]]["nodes"]
    visit(root, np.zeros((len(times), 3)), np.broadcast_to(np.eye(3), (len(times), 3, 3)))
    return times, places, moves[root, "scale"], tree


class TestGltf:
    def test_forward_kinematics_gives_the_joints_in_metres_with_y_up(self, people, export):
        ((name, content),) = FORMATS["gltf"].write(export)
        assert name == "people.glb"
        times, places, scale, tree = glb_places(content)
        np.testing.assert_allclose(times, people.times, atol=1e-6)
        got = at_joints(places) @ TO_Y_UP
        assert np.nanmedian(np.linalg.norm(got - people.joints[:, 0], axis=-1)) < 0.01
        np.testing.assert_allclose(got[5:35], export.bodies[0].pose.joints, atol=1e-4)
        assert tree["nodes"][0]["name"] == "person_7"
        np.testing.assert_array_equal(scale[:, 0], (np.arange(40) >= 5) & (np.arange(40) < 35))

    def test_all_people_move_in_one_animation(self, people):
        both = People(people.times, np.array([7, 9]), np.repeat(people.joints, 2, axis=1), np.ones((40, 2, 17)))
        ((_, content),) = FORMATS["gltf"].write(Export(both, Options()))
        tree, _ = read_glb(content)
        (animation,) = tree["animations"]
        moved = [channel["target"]["node"] for channel in animation["channels"]]
        roots = tree["scenes"][0]["nodes"]
        assert [tree["nodes"][root]["name"] for root in roots] == ["person_7", "person_9"]
        assert set(roots) <= set(moved)
        assert len(moved) == 2 * sum(node < roots[1] for node in moved)
        assert {channel["sampler"] for channel in animation["channels"]} == set(range(len(animation["samplers"])))

    def test_quaternions_take_the_shorter_way(self, export):
        ((_, content),) = FORMATS["gltf"].write(export)
        tree, buffer = read_glb(content)
        for channel in tree["animations"][0]["channels"]:
            if channel["target"]["path"] == "rotation":
                values = accessor(tree, buffer, tree["animations"][0]["samplers"][channel["sampler"]]["output"])
                np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, atol=1e-6)
                assert (np.sum(values[1:] * values[:-1], axis=1) > 0).all()

    def test_bones_reach_from_joint_to_joint(self, export):
        ((_, content),) = FORMATS["gltf"].write(export)
        tree, buffer = read_glb(content)
        node = next(each for each in tree["nodes"] if each["name"] == "LeftArm")
        (primitive,) = tree["meshes"][node["mesh"]]["primitives"]
        corners = accessor(tree, buffer, primitive["attributes"]["POSITION"])
        triangles = accessor(tree, buffer, primitive["indices"]).reshape(-1, 3).astype(int)
        length = export.bodies[0].lengths["upper arm"]
        assert np.ptp(corners[:, 0]) == pytest.approx(length, rel=1e-5)
        a, b, c = (corners[triangles[:, k]] for k in range(3))
        volume = np.sum(np.cross(a, b) * c) / 6  # positive if all triangles are seen from outside
        assert 0 < volume < 0.1 * length**3

    def test_trimesh_reads_it(self, export):
        trimesh = pytest.importorskip("trimesh")
        ((_, content),) = FORMATS["gltf"].write(export)
        scene = trimesh.load(io.BytesIO(content), file_type="glb")
        assert len(scene.geometry) > 15

    def test_nobody_is_an_empty_scene(self):
        ((_, content),) = FORMATS["gltf"].write(Export(People.of_estimates([]), Options()))
        tree, buffer = read_glb(content)
        assert (tree["scenes"], buffer) == ([{}], b"")


def test_bone_lengths(export):
    ((name, content),) = FORMATS["lengths"].write(export)
    rows = [line.split(",") for line in content.decode().splitlines()]
    assert (name, rows[0]) == ("bone_lengths.csv", ["person", "bone", "metres"])
    assert {bone: float(metres) for _, bone, metres in rows[1:]}["thigh"] == pytest.approx(0.245 * 1.7, rel=0.01)


@pytest.mark.slow
def test_bvh_of_real_people_on_shelf(shared_data):
    folder = shared_data / "shelf"
    rig = read_calibration(folder / "calibration_shelf.json", size=(1032, 776))
    cameras = tuple(camera.name for camera in rig)
    frames = read_frames(cameras, folder / "openpose", np.arange(100))
    people = People.of_estimates(preset("track").track(rig, frames))
    files = dict(FORMATS["bvh"].write(Export(people, Options())))
    distances = []
    for row, identity in enumerate(people.ids):
        if (name := f"person_{identity}.bvh") in files:
            got = at_joints(bvh_places(files[name].decode())) / 100 @ TO_Y_UP
            distances.append(np.linalg.norm(got - people.joints[people.span(row), row], axis=-1))
    assert len(distances) >= 2
    assert np.nanmedian(np.concatenate(distances)) < 0.01
