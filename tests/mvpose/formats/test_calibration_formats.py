"""Readers and writers of calibrations: round trips, and each format's own formula against OpenCV's projection."""

import json
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pair_of_cameras import RIG
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.formats.calibration import easymocap, opencv, panoptic, pose2sim, voxelpose
from mvpose.formats.calibration.file_storage import read_storage, write_storage

NAMES = st.text("abcXYZ0189_-", min_size=1, max_size=8)
ANY_NAME = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=8).filter(
    lambda name: name != "metadata"
)
# OpenCV's own YAML loses spaces at the ends of a name, so the writer refuses them.
OPENCV_NAME = st.text("abc0189_é .", min_size=1, max_size=6).filter(lambda name: name == name.strip())
NUMBER = st.floats(-20, 20)


@st.composite
def rigs(draw, names=NAMES, k3=True):
    """Two to four cameras anywhere, with any lens."""
    count = draw(st.integers(2, 4))
    cameras = []
    for name in draw(st.lists(names, min_size=count, max_size=count, unique=True)):
        fx, fy = draw(st.tuples(st.floats(10, 5000), st.floats(10, 5000)))
        cx, cy = draw(st.tuples(st.floats(-100, 4000), st.floats(-100, 4000)))
        vector = np.array(draw(st.tuples(*[st.floats(-1.8, 1.8)] * 3)))
        terms = np.array(draw(st.tuples(*[st.floats(-2, 2)] * 5)))
        camera = Camera(
            K=np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]),
            R=Rotation.from_rotvec(vector).as_matrix(),
            t=np.array(draw(st.tuples(NUMBER, NUMBER, NUMBER))),
            distortion=terms if k3 else terms * (1, 1, 1, 1, 0),
            size=draw(st.tuples(st.integers(1, 9000), st.integers(1, 9000))),
            name=name,
        )
        cameras.append(camera)
    centers = np.array([camera.center for camera in cameras])
    if np.ptp(centers, axis=0).max() < 1e-3 or np.abs(centers).max() < 0.1:  # no rig, or one that looks like metres
        cameras[0] = Camera(**{**vars_of(cameras[0]), "t": cameras[0].t + 1.0})
    return Rig(cameras)


def vars_of(camera):
    return {key: getattr(camera, key) for key in ("K", "R", "t", "distortion", "size", "name")}


def assert_same(read, written, *, sizes=True):
    assert [camera.name for camera in read] == [camera.name for camera in written]
    for one, two in zip(read, written, strict=True):
        np.testing.assert_allclose(one.K, two.K, rtol=1e-12)
        np.testing.assert_allclose(one.R, two.R, atol=1e-12)
        np.testing.assert_allclose(one.t, two.t, atol=1e-11)
        np.testing.assert_allclose(one.distortion, two.distortion, rtol=1e-12)
        assert one.size == two.size or not sizes


@given(rig=rigs(names=ANY_NAME))
def test_voxelpose_round_trip(rig):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "calibration.json"
        voxelpose.write_calibration(path, rig)
        assert_same(voxelpose.read_calibration(path, size=(7, 8)), rig, sizes=False)


@given(rig=rigs(names=ANY_NAME))
def test_panoptic_round_trip(rig):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "calibration.json"
        panoptic.write_calibration(path, rig)
        assert_same(panoptic.read_calibration(path), rig)


@given(rig=rigs(names=ANY_NAME))
def test_pose2sim_round_trip(rig):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "Calib.toml"
        pose2sim.write_calibration(path, rig)
        assert_same(pose2sim.read_calibration(path), rig)


@given(rig=rigs(names=OPENCV_NAME), ending=st.sampled_from(["yml", "yaml", "xml"]))
def test_opencv_round_trip(rig, ending):
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"calibration.{ending}"
        opencv.write_calibration(path, rig)
        assert_same(opencv.read_calibration(path, size=(7, 8)), rig)


@given(rig=rigs())
def test_easymocap_round_trip(rig):
    with TemporaryDirectory() as folder:
        easymocap.write_calibration(folder, rig)
        for name in ("intri.yml", "extri.yml"):
            assert_same(easymocap.read_calibration(Path(folder) / name, size=(7, 8)), rig)


POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
EXPECTED = RIG.project(POINTS)


def projected(points, rvec, tvec, K, terms):
    return cv2.projectPoints(np.asarray(points, float), np.asarray(rvec, float), np.asarray(tvec, float), K, terms)[0][
        :, 0
    ]


def test_panoptic_files_are_in_centimetres_with_y_down(tmp_path):
    panoptic.write_calibration(tmp_path / "c.json", RIG)
    theirs = 100 * np.stack([POINTS[:, 0], -POINTS[:, 2], POINTS[:, 1]], axis=1)  # our z is their -y
    for entry, expected in zip(json.loads((tmp_path / "c.json").read_text())["cameras"], EXPECTED, strict=True):
        rvec = cv2.Rodrigues(np.array(entry["R"]))[0]
        pixels = projected(theirs, rvec, entry["t"], np.array(entry["K"]), np.array(entry["distCoef"]))
        np.testing.assert_allclose(pixels, expected, atol=1e-6)


def test_pose2sim_files_project_with_rodrigues_vectors_and_four_terms(tmp_path):
    pose2sim.write_calibration(tmp_path / "Calib.toml", RIG)
    sections = tomllib.loads((tmp_path / "Calib.toml").read_text())
    assert "metadata" in sections
    for k in range(2):
        entry = sections[f"c{k}"]
        assert len(entry["distortions"]) == 4
        assert entry["fisheye"] is False
        pixels = projected(
            POINTS, entry["rotation"], entry["translation"], np.array(entry["matrix"]), np.array(entry["distortions"])
        )
        np.testing.assert_allclose(pixels, EXPECTED[k], atol=1e-6)


def test_easymocap_files_project_by_either_rotation(tmp_path):
    easymocap.write_calibration(tmp_path, RIG)
    inner = cv2.FileStorage(str(tmp_path / "intri.yml"), cv2.FILE_STORAGE_READ)
    outer = cv2.FileStorage(str(tmp_path / "extri.yml"), cv2.FILE_STORAGE_READ)
    for k in range(2):
        K, terms = inner.getNode(f"K_c{k}").mat(), inner.getNode(f"dist_c{k}").mat()
        rvec, R, T = (outer.getNode(f"{name}_c{k}").mat() for name in ("R", "Rot", "T"))
        assert (terms.shape, rvec.shape, T.shape) == ((1, 5), (3, 1), (3, 1))
        for rotation in (rvec, cv2.Rodrigues(R)[0]):
            np.testing.assert_allclose(projected(POINTS, rotation, T, K, terms), EXPECTED[k], atol=1e-6)


def test_easymocap_takes_the_vector_where_there_is_no_matrix(tmp_path):
    easymocap.write_calibration(tmp_path, RIG)
    path = tmp_path / "extri.yml"
    outer = read_storage(path, what="")
    write_storage(path, {key: value for key, value in outer.items() if not key.startswith("Rot_")})
    inner = read_storage(tmp_path / "intri.yml", what="")
    write_storage(tmp_path / "intri.yml", {key: value for key, value in inner.items() if key[:2] not in ("H_", "W_")})
    rig = easymocap.read_calibration(path, size=(320, 240))
    np.testing.assert_allclose(rig.project(POINTS), EXPECTED, atol=1e-9)
    assert rig[0].size == (320, 240)


@pytest.mark.parametrize(
    "names",
    [
        ("camera_matrix", "distortion_coefficients", "R", "T", None),
        ("K", "dist", "rvec", "tvec", "size"),
        ("cameraMatrix", "distCoeffs", "rotation", "translation", "image_size"),
    ],
)
def test_opencv_files_by_the_usual_names(tmp_path, names):
    K, terms, R, T, size = names
    values = {}
    for camera in RIG:
        turn = camera.R if R == "R" else cv2.Rodrigues(camera.R)[0]
        values[camera.name] = {K: camera.K, terms: camera.distortion, R: turn, T: camera.t[:, None]}
        if size:
            values[camera.name][size] = list(camera.size)
    write_storage(tmp_path / "cameras.yml", values)
    rig = opencv.read_calibration(tmp_path / "cameras.yml", size=(640, 480))
    assert_same(rig, RIG)


def test_a_stereo_pair_leads_from_the_first_camera_to_the_second(tmp_path):
    """As stereoCalibrate defines it: x_2 = R x_1 + T."""
    R, T = Rotation.from_rotvec([0.01, 0.3, -0.02]).as_matrix(), np.array([[-0.4], [0.01], [0.05]])
    K, D = RIG[0].K, RIG[0].distortion[None]
    write_storage(tmp_path / "stereo.yml", {"M1": K, "D1": D, "M2": K, "D2": D, "R": R, "T": T})
    first, second = opencv.read_calibration(tmp_path / "stereo.yml", size=(640, 480))
    points = POINTS + (0, 0, 3)
    np.testing.assert_allclose(first.project(points), projected(points, np.zeros(3), np.zeros(3), K, D), atol=1e-6)
    np.testing.assert_allclose(second.project(points), projected(points, cv2.Rodrigues(R)[0], T, K, D), atol=1e-6)


def stereo(**change):
    eye = np.eye(3)
    return {
        "M1": eye,
        "D1": np.zeros((1, 5)),
        "M2": eye,
        "D2": np.zeros((1, 5)),
        "R": eye,
        "T": np.ones((3, 1)),
        **change,
    }


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (stereo(T=np.array([[120.0], [0], [0]])), r"are 120 apart, which cannot be metres: .* divide T by 1000"),
        ({key: value for key, value in stereo().items() if key != "T"}, r"M1 and M2 without T, missing in a file"),
        (
            {"R": np.eye(3), "T": np.ones((3, 1)), "P1": np.eye(3), "P2": np.eye(3)},
            r"R and T of a stereo pair without M1",
        ),
        (stereo(D1=np.ones((1, 8))), r"camera '1': distortion has terms of the rational model"),
        (stereo(D1=np.ones((1, 3))), r"camera '1': distortion must be 4 or 5 numbers .*, got 3"),
        (stereo(R=np.ones((2, 2))), r"camera '2': rotation must be a 3 x 3 rotation or a Rodrigues vector .*, got 4"),
        (stereo(M1=np.ones((2, 2))), r"camera '1': K must be \(3, 3\), got \(2, 2\)"),
        ({"a": {"K": np.eye(3), "T": [0, 0, 1]}, "b": {"K": np.eye(3)}}, r"camera 'a' has none of R, rvec"),
        ({"cameras": [1, 2]}, r"cameras must be a list of maps"),
        ({"cameras": [{"K": np.eye(3), "R": np.eye(3), "T": [0, 0, "x"]}]}, r"camera '0': translation must be numbers"),
    ],
)
def test_what_is_wrong_with_an_opencv_file_is_named(tmp_path, values, message):
    path = tmp_path / "mine.yml"
    write_storage(path, values)
    with pytest.raises(ValueError, match=r"mine\.yml: .*" + message):
        opencv.read_calibration(path, size=(640, 480))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda entry: entry.pop("rotation"), "camera 'c0' lacks rotation; expected size, matrix"),
        (lambda entry: entry.update(fisheye=True), "camera 'c0' has a fisheye lens"),
        (lambda entry: entry.update(matrix=[[1, 2], [3]]), "camera 'c0': K must be"),
        (lambda entry: entry.update(size=[640.0]), r"camera 'c0': size must be \(2,\), got \(1,\)"),
        (lambda entry: entry.update(size=[float("inf"), 480.0]), "camera 'c0': size must be a width and a height"),
        (lambda entry: entry.update(rotation=["a", 0, 0]), "camera 'c0': rotation must be numbers"),
        (lambda entry: entry.update(translation=[1.0]), r"camera 'c0': translation must be \(3,\)"),
    ],
)
def test_what_is_wrong_with_a_pose2sim_file_is_named(tmp_path, damage, message):
    path = tmp_path / "Calib.toml"
    pose2sim.write_calibration(path, RIG)
    sections = tomllib.loads(path.read_text())
    damage(sections["c0"])
    lines = []
    for name, entry in sections.items():
        lines += [
            f"[{name}]",
            *(f"{key} = {json.dumps(value).replace('Infinity', 'inf')}" for key, value in entry.items()),
        ]
    path.write_text("\n".join(lines))
    with pytest.raises(ValueError, match=r"Calib\.toml: " + message):
        pose2sim.read_calibration(path)


def test_toml_that_is_none_or_no_calibration_is_named(tmp_path):
    path = tmp_path / "Calib.toml"
    path.write_text("[a\n")
    with pytest.raises(ValueError, match=r"Calib\.toml: not TOML"):
        pose2sim.read_calibration(path)
    path.write_text("a = 3\n")
    with pytest.raises(ValueError, match=r"'a' must be a section with size, .*, got 3"):
        pose2sim.read_calibration(path)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda entry: entry.pop("K"), r"cameras\[0\] lacks K; expected name, resolution, K"),
        (lambda entry: entry.update(t=[[1.0], [2.0]]), r"camera 'c0': t must be \(3,\), got \(2,\)"),
        (lambda entry: entry.update(t=[[1.0], [None], ["x"]]), r"camera 'c0': t must be numbers"),
        (lambda entry: entry.update(distCoef=[1.0]), r"camera 'c0': distortion must be 4 or 5 numbers"),
        (lambda entry: entry.update(R=[[2, 0, 0], [0, 1, 0], [0, 0, 1]]), r"camera 'c0': R is not a rotation"),
        (
            lambda entry: entry.update(type="vga"),
            r"1 of 2 cameras are of type hd, expected at least 2; the file has hd, vga",
        ),
    ],
)
def test_what_is_wrong_with_a_panoptic_file_is_named(tmp_path, damage, message):
    path = tmp_path / "calibration.json"
    panoptic.write_calibration(path, RIG)
    content = json.loads(path.read_text())
    damage(content["cameras"][0])
    path.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=r"calibration\.json: " + message):
        panoptic.read_calibration(path)


def renamed(*names):
    return Rig([Camera(**{**vars_of(camera), "name": name}) for camera, name in zip(RIG, names, strict=True)])


@pytest.mark.parametrize(
    ("write", "rig", "message"),
    [
        (voxelpose.write_calibration, renamed("a", "a"), "needs a distinct name for every camera"),
        (panoptic.write_calibration, renamed("a", ""), "needs a distinct name for every camera"),
        (pose2sim.write_calibration, renamed("a", "metadata"), "cannot hold a camera called 'metadata'"),
        (
            lambda path, rig: easymocap.write_calibration(path.parent, rig),
            renamed("a.b", "c"),
            "FileStorage refuses the name",
        ),
    ],
)
def test_a_rig_that_a_file_cannot_hold_is_refused(tmp_path, write, rig, message):
    with pytest.raises(ValueError, match=message):
        write(tmp_path / "calibration.x", rig)


def test_panoptic_people_stand_on_the_floor(shared_data):
    """By the axes of the reader: feet on the floor, heads above them, all in the pictures."""
    folder = shared_data / "panoptic" / "160906_band1"
    rig = panoptic.read_calibration(folder / "calibration_160906_band1.json")
    assert len(rig) == 31
    for file in (folder / "hdPose3d_stage1_coco19").glob("*.json"):
        for body in json.loads(file.read_text())["bodies"]:
            joints = np.array(body["joints19"]).reshape(19, 4)
            x, y, z = (joints[:, :3] / 100).T
            ours = np.stack([x, z, -y], axis=1)[joints[:, 3] > 0.1]
            assert ours[:, 2].min() > -0.05
            assert 0.9 < ours[:, 2].max() < 2.1
            inside = [camera.inside(camera.project(ours)).mean() for camera in rig]
            assert np.mean(inside) > 0.7


@pytest.mark.parametrize("name", ["left ", " left"])
def test_a_name_that_opencv_would_change_is_refused(tmp_path, name):
    other = Camera(K=np.diag([500.0, 500, 1]), R=np.eye(3), t=np.zeros(3), size=(640, 480), name="right")
    rig = Rig([other, Camera(**{**vars_of(other), "name": name, "t": np.ones(3)})])
    with pytest.raises(ValueError, match=f"camera '{name}': OpenCV drops spaces"):
        opencv.write_calibration(tmp_path / "rig.yml", rig)
    assert not list(tmp_path.iterdir())
