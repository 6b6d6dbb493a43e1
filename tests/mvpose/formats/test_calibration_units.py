"""Calibrations in other units than metres, of cameras that are not all calibrated, and judged before detections."""

import json
import shutil
import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest
from lab_files import filmed, studio, write_openpose
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.cli.app import app
from mvpose.formats.calibration import panoptic, pose2sim, voxelpose
from mvpose.formats.calibration.calibration_formats import read_calibration, write_like
from mvpose.formats.calibration.file_storage import write_storage

RIG = studio()


def scaled(rig, factor):
    """The cameras in another unit."""
    return Rig.unchecked([replace(camera, t=factor * camera.t) for camera in rig])


def write_caliscope(path, rig, *, bare=(), missing="", header="cameras."):
    """Tables of caliscope, or of Anipose with another header; ``bare`` cameras lack ``missing`` keys."""
    lines = []
    for k, camera in enumerate(rig):
        entry = {
            "port": k,
            "rotation_count": 0,
            "error": 0.4,
            "size": list(camera.size),
            "matrix": camera.K.tolist(),
            "distortions": camera.distortion.tolist(),
            "translation": camera.t.tolist(),
            "rotation": cv2.Rodrigues(camera.R)[0].ravel().tolist(),
        }
        entry = {key: each for key, each in entry.items() if k not in bare or key not in missing.split()}
        lines += [f"[{header}{k}]", *(f"{key} = {json.dumps(value)}" for key, value in entry.items()), ""]
    path.write_text("\n".join([*lines, "[metadata]", "adjusted = false"] if header != "cameras." else lines))


def places(rig):
    return np.array([camera.center for camera in rig])


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1000.0), ("cm", 100.0), ("m", 1.0)])
def test_anipose_files_have_the_unit_that_is_stated(tmp_path, unit, factor):
    path = tmp_path / "calibration.toml"
    write_caliscope(path, scaled(RIG, factor), header="cam_")
    np.testing.assert_allclose(places(read_calibration(path, size=(1, 1), unit=unit)), places(RIG), atol=1e-9)
    if unit != "m":
        with pytest.raises(ValueError, match=r"cannot be metres .*--unit mm"):
            read_calibration(path, size=(1, 1))


def test_a_small_rig_in_millimetres_is_scaled_too(tmp_path):
    small = scaled(RIG, 0.01)  # 9 cm across, 90 in millimetres: a rig of 90 m as well
    write_caliscope(tmp_path / "calibration.toml", scaled(small, 1000.0), header="cam_")
    read = read_calibration(tmp_path / "calibration.toml", size=(1, 1), unit="mm")
    np.testing.assert_allclose(places(read), places(small), atol=1e-9)


def test_a_stereo_pair_in_millimetres(tmp_path):
    eye = np.eye(3)
    values = {"M1": eye, "D1": np.zeros((1, 5)), "M2": eye, "D2": np.zeros((1, 5)), "R": eye}
    write_storage(tmp_path / "pair.yml", {**values, "T": np.array([[120.0], [0], [0]])})
    read = read_calibration(tmp_path / "pair.yml", size=(640, 480), unit="mm")
    np.testing.assert_allclose(read[1].t, [0.12, 0.0, 0.0])


def test_a_unit_that_contradicts_the_format_is_refused(tmp_path):
    path = tmp_path / "voxelpose.json"
    voxelpose.write_calibration(path, RIG)
    np.testing.assert_allclose(places(read_calibration(path, size=(1, 1), unit="mm")), places(RIG), atol=1e-9)
    with pytest.raises(ValueError, match=r"--unit cm: files such as .*voxelpose\.json are in mm"):
        read_calibration(path, size=(1, 1), unit="cm")
    with pytest.raises(ValueError, match="--unit must be one of m, cm, mm, got 'inch'"):
        read_calibration(path, size=(1, 1), unit="inch")


def test_a_file_for_each_camera_of_panoptic_is_in_centimetres(tmp_path):
    panoptic.write_calibration(tmp_path / "all.json", RIG)
    for k, entry in enumerate(json.loads((tmp_path / "all.json").read_text())["cameras"]):
        (tmp_path / "cameras").mkdir(exist_ok=True)
        content = {**entry, "node": k, "panel": 0}
        content.pop("name")
        (tmp_path / "cameras" / f"cam{k}.json").write_text(json.dumps(content))
    for unit in (None, "cm"):
        read = read_calibration(tmp_path / "cameras", size=(1, 1), unit=unit)
        np.testing.assert_allclose(read.packed, RIG.packed, atol=1e-9)
    with pytest.raises(ValueError, match="are in cm"):
        read_calibration(tmp_path / "cameras", size=(1, 1), unit="mm")


class TestCaliscope:
    def test_calibrated_cameras_are_read(self, tmp_path):
        write_caliscope(tmp_path / "camera_array.toml", RIG)
        read = read_calibration(tmp_path / "camera_array.toml", size=(1, 1))
        assert [camera.name for camera in read] == ["0", "1", "2", "3"]
        np.testing.assert_allclose(read.packed, RIG.packed, atol=1e-9)

    def test_they_are_written_as_toml(self, tmp_path):
        """OpenCV writes no TOML: before, YAML went into such a file."""
        old, new = tmp_path / "camera_array.toml", tmp_path / "new.toml"
        write_caliscope(old, RIG)
        write_like(old, new, read_calibration(old, size=(1, 1)))
        assert {"0", "1", "2", "3"} <= tomllib.loads(new.read_text()).keys()
        np.testing.assert_allclose(read_calibration(new, size=(1, 1)).packed, RIG.packed, atol=1e-9)

    @pytest.mark.parametrize(
        ("missing", "said"),
        [
            ("rotation translation", "1 lacks rotation and translation"),
            ("matrix", "1 lacks intrinsics"),
            ("matrix distortions rotation translation", "1 lacks intrinsics, rotation and translation"),
        ],
    )
    def test_those_that_are_not_are_named_and_may_be_left_out(self, tmp_path, missing, said):
        path = tmp_path / "camera_array.toml"
        write_caliscope(path, RIG, bare=(1,), missing=missing)
        with pytest.raises(ValueError, match=rf"{said}.*--cameras 0,2,3"):
            read_calibration(path, size=(1, 1))
        read = read_calibration(path, size=(1, 1), only=("0", "2", "3"))
        np.testing.assert_allclose(read.packed, RIG.packed[[0, 2, 3]], atol=1e-9)
        write_caliscope(path, RIG, bare=range(4), missing=missing)
        with pytest.raises(ValueError, match="not all cameras are calibrated: 0 lacks"):
            read_calibration(path, size=(1, 1))

    def test_a_value_that_is_null_is_missing(self, tmp_path):
        path = tmp_path / "camera_array.toml"
        write_caliscope(path, RIG, bare=(1,), missing="matrix")
        path.write_text(path.read_text().replace("port = 1", 'port = 1\nmatrix = "null"'))
        with pytest.raises(ValueError, match="1 lacks intrinsics"):
            read_calibration(path, size=(1, 1))

    def test_a_fisheye_lens_is_refused(self, tmp_path):
        path = tmp_path / "camera_array.toml"
        write_caliscope(path, RIG)
        path.write_text(path.read_text().replace("port = 1", "port = 1\nfisheye = true"))
        with pytest.raises(ValueError, match="camera '1' has a fisheye lens"):
            read_calibration(path, size=(1, 1))


def test_anipose_cameras_may_be_left_out(tmp_path):
    path = tmp_path / "calibration.toml"
    write_caliscope(path, RIG, bare=(1,), missing="rotation translation", header="cam_")
    with pytest.raises(ValueError, match="camera 'cam_1' lacks rotation, translation"):
        read_calibration(path, size=(1, 1))
    assert len(read_calibration(path, size=(1, 1), only=("cam_0", "cam_2"))) == 2


def test_a_folder_of_qualisys_is_read(tmp_path, shared_data):
    folder = shared_data / "pose2sim" / "single" / "calibration"
    assert len(read_calibration(folder, size=(1, 1))) == 4
    for file in folder.iterdir():
        shutil.copy(file, tmp_path)
    pose2sim.write_calibration(tmp_path / "Calib.toml", RIG)  # converted: it goes before
    np.testing.assert_allclose(read_calibration(tmp_path, size=(1, 1)).packed, RIG.packed, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda camera: replace(camera, t=1000.0 * camera.t), "cannot be metres"),
        (lambda camera: replace(camera, R=camera.R @ np.diag([1.0, -1.0, -1.0])), "the -z axis of the world"),
        (lambda camera: replace(camera, size=camera.size[::-1]), "width and height"),
    ],
)
def test_a_calibration_is_judged_before_detections_are_read(tmp_path, change, said):
    rig, _, pixels = filmed(frames=3)
    write_openpose(tmp_path / "openpose", [camera.name for camera in rig], pixels)
    for file in (tmp_path / "openpose").glob("*/*1_keypoints.json"):
        file.write_text('{"people": [')
    wrong = Rig.unchecked([change(camera) for camera in rig])
    pose2sim.write_calibration(tmp_path / "Calib.toml", wrong)
    command = ["estimate", str(tmp_path / "Calib.toml"), str(tmp_path / "openpose"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert said in result.stderr
