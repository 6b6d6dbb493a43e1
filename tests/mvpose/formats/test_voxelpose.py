import json

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from mvpose.formats.calibration.voxelpose import read_calibration

SIZE = (640, 480)


def calibration():
    """Two cameras 2 m and 3 m from the origin, as VoxelPose writes them."""
    cameras = {}
    for name, center, angle in (("a", [2000.0, 100.0, 1500.0], 0.3), ("b", [-3000.0, 50.0, 1400.0], 2.0)):
        cameras[name] = {
            "fx": 500.0,
            "fy": 510.0,
            "cx": 320.0,
            "cy": 240.0,
            "R": Rotation.from_euler("xyz", [angle, 0.2, -0.1]).as_matrix().tolist(),
            "T": [[value] for value in center],
            "k": [[0.1], [0.02], [0.003]],
            "p": [[0.004], [0.005]],
        }
    return cameras


def written(tmp_path, cameras):
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(cameras))
    return path


def test_the_centre_is_in_millimetres_and_the_axes_are_kept(tmp_path):
    cameras = calibration()
    rig = read_calibration(written(tmp_path, cameras), size=SIZE)
    assert [camera.name for camera in rig] == ["a", "b"]
    np.testing.assert_allclose(rig.centers, [[2.0, 0.1, 1.5], [-3.0, 0.05, 1.4]], atol=1e-12)
    for camera, entry in zip(rig, cameras.values(), strict=True):
        assert camera.size == SIZE
        assert camera.distortion.tolist() == [0.1, 0.02, 0.004, 0.005, 0.003]
        # x_cam = R (X - T): the centre plus 1.5 m along the third row of R is on the axis, so at (cx, cy).
        axis = np.array(entry["R"])[2]
        np.testing.assert_allclose(camera.project(camera.center + 1.5 * axis), [320, 240], atol=1e-9)
        assert camera.depth(camera.center + 1.5 * axis) == pytest.approx(1.5)


def test_metres_are_recognised(tmp_path):
    cameras = calibration()
    for entry in cameras.values():
        entry["T"] = [[value / 1000] for (value,) in entry["T"]]
    with pytest.raises(ValueError, match=r"calibration.json: .*look like metres, expected millimetres.*by 1000"):
        read_calibration(written(tmp_path, cameras), size=SIZE)


def test_a_rig_too_large_for_millimetres_is_refused(tmp_path):
    cameras = calibration()
    for entry in cameras.values():
        entry["T"] = [[value * 1000] for (value,) in entry["T"]]
    with pytest.raises(ValueError, match=r"calibration.json: the cameras stand up to 5000 apart"):
        read_calibration(written(tmp_path, cameras), size=SIZE)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda cameras: cameras["b"].pop("fx"), r"camera 'b' lacks fx; expected fx, fy, cx, cy, R, T, k, p"),
        (lambda cameras: cameras["b"].update(R=[[1, 0], [0, 1]]), r"camera 'b': R must be \(3, 3\), got \(2, 2\)"),
        (lambda cameras: cameras["a"].update(T=[1, 2]), r"camera 'a': T must be \(3,\), got \(2,\)"),
        (lambda cameras: cameras["a"].update(fx="wide"), r"camera 'a': fx must be numbers"),
        (lambda cameras: cameras["a"].update(k=[[0.1], ["x"], [0]]), r"camera 'a': k must be numbers"),
        (lambda cameras: cameras.update(c=3), r"camera 'c' must be an object with .*, got a int"),
        (lambda cameras: cameras.pop("a"), r"a rig needs at least 2 cameras"),
        (lambda cameras: cameras.clear(), r"a rig needs at least 2 cameras"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, damage, message):
    cameras = calibration()
    damage(cameras)
    with pytest.raises(ValueError, match=r"calibration\.json: " + message):
        read_calibration(written(tmp_path, cameras), size=SIZE)


def test_missing_truncated_and_other_files_are_named(tmp_path):
    path = tmp_path / "calibration.json"
    with pytest.raises(ValueError, match=r"calibration\.json: no such file; expected a VoxelPose calibration"):
        read_calibration(path, size=SIZE)
    text = json.dumps(calibration())
    path.write_text(text[: len(text) // 2])
    with pytest.raises(ValueError, match=r"calibration\.json: broken or truncated JSON .*cut off"):
        read_calibration(path, size=SIZE)
    path.write_text("[1, 2]")
    with pytest.raises(ValueError, match=r"calibration\.json: .*got a list"):
        read_calibration(path, size=SIZE)
    with pytest.raises(ValueError, match=r"is a folder, not a regular file"):
        read_calibration(tmp_path, size=SIZE)


def test_shelf_truth_projects_onto_its_own_annotation(shared_data):
    """The published 3D and 2D annotations agree to 0.03 px (median)."""
    rig = read_calibration(shared_data / "shelf" / "calibration_shelf.json", size=(1032, 776))
    mat = loadmat(shared_data / "shelf" / "actorsGT.mat")
    errors = []
    for actor in range(4):
        poses, pictures = mat["actor3D"][0, actor][:, 0], mat["actor2D"][0, actor][:, 0]
        for frame in range(300, 600):
            if poses[frame].shape != (14, 3):
                continue
            for view, camera in enumerate(rig):
                annotated = pictures[frame][0, view]
                if annotated.shape == (14, 2):
                    errors.append(np.linalg.norm(camera.project(poses[frame]) - annotated, axis=1))
    assert len(errors) > 1000
    assert np.nanmedian(np.concatenate(errors)) < 0.05


def test_campus_reads_too(shared_data):
    rig = read_calibration(shared_data / "calibration_campus.json", size=(360, 288))
    assert len(rig) == 3
    assert 1 < np.ptp(rig.centers, axis=0).max() < 50
