"""Calibrations as labs have them: other key names, JSON of FileStorage, a file for each camera; and written again."""

import json

import cv2
import numpy as np
import pytest
from lab_files import studio

from mvpose import Rig
from mvpose.formats.calibration import easymocap, opencv, panoptic, pose2sim, voxelpose
from mvpose.formats.calibration.calibration_formats import read_calibration, write_like
from mvpose.formats.calibration.file_storage import write_storage

RIG = studio()
SIZE = (1280, 960)


def assert_same(read, written=RIG, *, names=True):
    if names:
        assert [camera.name for camera in read] == [camera.name for camera in written]
    for one, two in zip(read, written, strict=True):
        np.testing.assert_allclose(one.K, two.K, rtol=1e-9)
        np.testing.assert_allclose(one.R, two.R, atol=1e-9)
        np.testing.assert_allclose(one.t, two.t, atol=1e-9)
        assert one.size == two.size


def rvec(camera):
    return cv2.Rodrigues(camera.R)[0]


NAMINGS = {
    "numpy": lambda c: {"K": c.K, "D": c.distortion, "R": c.R, "t": c.t, "img_size": list(c.size)},
    "calibrateCamera": lambda c: {
        "mtx": c.K, "dist": c.distortion, "rvecs": rvec(c), "tvecs": c.t[:, None], "image_size": list(c.size),
    },
    "snake": lambda c: {
        "camera_matrix": c.K, "dist_coeffs": c.distortion, "rvec": rvec(c).ravel(), "tvec": c.t,
        "width": c.size[0], "height": c.size[1],
    },
    "camel": lambda c: {
        "cameraMatrix": c.K.ravel(), "distCoeffs": c.distortion, "rotationVector": rvec(c), "translationVector": c.t,
        "imageWidth": c.size[0], "imageHeight": c.size[1],
    },
    "nested": lambda c: {
        "intrinsics": {"intrinsic_matrix": c.K, "distortion_coefficients": c.distortion, "resolution": list(c.size)},
        "extrinsics": {"rotation_matrix": c.R, "translation": c.t},
    },
    "focal": lambda c: {
        "intrinsics": {"fx": c.K[0, 0], "fy": c.K[1, 1], "cx": c.K[0, 2], "cy": c.K[1, 2], "size": list(c.size)},
        "extrinsics": {"R": c.R, "T": c.t},
    },
    "one matrix": lambda c: {"K": c.K, "size": list(c.size), "extrinsic_matrix": np.column_stack([c.R, c.t])},
    "camera to world": lambda c: {
        "K": c.K, "size": list(c.size),
        "camera_to_world": np.vstack([np.column_stack([c.R.T, c.center]), [0, 0, 0, 1]]),
    },
}  # fmt: skip


def plain(value):
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


class TestNames:
    @pytest.mark.parametrize("naming", NAMINGS)
    def test_plain_json_of_all_cameras(self, tmp_path, naming):
        content = {camera.name: plain(NAMINGS[naming](camera)) for camera in RIG}
        (tmp_path / "cameras.json").write_text(json.dumps(content))
        assert_same(read_calibration(tmp_path / "cameras.json", size=(1, 1)))
        listed = {"cameras": [{"name": name, **entry} for name, entry in content.items()]}
        (tmp_path / "listed.json").write_text(json.dumps(listed))
        assert_same(read_calibration(tmp_path / "listed.json", size=(1, 1)))

    @pytest.mark.parametrize("naming", NAMINGS)
    @pytest.mark.parametrize("ending", ["json", "yml", "xml"])
    def test_a_file_for_each_camera_of_file_storage(self, tmp_path, naming, ending):
        for camera in RIG:
            values = {
                key: {name: matrix(each) for name, each in value.items()} if isinstance(value, dict) else matrix(value)
                for key, value in NAMINGS[naming](camera).items()
            }
            write_storage(tmp_path / f"{camera.name}_calibration.{ending}", values)
        assert_same(read_calibration(tmp_path, size=(1, 1)))

    def test_rodrigues_vectors_in_degrees_are_refused(self, tmp_path):
        entries = {c.name: plain({"K": c.K, "rvec": np.degrees(rvec(c)), "tvec": c.t, "size": list(SIZE)}) for c in RIG}
        (tmp_path / "cameras.json").write_text(json.dumps(entries))
        with pytest.raises(ValueError, match=r"'cam0': rotation must be a Rodrigues vector in radians.* degrees"):
            read_calibration(tmp_path / "cameras.json", size=SIZE)


def matrix(value):
    return np.atleast_2d(value) if isinstance(value, np.ndarray) else value


class TestFolders:
    def test_intrinsics_and_extrinsics_in_two_files_of_a_camera(self, tmp_path):
        for camera in RIG:
            write_storage(tmp_path / f"{camera.name}_intrinsics.yml", {"K": camera.K, "size": list(SIZE)})
            write_storage(tmp_path / f"{camera.name}_extrinsics.yml", {"R": camera.R, "T": camera.t[:, None]})
        assert_same(read_calibration(tmp_path, size=(1, 1)))
        assert_same(read_calibration(tmp_path, size=(1, 1), only=("cam2", "cam0")), [RIG[2], RIG[0]])

    def test_two_files_of_a_camera_that_both_hold_a_value(self, tmp_path):
        for name in ("cam0", "cam0_calib", "cam1"):
            opencv.write_values(tmp_path / f"{name}.yml", RIG[0])
        with pytest.raises(ValueError, match=r"cam0_calib\.yml: two files of the camera 'cam0' have"):
            read_calibration(tmp_path, size=SIZE)

    def test_a_folder_of_one_file_and_a_project_of_pose2sim(self, tmp_path):
        (tmp_path / "calibration").mkdir()
        pose2sim.write_calibration(tmp_path / "calibration" / "Calib.toml", RIG)
        (tmp_path / "Config.toml").write_text("[project]\nframe_rate = 60\n")
        assert_same(read_calibration(tmp_path, size=SIZE))
        assert_same(read_calibration(tmp_path / "calibration", size=SIZE))
        (tmp_path / "easymocap").mkdir()
        easymocap.write_calibration(tmp_path / "easymocap", RIG)
        assert_same(read_calibration(tmp_path / "easymocap", size=SIZE))

    def test_an_empty_folder(self, tmp_path):
        with pytest.raises(ValueError, match=r"has no \*\.json, .*expected a folder of calibrations"):
            read_calibration(tmp_path, size=SIZE)


class TestWriteLike:
    @pytest.mark.parametrize(
        ("write", "file"),
        [
            (voxelpose.write_calibration, "c.json"),
            (panoptic.write_calibration, "c.json"),
            (pose2sim.write_calibration, "Calib.toml"),
            (opencv.write_calibration, "c.yml"),
            (opencv.write_calibration, "c.xml"),
            (opencv.write_calibration, "c.json"),
            (lambda path, rig: easymocap.write_calibration(path.parent, rig), "intri.yml"),
        ],
    )
    def test_a_rig_is_written_in_the_format_of_another_and_read_back(self, tmp_path, write, file):
        (tmp_path / "old").mkdir()
        write(tmp_path / "old" / file, RIG)
        other = Rig(RIG.cameras[::-1])
        write_like(tmp_path / "old" / file, tmp_path / "new" / file, other)
        assert_same(read_calibration(tmp_path / "new" / file, size=SIZE), other)

    @pytest.mark.parametrize("ending", ["json", "yml", "xml"])
    def test_a_folder_is_written_as_one(self, tmp_path, ending):
        (tmp_path / "old").mkdir()
        for camera in RIG:
            opencv.write_values(tmp_path / "old" / f"{camera.name}.{ending}", camera)
        write_like(tmp_path / "old", tmp_path / "new", RIG)
        assert sorted(each.name for each in (tmp_path / "new").iterdir()) == [f"cam{k}.{ending}" for k in range(4)]
        assert_same(read_calibration(tmp_path / "new", size=(1, 1)))
